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
from fes_pin.data.errors import InputError, fault_at, listed
from fes_pin.data.files import inside, read_bytes
from fes_pin.data.new_view import APART, FilesOfTrial, free_part, grouped_files, rate_of, view_keys
from fes_pin.data.recorded.columns import INTERPOLATE
from fes_pin.data.recorded.events import EVENTS, looking_period
from fes_pin.data.recorded.sniff import Proposal, propose
from fes_pin.data.recorded.text import TextForm, after_comments
from fes_pin.data.recorded.view import INTEGRATED
from fes_pin.data.schema import IMPOSED, NumberKey, any_number, check_known, one_of, unknown
from fes_pin.data.stimulus import varying
from fes_pin.data.study_text import HEADER, columns_text, form_in_words, source_from_option, source_in_words, toml_table
from fes_pin.data.units import factor_of, known_unit, own_unit, quantities_of, stated_unit
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
        r"(\[\[trial\]\]\n(?:file|sources) = .*\n)(?!kind)", rf'\1kind = "{kind}"\n', str(made.contents["study.toml"])
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
        each = [propose(p, self.schema, wanted.revolute, wanted.form, chosen) for p in wanted.files]
        self.trials = grouped_files(each, self.schema, wanted.sources)
        self.proposals = [one.proposal for one in self.trials]
        self.channel: Channel | None = None
        self.cutoff: tuple[str, ...] = ()
        self.looked_hz: float | None = None
        self.names = tuple(dict.fromkeys(n for p in self.proposals for n in p.recording.names))
        check_known(wanted.columns, self.schema.columns, fault_at("--column"))
        self.derived = {n: source for n, source in INTEGRATED.items() if self._is_integrated(n, source)}
        self.of_views: list[str] = []

    def made(self, guess: Guess) -> NewStudy | None:
        """The study; None where something is missing and a person can be asked."""
        kinds = [self._kind(p) for p in self.proposals]
        columns = self._sources(set(kinds))
        times = self._times(columns)
        self.looked_hz = self._events(columns)
        self.channel, self.cutoff = self._channel(columns), EMG_KEYS[:1] if EMG in columns else ()
        rig, passive = self._numbers(self.schema.constants), self._numbers(self.schema.passive)
        trials = [self._trial(p, kind) for p, kind in zip(self.proposals, kinds, strict=True)]
        known, start = self._start(guess, {**rig, **passive}, [*columns, *self.derived])
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
            *self._columns_text(columns, times),
        ]
        named = [{} if self._is_open(*one) else {"kind": one[1]} for one in zip(self.proposals, kinds, strict=True)]
        for one, kind, conditions in zip(self.trials, named, trials, strict=True):
            text += toml_table("[trial]", self._trial_keys(one, places, kind, columns, times) | conditions)
        contents["study.toml"] = "\n".join([*HEADER, *text]) + "\n"
        taken = tuple(
            (c, s.get("name", "from its rate"), source_in_words(s, c, self.wanted.revolute)) for c, s in columns.items()
        )
        origins = {place: path for path, place in places.items()}
        if self.wanted.urdf is not None:
            origins[files["urdf"]] = self.wanted.urdf
        return NewStudy(contents, taken, origins, (*self.said(times), *self.of_views))

    def said(self, times: Mapping[str, Mapping[str, Any]]) -> tuple[str, ...]:
        """What is odd about all files, and how they are taken; a sentence of several files once."""
        by_sentence: dict[str, list[str]] = {}
        for source, proposal in (one for trial in self.trials for one in trial.files.items()):
            sentences = [*proposal.said]
            if "rate_hz" in times.get(source, {}) and "time_s" not in self.wanted.columns:
                sentences.append(f"no column of times: {proposal.rate_hz:g} Hz is what the header says")
            for sentence in sentences:
                by_sentence.setdefault(sentence, []).append(proposal.recording.path.name)
        return tuple(f"{listed(names)}: {sentence}" for sentence, names in by_sentence.items())

    def _incomplete(self) -> InputError:
        odd = "".join(f"{sentence}; " for sentence in self.said({}))
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
            wanted.say("\n".join([*self.said({}), "what the files do not say:", *self.missing.values()]))
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
                    self._stated(name, answer.removeprefix(f"{name}="))
                else:
                    self._understood(name, answer.rpartition("=")[2].strip())
                return answer
            except InputError as error:
                why = f"{error.message}; "

    def _understood(self, key: str, text: str) -> None:
        last = key.rpartition(":")[2].removeprefix("rig.")
        tables = (self.schema.constants, self.schema.passive, self.schema.start, self.schema.conditions)
        number_set(last, text, next(table[last] for table in tables if last in table))

    def _trial_keys(
        self,
        one: FilesOfTrial,
        places: Mapping[Path, str],
        kind: Mapping[str, str],
        columns: Mapping[str, Mapping[str, Any]],
        times: Mapping[str, Mapping[str, Any]],
    ) -> dict[str, Any]:
        """Keys of a `[[trial]]` but its conditions: its files, kind and labels, and which part of its files it is."""
        files = {source: places[p.recording.path] for source, p in one.files.items()}
        stated: dict[str, Any] = {"split": self.wanted.split} if self.wanted.split is not None else {}
        stated |= {k: n for k in ("from", "to") if (n := self._end(k, one.path)) is not None}
        stated |= {"offset_s": self.wanted.offsets} if self.wanted.offsets else {}
        seconds = {source: self._seconds(p, times[source]) for source, p in one.files.items()}
        stated |= {"split": "none"} if self.looked_hz and "split" not in stated else {}  # rows come with events
        view, said = view_keys(one, seconds, self.wanted.resample_hz, stated)
        position = columns.get("position", {}).get("name")
        if not view and not self.schema.inputs_required and not set(columns) & set(self.schema.inputs) and position:
            view, more = free_part(
                one.path.name, next(iter(seconds.values())), one.proposal.recording.columns[position]
            )
            said += more
        self.of_views += said
        view |= {"derive": self.derived} if self.derived else {}
        view |= self._rate(one, seconds, times, view)
        whole = {"sources": files} if one.is_joined else {"file": files[""]}
        paths = [p.recording.path for p in one.files.values()]
        return {**whole, **kind, **view, **labels_of(self.wanted, *paths)}

    def _rate(
        self,
        one: FilesOfTrial,
        seconds: Mapping[str, np.ndarray],
        times: Mapping[str, Mapping[str, Any]],
        view: Mapping[str, Any],
    ) -> dict[str, float]:
        """The rate of a trial whose times are not equally spaced, where nobody said one."""
        source, time = next(iter(seconds.items()))
        time = time[(time >= view.get("from", -np.inf)) & (time <= view.get("to", np.inf))]
        if self.wanted.resample_hz or self.looked_hz or "rate_hz" in times[source] or not len(time):
            return {}
        recording, about = one.files[source].recording, times[source]
        factor = factor_of(about["unit"], "time_s") if "unit" in about else 1.0
        half_digit = factor * abs(float(about.get("scale", 1.0))) * recording.half_digit_of(about["name"])
        rate_hz = rate_of(time, str(view.get("split", "")), half_digit)
        return {} if rate_hz is None else {"rate": rate_hz}

    def _end(self, key: str, path: Path) -> float | None:
        """When a trial begins or ends in its recording, s, as `--set` says of its file or of all."""
        text = self.own.get((path, key)) or self.wanted.settings.get(key)
        return None if text is None else number_set(key, text, any_number("s", False))

    def _seconds(self, proposal: Proposal, source: Mapping[str, Any]) -> np.ndarray:
        """Times of one file, s, shape (n,); none of a column that is no numbers, which its reader refuses."""
        if "rate_hz" in source:
            return np.arange(len(proposal.recording)) / float(source["rate_hz"])
        if source["name"] not in proposal.recording.columns:
            return np.zeros(0)
        factor = factor_of(source["unit"], "time_s") if "unit" in source else 1.0
        return factor * float(source.get("scale", 1.0)) * proposal.recording.columns[source["name"]]

    def _is_integrated(self, column: str, source: str) -> bool:
        """Return whether no file has a column and one from which it can be integrated is there."""
        if (
            not {column, source} <= set(self.schema.columns)
            or self.wanted.columns.get(column)
            or self._candidates(column)
        ):
            return False
        return bool(self.wanted.columns.get(source) or self._candidates(source))

    def _times(self, columns: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        """For each source of the trials what its table says of `time_s`, with the file's own name of the column."""
        if not self.trials[0].is_joined:
            return {"": columns["time_s"]} if "time_s" in columns else {}
        return {source: self._time_of(source) for source in self.trials[0].files}

    def _time_of(self, source: str) -> dict[str, Any]:
        proposals = [one.files[source] for one in self.trials]
        names = tuple(dict.fromkeys(n for p in proposals for n in p.recording.names))
        option = self.wanted.columns.get("time_s", "")
        if option.startswith("rate=") or option.rpartition(":")[0] in names or option in names:
            return source_from_option("time_s", option, names)
        candidates = tuple(dict.fromkeys(n for p in proposals for n in p.candidates["time_s"]))
        rates = {p.rate_hz for p in proposals}
        if not candidates and len(rates) == 1 and None not in rates:
            return {"rate_hz": next(iter(rates))}
        if len(candidates) != 1:
            could = " or ".join(candidates or names)
            return self._asked("time_s", f"--column time_s=NAME:UNIT (of {source}: {could})") or {}
        found = self._with_unit("time_s", f"{source}{APART}{candidates[0]}", is_needed=True) or {}
        return found | {"name": candidates[0]}

    def _columns_text(
        self, columns: Mapping[str, Mapping[str, Any]], times: Mapping[str, Mapping[str, Any]]
    ) -> list[str]:
        """Lines of [columns], or of a table [sources.NAME] for each source."""
        rate_hz, events = self.wanted.resample_hz or self.looked_hz, EVENTS if self.looked_hz else None
        options = {"resample_hz": rate_hz, "rows": events, "missing": INTERPOLATE if self.wanted.fill else None}
        if not self.trials[0].is_joined:
            is_plain = not any(p.recording.said for p in self.proposals)
            return columns_text(columns, self.names, self._one_form(""), options, is_plain=is_plain)
        text = []
        for source, time in times.items():
            before = f"{source}{APART}"
            own = {"time_s": time}
            for column, one in columns.items():
                if str(one.get("name", "")).startswith(before):
                    own[column] = {**one, "name": one["name"].removeprefix(before)}
            names = [n.removeprefix(before) for n in self.names if n.startswith(before)]
            text += columns_text(own, names, self._one_form(source), options, f"sources.{source}")
        return text

    def _one_form(self, source: str) -> TextForm | None:
        forms = {p.form: p for p in (one.files[source] for one in self.trials)}
        if len(forms) > 1:
            forms = {after_comments(p.recording.path, form): p for form, p in forms.items()}
        if len(forms) > 1:
            one, other = list(forms.items())[:2]
            forms_found = " and ".join(f"{p.recording.path.name} has {form_in_words(form)}" for form, p in (one, other))
            raise InputError(f"expected files that are written alike, but {forms_found}; make a study of each kind")
        return next(iter(forms))

    def _kind(self, proposal: Proposal) -> str:
        """The kind of trial that a file's columns make."""
        path, outputs = proposal.recording.path, self.schema.outputs
        if (given := self.own.get((path, "kind"), self.wanted.kind)) is not None:
            return one_of(given, tuple(outputs), partial(InputError, column="--set kind"))
        fits = [
            k for k, c in outputs.items() if c in self.wanted.columns or c in self.derived or proposal.candidates[c]
        ]
        default = self.schema.default_kind
        read = {k: sum(bool(proposal.candidates[c]) for c in self.schema.columns_of(k)) for k in fits}
        return max(fits, key=lambda k: (read[k], k == default), default=default)

    def _is_open(self, proposal: Proposal, kind: str) -> bool:
        """Return whether nobody said a kind, and the data show which of two it is."""
        stated = self.own.get((proposal.recording.path, "kind"), self.wanted.kind)
        has = {*self.wanted.columns, *self.derived, *(c for c, names in proposal.candidates.items() if names)}
        read = [c for c in self.schema.columns_of(kind) if c in has]
        return stated is None and self.schema.is_driven_or_read(read)

    def _sources(self, kinds: set[str]) -> dict[str, dict[str, Any]]:
        """For each of the rig's columns what `[columns]` says of it."""
        schema, order = self.schema, sorted(kinds)
        needed = [*(schema.outputs[k] for k in order), *(c for k in order for c in schema.motion(k)[:1])]
        needed = [*["time_s"] * (not self.trials[0].is_joined), *(self.derived.get(c, c) for c in needed)]
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
            if name in one.recording.columns:  # else it is no numbers, which its reader refuses
                periods.append(looking_period(one.recording.columns[name], columns))
        known = [factor * p for p in periods if p is not None]
        return 1.0 / float(f"{min(known):.3g}") if known else None

    def _candidates(self, column: str) -> tuple[str, ...]:
        """Columns of the files that could be this one, without those that a person named for another."""
        named = [words for other, words in self.wanted.columns.items() if other != column]
        found = dict.fromkeys(n for p in self.proposals for n in p.candidates[column])
        return tuple(n for n in found if not any(w == n or w.startswith((f"{n}:", f"{n},")) for w in named))

    def _source(self, column: str, is_needed: bool) -> dict[str, Any] | None:
        if (option := self.wanted.columns.get(column)) is not None:
            return self._stated(column, option)
        candidates = self._candidates(column)
        rates = {p.rate_hz for p in self.proposals}
        if column == "time_s" and not candidates and len(rates) == 1 and None not in rates:
            return {"rate_hz": next(iter(rates))}
        if len(candidates) != 1:
            if not is_needed and len(candidates) < 2:
                return None
            could = listed(candidates, " or ") if candidates else f"one of {listed(self._with_units())}"
            if not candidates and (rate := INTEGRATED.get(column)) in self.schema.columns:
                could += f"; without one --column {rate}=NAME:UNIT is integrated"
            what = f"--column {column}=NAME:UNIT ({could}"
            return self._asked(column, f"{what}; or nothing: --column {column}=)" if not is_needed else f"{what})")
        return self._with_unit(column, candidates[0], is_needed)

    def _with_units(self) -> list[str]:
        """All columns of the files, each with the unit that they state in brackets behind it."""
        units = {name: self._unit_of(name) for name in self.names}
        return [f"{name} ({unit})" if unit and unit not in name else name for name, unit in units.items()]

    def _with_unit(self, column: str, name: str, is_needed: bool) -> dict[str, Any] | None:
        """The column of that name, and the unit that it seems to be in."""
        _, unit = stated_unit(name, self._unit_of(name))
        unit = unit or self._unit_of(name)
        quantities = quantities_of(column, self.wanted.revolute)
        bare = name.partition(APART)[2] if self.trials[0].is_joined else name
        is_own = bare == column and unit in ("", stated_unit(bare)[1])
        if is_own or not quantities or quantities == ("pulses",):
            return {"name": name}
        if unit:
            if (found := known_unit(unit, quantities)) is not None:
                return {"name": name, "unit": found[1]}
            own = own_unit(column, self.wanted.revolute)
            nothing = "" if is_needed else f"; or nothing: --column {column}="
            return self._asked(column, f"--column {column}={name},scale=NUMBER ({own} for each {unit}{nothing})")
        units = own_unit(column, self.wanted.revolute)
        return self._asked(column, f"--column {column}={name}:UNIT ({self._range(name)}: {units}, or which unit?)")

    def _range(self, name: str) -> str:
        values = [p.recording.columns[name] for p in self.proposals if name in p.recording.columns]
        there = np.concatenate(values)
        there = there[np.isfinite(there)]
        return f"{there.min():.4g} to {there.max():.4g}" if len(there) else "no number"

    def _asked(self, column: str, what: str) -> dict[str, Any] | None:
        self.missing[f"column {column}"] = what
        return None

    def _stated(self, column: str, words: str) -> dict[str, Any] | None:
        """A column as the user states it, in the unit of the file where the user names none."""
        try:
            source = source_from_option(column, words, self.names) if words else None
        except InputError as error:
            odd = "".join(f"; {sentence}" for sentence in self.said({}))
            raise InputError(f"{error.message}{odd}", column=error.column) from None
        if source is not None and "unit" in source:
            own, place = own_unit(column, self.wanted.revolute), f"--column {column}"
            hint = f"; of another quantity NAME,scale=NUMBER ({own} for each)" if own else ""
            factor_of(
                source["unit"], column, self.wanted.revolute, lambda why: InputError(f"{why}{hint}", column=place)
            )
        if source is None or source.keys() & {"unit", "rate_hz", "edge"}:
            return source
        quantities = quantities_of(column, self.wanted.revolute)
        quantity, unit = stated_unit(source["name"], self._unit_of(source["name"]))
        stated = known_unit(unit, quantities)
        if stated is not None and stated[1] == own_unit(column, self.wanted.revolute):
            return source
        if stated is None:
            if "scale" in source or not (quantity or unit) or column == "stim" or not quantities:
                return source
            what = f"a {quantity} in {unit}" if quantity else unit
            message = f"the file says {what}: expected NAME:UNIT, or NAME,scale=NUMBER ({own_unit(column)} for each)"
            raise InputError(f"{message}, found {words!r}", column=f"--column {column}")
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
        if not text:
            what = f"--set {place}{key}=NUMBER{f' ({number.unit})' if number.unit else ''}"
            self.missing[f"set {path}:{key}" if place else f"set {key}"] = what
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
