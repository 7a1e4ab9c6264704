"""A study made of somebody's own recordings: `study.toml` and what belongs to it, with all that was assumed said.

What the files do not say is taken from options, or asked of a person at a terminal; only start values are guessed.
"""

import re
import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from fes_pin.data.as_read import HeldFile
from fes_pin.data.channels import EMG, EMG_KEYS
from fes_pin.data.errors import InputError
from fes_pin.data.files import inside, read_bytes
from fes_pin.data.nested_trials import recordings_in
from fes_pin.data.new_columns import NewColumns, Source
from fes_pin.data.new_recording import Proposal
from fes_pin.data.new_view import FilesOfTrial, WantedView, grouped_files, trial_view
from fes_pin.data.schema import NumberKey, any_number, one_of, unknown
from fes_pin.data.side_by_side import COLUMNS, SideBySide
from fes_pin.data.study_text import HEADER, source_in_words, toml_table
from fes_pin.data.wanted import Wanted, labels_of, number_set, of_files


@dataclass(frozen=True)
class NewStudy:
    """The files of a new study, not written yet.

    Parameters
    ----------
    contents
        By path below the study's folder: `study.toml`, and what is copied there.
    taken
        The rig's column, the file's name of it and its unit, as a person wants to see them.
    origins
        Where each recording, and the URDF, lies, by its path below the study's folder.
    said
        What is odd about the recordings, and how they are taken, a sentence each.
    """

    contents: Mapping[str, str | bytes]
    taken: tuple[tuple[str, str, str], ...]
    origins: Mapping[str, Path]
    said: tuple[str, ...] = ()

    def files_of(self, trial: int) -> list[Path]:
        """The recordings of one `[[trial]]`, by its place in study.toml."""
        table = tomllib.loads(str(self.contents["study.toml"]))["trial"][trial]
        return [self.origins[place] for place in table.get("sources", table).values() if place in self.origins]


Guess = Callable[[Mapping[str, float], Collection[str]], Mapping[str, float]]
"""Start values of what a nominal model fits, by the known numbers of its rig and by what was recorded."""


def new_study(wanted: Wanted, guess: Guess) -> NewStudy:
    """Propose a study of recordings.

    Parameters
    ----------
    guess
        Start values of what the nominal model fits, of the rig's known numbers and its columns: for those that nobody
        gave.

    Raises
    ------
    InputError
        A recording that cannot be read; what the files do not say and no option does, all of it in one line.
    """
    while True:
        making = _Making(wanted)
        made = making.made(guess)
        if made is not None:
            return made
        wanted = making.answered()


def with_kind(made: NewStudy, kind: str) -> NewStudy:
    """Return a new study with a kind for the trials that state none."""
    text = re.sub(
        r"(\[\[trial\]\]\n(?:file|sources) = .*\n(?:sheet = .*\n)?)(?!kind|sheet)",
        rf'\1kind = "{kind}"\n',
        str(made.contents["study.toml"]),
    )
    return replace(made, contents={**made.contents, "study.toml": text})


class _Making:
    """One study in the making; `missing` collects what nobody has said."""

    def __init__(self, wanted: Wanted) -> None:
        self.wanted, self.schema = wanted, wanted.schema
        self.missing: dict[str, str] = {}
        """What nobody has said, as options, and what is asked for it, by `column NAME` or `set KEY`."""
        self.own = of_files(wanted.files, "--set", wanted.settings)
        chosen = tuple(wanted.columns.values())
        found = [recordings_in(p, self.schema, wanted, chosen) for p in wanted.files]
        each = [one for some in found for one in some]
        apart = SideBySide(self.schema, wanted.revolute, wanted.split, chosen)
        grouped = grouped_files(each, self.schema, wanted.sources)
        self.trials = [trial for files in grouped for trial in apart.trials(files)]
        self.columns = NewColumns(wanted, self.trials, self.missing)

    def made(self, guess: Guess) -> NewStudy | None:
        """The study; None where something is missing and a person can be asked."""
        kinds = [self._kind(one.proposal) for one in self.trials]
        times = self.columns.times()
        columns = self.columns.taken(set(kinds))
        looked_hz = self.columns.looked_hz(times.get("", {}))
        also = self._also_needed(columns)
        rig, passive = (self._numbers(table, also) for table in (self.schema.constants, self.schema.passive))
        conditions = [self._conditions(one.path, kind) for one, kind in zip(self.trials, kinds, strict=True)]
        known, start = self._start(guess, {**rig, **passive}, [*columns, *self.columns.derived])
        self._check_settings(sorted(set(kinds)))
        if self.missing and self.wanted.ask is not None:
            return None
        if self.missing:
            raise self._incomplete()
        contents: dict[str, str | bytes] = {}
        files = self._urdf(contents)
        places = {path: placed(path, self.wanted.folder, contents, "trials/") for path in self.wanted.files}
        text = [
            *toml_table("study", {"name": self.wanted.name, "rig": self.schema.name}),
            *toml_table("rig", {**files, **rig, **known}, "known before the trials, never fitted", self._units()),
            *toml_table("rig.passive", passive, "known as well", self._units()),
            *toml_table("start", start, "start values of what the nominal model fits", self._units()),
            *self.columns.text(columns, times, looked_hz),
        ]
        said = [*self.columns.said(times)]
        for one, kind, stated in zip(self.trials, kinds, conditions, strict=True):
            view, odd = trial_view(one, times, self._position(columns), self._view(one.path, looked_hz))
            said += odd
            its_files = {source: places[p.recording.path] for source, p in one.files.items()}
            text += toml_table("[trial]", self._trial_keys(one, its_files, kind) | view | stated)
        contents["study.toml"] = "\n".join([*HEADER, *text]) + "\n"
        origins = {place: path for path, place in places.items()}
        if self.wanted.urdf is not None:
            origins[files["urdf"]] = self.wanted.urdf
        return NewStudy(contents, self._taken(columns, times), origins, tuple(dict.fromkeys(said)))

    def _also_needed(self, columns: Collection[str]) -> tuple[str, ...]:
        """Constants that a study with these columns needs: ends of recruitment, the cut-off of an EMG."""
        channel = self.columns.channel(columns)
        return (*(channel.ends if channel else ()), *(EMG_KEYS[:1] if EMG in columns else ()))

    def _taken(self, columns: Mapping[str, Source], times: Mapping[str, Source]) -> tuple[tuple[str, str, str], ...]:
        """Each of the rig's columns with the file's name of it and its unit, as `NewStudy` has them."""
        every = [*(("time_s", time) for time in times.values()), *columns.items()]
        revolute = self.wanted.revolute
        return tuple((c, s.get("name", "from its rate"), source_in_words(s, c, revolute)) for c, s in every)

    def _trial_keys(self, one: FilesOfTrial, files: Mapping[str, str], kind: str) -> dict[str, Any]:
        """Its files, its kind where that is not open, and its labels."""
        sources = {p.renamed.name if p.renamed else source: files[source] for source, p in one.files.items()}
        whole: dict[str, Any] = {"sources": sources} if "" not in sources else {"file": files[""]}
        known = {"sheet": one.proposal.sheet} if one.proposal.sheet else {}
        known |= {} if self._is_open(one.proposal, kind) else {"kind": kind}
        return {**whole, **known, **labels_of(self.wanted, *(p.recording.path for p in one.files.values()))}

    def _position(self, columns: Mapping[str, Source]) -> str | None:
        """The files' name of the position of a rig that nothing drives; None where something may."""
        is_free = not self.schema.inputs_required and not set(columns) & set(self.schema.inputs)
        return columns["position"]["name"] if is_free and "position" in columns else None

    def _view(self, path: Path, looked_hz: float | None) -> WantedView:
        """What a person said of the part of a recording that a trial is."""
        texts = {key: self.own.get((path, key)) or self.wanted.settings.get(key) for key in ("from", "to")}
        ends = {key: number_set(key, text, any_number("s", False)) for key, text in texts.items() if text is not None}
        split = None if self.wanted.split == COLUMNS else self.wanted.split
        split = "none" if split is None and looked_hz else split  # rows come with events
        rate_hz, derived = self.wanted.resample_hz, self.columns.derived
        return WantedView(ends, split, self.wanted.offsets, rate_hz, derived, is_regular=bool(rate_hz or looked_hz))

    def _incomplete(self) -> InputError:
        odd = "".join(f"{sentence}; " for sentence in self.columns.odd())
        return InputError(f"{odd}the files do not say everything; please add {', '.join(self.missing.values())}")

    def answered(self) -> Wanted:
        """What is wanted, with what a person answers: all that is odd is said once, then each thing asked for.

        Raises
        ------
        InputError
            A needed answer is empty; then all that is missing is in one line.
        """
        wanted = self.wanted
        if wanted.say is not None:
            wanted.say("\n".join([*self.columns.odd(), "what the files do not say:", *self.missing.values()]))
        columns, settings = dict(wanted.columns), dict(wanted.settings)
        for key, what in self.missing.items():
            table, _, name = key.partition(" ")
            answer = self._answer(table, name, what)
            if table == "column":
                columns[name] = answer.removeprefix(f"{name}=")
            else:
                settings[name] = answer.rpartition("=")[2].strip()
        return replace(wanted, columns=columns, settings=settings)

    def _answer(self, table: str, name: str, what: str) -> str:
        """A person's answer that is understood; one that is not is asked for again, with the reason."""
        ask, why = self.wanted.ask, ""
        if ask is None:
            raise self._incomplete()
        question = what.removeprefix("--column ").removeprefix("--set ")
        while True:
            answer = ask(f"{why}{question}").strip()
            if not answer and "or nothing:" not in what:
                raise self._incomplete()
            try:
                if table == "column":
                    self.columns.stated(name, answer.removeprefix(f"{name}="))
                else:
                    self._understood(name, answer.rpartition("=")[2].strip())
                return answer
            except InputError as error:
                why = f"{error.message}; "

    def _understood(self, key: str, text: str) -> None:
        last = key.rpartition(":")[2].removeprefix("rig.")
        tables = (self.schema.constants, self.schema.passive, self.schema.start, self.schema.conditions)
        number_set(last, text, next(table[last] for table in tables if last in table))

    def _kind(self, proposal: Proposal) -> str:
        """The kind of trial that a file's columns make."""
        path, outputs = proposal.recording.path, self.schema.outputs
        if (given := self.own.get((path, "kind"), self.wanted.kind)) is not None:
            return one_of(given, tuple(outputs), partial(InputError, column="--set kind"))
        has = self._has(proposal)
        fits = [k for k, c in outputs.items() if c in has]
        default = self.schema.default_kind
        read = {k: sum(bool(proposal.candidates[c]) for c in self.schema.columns_of(k)) for k in fits}
        return max(fits, key=lambda k: (read[k], k == default), default=default)

    def _is_open(self, proposal: Proposal, kind: str) -> bool:
        """Return whether nobody said a kind, and the data show which of two it is."""
        stated = self.own.get((proposal.recording.path, "kind"), self.wanted.kind)
        read = [c for c in self.schema.columns_of(kind) if c in self._has(proposal)]
        return stated is None and self.schema.is_driven_or_read(read)

    def _has(self, proposal: Proposal) -> set[str]:
        """The rig's columns that the files of a trial seem to hold."""
        found = {c for c, names in proposal.candidates.items() if names}
        return {*self.wanted.columns, *self.columns.derived, *found}

    def _number(self, key: str, number: NumberKey, path: Path | None = None) -> dict[str, float]:
        """A number that somebody gave, by its key in the study; empty, and it is missing, if nobody has."""
        text = (self.own.get((path, key)) if path else None) or self.wanted.settings.get(key)
        place = f"{path.name}:" if path and len(self.trials) > 1 else ""
        if not text:
            what = f"--set {place}{key}=NUMBER{f' ({number.unit})' if number.unit else ''}"
            self.missing[f"set {path}:{key}" if place else f"set {key}"] = what
            return {}
        return {key.removeprefix("rig."): number_set(key, text, number)}

    def _numbers(self, table: Mapping[str, NumberKey], also: Collection[str]) -> dict[str, float]:
        """Numbers of a table: those that it must have, those that were given, and `also`."""
        out: dict[str, float] = {}
        for key, number in table.items():
            needed = number.required or key in also
            if needed or key in self.wanted.settings:
                out |= self._number(key, number)
        return out

    def _conditions(self, path: Path, kind: str) -> dict[str, float]:
        """Conditions of one trial."""
        out: dict[str, float] = {}
        needed = self.schema.needed.get(kind, {})
        for key, number in self.schema.conditions.items():
            its_own = (path, key) in self.own
            if self.schema.only.get(key, kind) != kind:
                if its_own:
                    raise InputError(f"{path.name} makes a {kind} trial, which has none", column=f"--set {key}")
            elif key in needed or key in self.wanted.settings or its_own:
                out |= self._number(key, number, path)
        return out

    def _start(
        self, guess: Guess, rig: Mapping[str, float], columns: Collection[str]
    ) -> tuple[dict[str, float], dict[str, float]]:
        """What is known of `[start]`, as `rig.KEY` was set, and what is fitted."""
        known: dict[str, float] = {}
        start: dict[str, float] = {}
        guessed = {} if self.missing else guess(rig, columns)
        for key, number in self.schema.start.items():
            if f"rig.{key}" in self.wanted.settings and self.schema.start_may_be_known:
                known |= self._number(f"rig.{key}", number)
            elif key in self.wanted.settings:
                start |= self._number(key, number)
            elif key in guessed:
                start[key] = float(f"{guessed[key]:.3g}")
        return known, start

    def _check_settings(self, kinds: Collection[str]) -> None:
        """Refuse what was said and nothing reads."""
        schema = self.schema
        known = [*schema.constants, *schema.passive, *schema.start, *schema.conditions, "from", "to"]
        also = [f"rig.{key}" for key in schema.start] if schema.start_may_be_known else []
        for key in self.wanted.settings:
            file, _, last = key.rpartition(":")
            if last not in ([*schema.conditions, "kind", "from", "to"] if file else [*known, *also]):
                raise InputError(unknown(last, known), column=f"--set {key}")
            if not file and (kind := schema.only.get(key)) not in (None, *kinds):
                raise InputError(f"no trial is of kind {kind}, and others have none", column=f"--set {key}")
        read = {"time_s", *(c for kind in kinds for c in schema.columns_of(kind))}
        if unread := [c for c in self.wanted.columns if c not in read]:
            raise InputError(f"no trial of kind {' or '.join(kinds)} reads it", column=f"--column {unread[0]}")

    def _urdf(self, contents: dict[str, str | bytes]) -> dict[str, str]:
        urdf = self.wanted.urdf
        if urdf is None:
            return {}
        if isinstance(urdf, HeldFile):  # a template, which is on no disk
            contents[urdf.name] = read_bytes(urdf)
            return {"urdf": urdf.name}
        return {"urdf": placed(urdf, self.wanted.folder, contents)}

    def _units(self) -> dict[str, str]:
        schema = self.schema
        return {k: n.unit for table in (schema.constants, schema.passive, schema.start) for k, n in table.items()}


def placed(path: Path, folder: Path, contents: dict[str, str | bytes], below: str = "") -> str:
    """A file's path below a study's folder; one that lies elsewhere is put among the contents, in a folder `below`.

    Raises
    ------
    InputError
        Another file has that place, in the folder or among the contents.
    """
    try:
        relative = path.absolute().relative_to(folder.absolute()).as_posix()
        inside(folder, relative)
        return relative
    except ValueError:
        place = f"{below}{path.name}"
    content, there = read_bytes(path), folder / place
    if place in contents or (there.exists() and not (there.is_file() and there.read_bytes() == content)):
        raise InputError(f"would be copied to {place}, where there is another file already", file=path)
    contents[place] = content
    return place
