"""A study made of somebody's own recordings: `study.toml` and what belongs to it, with all that was assumed said.

What the files do not say is taken from options, or asked of a person at a terminal; only start values are guessed.
"""

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.as_read import HeldFile
from fes_pin.data.channels import AMPLITUDE, CHANNELS, EMG, EMG_KEYS, RATE, WIDTH, Channel, channel_of
from fes_pin.data.errors import InputError, fault_at
from fes_pin.data.files import inside, read_bytes
from fes_pin.data.recorded.columns import INTERPOLATE
from fes_pin.data.recorded.events import EVENTS, looking_period
from fes_pin.data.recorded.sniff import Proposal, propose
from fes_pin.data.recorded.text import TextForm
from fes_pin.data.schema import IMPOSED, NumberKey, check_known, one_of, unknown
from fes_pin.data.stimulus import varying
from fes_pin.data.study_text import HEADER, columns_text, form_in_words, source_from_option, source_in_words, toml_table
from fes_pin.data.units import factor_of, known_unit, own_unit, quantities_of
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
    """

    contents: Mapping[str, str | bytes]
    taken: tuple[tuple[str, str, str], ...]
    origins: Mapping[str, Path]


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
    return _Making(wanted).made(guess)


def with_kind(made: NewStudy, kind: str) -> NewStudy:
    """Return a new study with a kind for the trials that state none."""
    text = re.sub(r"(\[\[trial\]\]\nfile = .*\n)(?!kind)", rf'\1kind = "{kind}"\n', str(made.contents["study.toml"]))
    return replace(made, contents={**made.contents, "study.toml": text})


class _Making:
    """One study in the making; `missing` collects what nobody has said."""

    def __init__(self, wanted: Wanted) -> None:
        self.wanted, self.schema = wanted, wanted.schema
        self.missing: list[str] = []
        self.own = of_files(wanted.files, "--set", wanted.settings)
        self.proposals = [propose(path, self.schema, wanted.revolute) for path in wanted.files]
        self.form = self._one_form()
        self.channel: Channel | None = None
        self.cutoff: tuple[str, ...] = ()
        self.names = tuple(dict.fromkeys(n for p in self.proposals for n in p.recording.names))
        check_known(wanted.columns, self.schema.columns, fault_at("--column"))

    def made(self, guess: Guess) -> NewStudy:
        kinds = [self._kind(p) for p in self.proposals]
        sources = self._sources(set(kinds))
        self.channel, self.cutoff = self._channel(sources), EMG_KEYS[:1] if EMG in sources else ()
        rig, passive = self._numbers(self.schema.constants), self._numbers(self.schema.passive)
        trials = [self._trial(p, kind) for p, kind in zip(self.proposals, kinds, strict=True)]
        known, start = self._start(guess, {**rig, **passive}, sources)
        self._check_settings(sorted(set(kinds)))
        if self.missing:
            raise InputError("the files do not say everything; please add " + ", ".join(dict.fromkeys(self.missing)))
        contents: dict[str, str | bytes] = {}
        files = self._urdf(contents)
        places = [placed(path, self.wanted.folder, contents, "trials/") for path in self.wanted.files]
        looked_hz = self._events(sources)
        options = {"resample_hz": self.wanted.resample_hz or looked_hz, "rows": EVENTS if looked_hz else None}
        options["missing"] = INTERPOLATE if self.wanted.fill else None
        text = [
            *toml_table("study", {"name": self.wanted.name, "rig": self.schema.name}),
            *toml_table("rig", {**files, **rig, **known}, "known before the trials, never fitted", self._units()),
            *toml_table("rig.passive", passive, "known as well", self._units()),
            *toml_table("start", start, "start values of what the nominal model fits", self._units()),
            *columns_text(sources, self.names, self.form, options),
        ]
        named = [{} if self._is_open(*one) else {"kind": one[1]} for one in zip(self.proposals, kinds, strict=True)]
        for path, place, kind, conditions in zip(self.wanted.files, places, named, trials, strict=True):
            text += toml_table("[trial]", {"file": place, **kind, **labels_of(self.wanted, path), **conditions})
        contents["study.toml"] = "\n".join([*HEADER, *text]) + "\n"
        taken = tuple(
            (c, s.get("name", "from its rate"), source_in_words(s, c, self.wanted.revolute)) for c, s in sources.items()
        )
        origins = dict(zip(places, self.wanted.files, strict=True))
        if self.wanted.urdf is not None:
            origins[files["urdf"]] = self.wanted.urdf
        return NewStudy(contents, taken, origins)

    def _one_form(self) -> TextForm | None:
        forms = {p.form: p for p in self.proposals}
        if len(forms) > 1:
            one, other = list(forms.items())[:2]
            forms_found = " and ".join(f"{p.recording.path.name} has {form_in_words(form)}" for form, p in (one, other))
            raise InputError(f"expected files that are written alike, but {forms_found}; make a study of each kind")
        return self.proposals[0].form

    def _kind(self, proposal: Proposal) -> str:
        """The kind of trial that a file's columns make."""
        path, outputs = proposal.recording.path, self.schema.outputs
        if (given := self.own.get((path, "kind"), self.wanted.kind)) is not None:
            return one_of(given, tuple(outputs), partial(InputError, column="--set kind"))
        fits = [k for k, c in outputs.items() if c in self.wanted.columns or proposal.candidates[c]]
        default = self.schema.default_kind
        read = {k: sum(bool(proposal.candidates[c]) for c in self.schema.columns_of(k)) for k in fits}
        return max(fits, key=lambda k: (read[k], k == default), default=default)

    def _is_open(self, proposal: Proposal, kind: str) -> bool:
        """Return whether nobody said a kind, and the data show which of two it is."""
        stated = self.own.get((proposal.recording.path, "kind"), self.wanted.kind)
        read = [c for c in self.schema.columns_of(kind) if c in self.wanted.columns or proposal.candidates[c]]
        return stated is None and self.schema.is_driven_or_read(read)

    def _sources(self, kinds: set[str]) -> dict[str, dict[str, Any]]:
        """For each of the rig's columns what `[columns]` says of it."""
        schema, order = self.schema, sorted(kinds)
        needed = ["time_s", *(schema.outputs[k] for k in order), *(c for k in order for c in schema.motion(k)[:1])]
        stimuli = dict.fromkeys(c for k in order for c in schema.stimuli(k))
        inputs = self._inputs([c for c in stimuli if c in self.wanted.columns or self._candidates(c)])
        if not inputs and schema.inputs_required and kinds != {IMPOSED}:
            needed.append(next(iter(stimuli)))
        read = {c for k in order for c in schema.columns_of(k)}
        others = [c for c in (*schema.optional, *schema.imposed) if c in read]
        sources = {c: self._source(c, c in needed) for c in dict.fromkeys([*needed, *inputs, *others])}
        return {column: source for column, source in sources.items() if source is not None}

    def _inputs(self, found: list[str]) -> list[str]:
        """The stimuli that are taken: those that were said, else the first; width and amplitude of pulses together."""
        said = [c for c in found if self.wanted.columns.get(c)]
        pulses = [c for c in (WIDTH.column, AMPLITUDE.column) if c in found and c not in ("", *said)]
        first = said or (pulses if len(pulses) == 2 else found[:1])
        return [
            *first,
            *([RATE] if RATE in found and RATE not in first and len(np.unique(self._values(RATE))) > 1 else []),
        ]

    def _values(self, column: str) -> np.ndarray:
        """What the files hold of one of the rig's columns, as they have it; empty where that is not known."""
        said = self.wanted.columns.get(column)
        named = [n for n in self.names if said is not None and (said == n or said.split(":")[0].split(",")[0] == n)]
        names = named or list(self._candidates(column) if said is None else ())
        if len(names) != 1:
            return np.zeros(0)
        return np.concatenate(
            [p.recording.columns[names[0]] for p in self.proposals if names[0] in p.recording.columns]
        )

    def _channel(self, sources: Collection[str]) -> Channel | None:
        """What recruits, as far as it was said, or as the files show it; None where nothing is stimulated."""
        if (stated := channel_of(self.wanted.settings)) is not None:
            return stated
        taken = [c for n, c in CHANNELS.items() if n in sources]
        acting = [c for c in taken if self._values(c.column).any()]
        if len(acting) < 2:
            return acting[0] if acting and len(taken) == len(acting) else None
        return varying([(self._values(WIDTH.column), self._values(AMPLITUDE.column))])

    def _events(self, sources: Mapping[str, Mapping[str, Any]]) -> float | None:
        """The rate in Hz at which logs of events were written, to the three digits that rounding leaves; else None."""
        name = sources.get("time_s", {}).get("name")
        if name is None:
            return None
        factor, periods = factor_of(sources["time_s"].get("unit", "s"), "time_s"), []
        for one in self.proposals:
            columns = {n: v for n, v in one.recording.columns.items() if n != name}
            periods.append(looking_period(one.recording.columns[name], columns))
        known = [factor * p for p in periods if p is not None]
        return 1.0 / float(f"{min(known):.3g}") if known else None

    def _candidates(self, column: str) -> tuple[str, ...]:
        return tuple(dict.fromkeys(n for p in self.proposals for n in p.candidates[column]))

    def _source(self, column: str, is_needed: bool) -> dict[str, Any] | None:
        if (option := self.wanted.columns.get(column)) is not None:
            return self._stated(column, option)
        candidates = self._candidates(column)
        if len(candidates) != 1:
            if not is_needed and len(candidates) < 2:
                return None
            could = f"{' or '.join(candidates)}" if candidates else f"one of {', '.join(self.names)}"
            what = f"--column {column}=NAME:UNIT ({could}"
            return self._asked(column, f"{what}; or nothing: --column {column}=)" if not is_needed else f"{what})")
        return self._with_unit(column, candidates[0])

    def _with_unit(self, column: str, name: str) -> dict[str, Any] | None:
        """The column of that name, and the unit that it seems to be in."""
        unit = self._unit_of(name)
        quantities = quantities_of(column, self.wanted.revolute)
        if name == column or not quantities or quantities == ("pulses",):
            return {"name": name}
        if unit:
            if (found := known_unit(unit, quantities)) is not None:
                return {"name": name, "unit": found[1]}
            return self._asked(column, f"--column {column}={name},scale=NUMBER ({own_unit(column)} for each {unit})")
        units = own_unit(column, self.wanted.revolute)
        return self._asked(column, f"--column {column}={name}:UNIT ({self._range(name)}: {units}, or which unit?)")

    def _range(self, name: str) -> str:
        values = [p.recording.columns[name] for p in self.proposals if name in p.recording.columns]
        low, high = (f(np.concatenate(values)) for f in (np.nanmin, np.nanmax))
        return f"{low:.4g} to {high:.4g}"

    def _asked(self, column: str, what: str) -> dict[str, Any] | None:
        if self.wanted.ask is None:
            self.missing.append(what)
            return None
        answer = self.wanted.ask(what.removeprefix("--column ")).strip().removeprefix(f"{column}=")
        return self._stated(column, answer)

    def _stated(self, column: str, words: str) -> dict[str, Any] | None:
        """A column as the user states it, in the unit of the file where the user names none."""
        source = source_from_option(column, words, self.names) if words else None
        if source is None or source.keys() & {"unit", "rate_hz", "edge"}:
            return source
        stated = known_unit(self._unit_of(source["name"]), quantities_of(column, self.wanted.revolute))
        if stated is None or stated[1] == own_unit(column, self.wanted.revolute):
            return source
        if abs(source.get("scale", 1.0)) != 1.0:
            message = f"a scale, and the file says {stated[1]}: expected NAME:UNIT,scale=NUMBER, found {words!r}"
            raise InputError(message, column=f"--column {column}")
        return {"name": source["name"], "unit": stated[1], **source}

    def _unit_of(self, name: str) -> str:
        """The unit of a column as the files state it; "" where none does."""
        return next((u for p in self.proposals if (u := p.units.get(name))), "")

    def _number(self, key: str, number: NumberKey, path: Path | None = None) -> dict[str, float]:
        """A number that somebody gave, by its key in the study; empty, and it is missing, if nobody has."""
        text = (self.own.get((path, key)) if path else None) or self.wanted.settings.get(key)
        place = f"{path.name}:" if path and len(self.proposals) > 1 else ""
        if text is None and self.wanted.ask is not None:
            text = self.wanted.ask(f"{place}{key}{f' in {number.unit}' if number.unit else ''}").strip()
        if not text:
            self.missing.append(f"--set {place}{key}=NUMBER{f' ({number.unit})' if number.unit else ''}")
            return {}
        return {key.removeprefix("rig."): number_set(key, text, number)}

    def _numbers(self, table: Mapping[str, NumberKey]) -> dict[str, float]:
        """Numbers of a table: those that it must have, and those that were given."""
        ends = (*(self.channel.ends if self.channel else ()), *self.cutoff)
        out: dict[str, float] = {}
        for key, number in table.items():
            needed = number.required or key in ends
            if needed or key in self.wanted.settings:
                out |= self._number(key, number)
        return out

    def _trial(self, proposal: Proposal, kind: str) -> dict[str, float]:
        """Conditions of one trial."""
        path = proposal.recording.path
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
        known = [*schema.constants, *schema.passive, *schema.start, *schema.conditions]
        also = [f"rig.{key}" for key in schema.start] if schema.start_may_be_known else []
        for key in self.wanted.settings:
            file, _, last = key.rpartition(":")
            if last not in ([*schema.conditions, "kind"] if file else [*known, *also]):
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
