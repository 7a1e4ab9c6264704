"""Which columns of somebody's recordings are the rig's, and in what unit: as a person said, else as the files show."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fes_pin.data.channels import AMPLITUDE, CHANNELS, RATE, WIDTH, Channel, channel_of
from fes_pin.data.errors import InputError, fault_at, listed
from fes_pin.data.new_recording import Proposal
from fes_pin.data.new_view import APART, FilesOfTrial
from fes_pin.data.recorded.columns import INTERPOLATE
from fes_pin.data.recorded.events import EVENTS, looking_period
from fes_pin.data.recorded.form import TextForm
from fes_pin.data.recorded.header import unit_of_step
from fes_pin.data.recorded.text import after_comments
from fes_pin.data.recorded.view import INTEGRATED
from fes_pin.data.schema import IMPOSED, MEANT, check_known
from fes_pin.data.stimulus import varying
from fes_pin.data.study_text import columns_text, form_in_words, source_from_option
from fes_pin.data.units import (
    factor_of,
    known_unit,
    own_unit,
    quantities_of,
    split_header,
    stated_unit,
    turns_a_second,
    words_of,
)
from fes_pin.data.wanted import Wanted

LEVERS = {"force": "torque", "torque": "force"}
"""What a lever makes of a quantity."""
Source = Mapping[str, Any]
"""What `[columns]` says of a column: its name in the files, unit, scale ..., or the rate of times."""


@dataclass(frozen=True)
class Seen:
    """Files that are written alike.

    Parameters
    ----------
    proposals
        What each seems to hold.
    """

    proposals: Sequence[Proposal]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All columns, of words and of dates too."""
        return tuple(dict.fromkeys(n for p in self.proposals for n in p.recording.names))

    def could_be(self, column: str) -> tuple[str, ...]:
        """Names of columns that could be one of the rig's."""
        return tuple(dict.fromkeys(n for p in self.proposals for n in p.candidates.get(column, ())))

    def unit_of(self, name: str) -> str:
        """The unit of a column as the files state it; "" where none does."""
        return next((u for p in self.proposals if (u := p.units.get(name))), "")

    def with_units(self) -> list[str]:
        """All columns, each with the unit that the files state in brackets behind it."""
        units = {name: self.unit_of(name) for name in self.names}
        return [f"{name} ({unit})" if unit and not split_header(name)[1] else name for name, unit in units.items()]

    def values(self, name: str) -> np.ndarray:
        """The numbers of a column in all files, shape (n,); empty where it holds none."""
        found = [p.recording.columns[name] for p in self.proposals if name in p.recording.columns]
        return np.concatenate(found) if found else np.zeros(0)

    def range_of(self, name: str) -> str:
        """The least and the largest number of a column, in words."""
        there = self.values(name)
        there = there[np.isfinite(there)]
        return f"{there.min():.4g} to {there.max():.4g}" if len(there) else "no number"


class NewColumns:
    """The columns of a study in the making; `missing` collects what nobody has said.

    Parameters
    ----------
    trials
        The files of each trial.
    missing
        What nobody has said, as options, by `column NAME`.

    Attributes
    ----------
    assumed
        What no file and nobody says, and is taken so: sentences, in order.
    instead, last
        What may be said in the place of a column that is asked for, and the only column that was left for one, by name.
    """

    def __init__(self, wanted: Wanted, trials: Sequence[FilesOfTrial], missing: dict[str, str]) -> None:
        self.wanted, self.schema, self.trials, self.missing = wanted, wanted.schema, trials, missing
        self.seen = Seen([one.proposal for one in trials])
        self.assumed: dict[str, None] = {}
        self.instead: dict[str, str] = {}
        self.last: dict[str, str] = {}
        check_known(wanted.columns, self.schema.columns, fault_at("--column"))
        self.derived = {n: rate for n, rate in INTEGRATED.items() if self._is_integrated(n, rate)}

    def _is_integrated(self, column: str, rate: str) -> bool:
        """Return whether no file has a column, and one from which it can be integrated is there."""
        if not {column, rate} <= set(self.schema.columns) or self.is_there(column):
            return False
        return self.is_there(rate)

    def is_there(self, column: str) -> bool:
        """Return whether a person said a column, or the files could have it."""
        return bool(self.wanted.columns.get(column) or self._could_be(column))

    def taken(self, kinds: set[str]) -> dict[str, Source]:
        """For each of the rig's columns but the time what `[columns]` says of it."""
        schema, order = self.schema, sorted(kinds)
        motion = [c for k in order for c in (schema.outputs[k], *schema.motion(k)[:1])]
        needed = [self.derived.get(c, c) for c in motion]
        inputs = self._inputs(order)
        if not inputs and schema.inputs_required and kinds != {IMPOSED}:
            needed.append(self._asked_stimulus(order))
        read = {c for k in order for c in schema.columns_of(k)}
        others = [c for c in (*schema.optional, *schema.imposed) if c in read]
        sources = {c: self._source(c, c in needed) for c in dict.fromkeys([*needed, *inputs, *others])}
        return {column: source for column, source in sources.items() if source is not None}

    def _asked_stimulus(self, kinds: Sequence[str]) -> str:
        """The first stimulus, which is asked for; what may stand in its place is said."""
        first, *others = dict.fromkeys(c for k in kinds for c in self.schema.stimuli(k))
        passive = f"; or --set kind={IMPOSED} where nothing is stimulated" if IMPOSED in self.schema.outputs else ""
        self.instead[first] = f"; or in its place {listed(others, ' or ')}{passive}" if others else passive
        return first

    def times(self) -> dict[str, Source]:
        """For each source of the trials what its table says of `time_s`, with the file's own name of the column."""
        return {source: self._time_of(source) or {} for source in self.trials[0].files}

    def _time_of(self, source: str) -> Source | None:
        seen = Seen([one.files[source] for one in self.trials])
        option = self.wanted.columns.get("time_s")
        if option == "":
            raise InputError("expected NAME:UNIT, or rate=HZ of a file without times", column="--column time_s")
        if option is not None and (not source or option.startswith("rate=") or column_named(option, seen.names)):
            return self.stated("time_s", option, seen)
        rates = {p.rate_hz for p in seen.proposals}
        if not seen.could_be("time_s") and len(rates) == 1 and None not in rates:
            return {"rate_hz": next(iter(rates))}
        return self._proposed("time_s", seen.could_be("time_s"), seen, is_needed=True)

    def _inputs(self, kinds: Sequence[str]) -> list[str]:
        """The stimuli that are taken: those that were said, else the first; width and amplitude of pulses together."""
        stimuli = dict.fromkeys(c for k in kinds for c in self.schema.stimuli(k))
        found = [c for c in stimuli if c in self.wanted.columns or self._could_be(c)]
        said = [c for c in found if self.wanted.columns.get(c)]
        pulses = [c for c in (WIDTH.column, AMPLITUDE.column) if c in found]
        first = said or (pulses if len(pulses) == len((WIDTH, AMPLITUDE)) else sorted(found, key=self._is_off)[:1])
        varies = RATE in found and RATE not in first and len(np.unique(self._values(RATE))) > 1
        return [*first, RATE] if varies else first

    def _is_off(self, column: str) -> bool:
        """Return whether a column is 0 throughout, as of a stimulator that is off while an EMG is recorded."""
        values = self._values(column)
        return len(values) > 0 and not np.any(values)

    def _values(self, column: str) -> np.ndarray:
        """What the files hold of one of the rig's columns, as they have it; empty where that is not known."""
        said = self.wanted.columns.get(column)
        names = self._could_be(column) if said is None else column_named(said, self.seen.names)
        return self.seen.values(names[0]) if len(names) == 1 else np.zeros(0)

    def channel(self, sources: Collection[str]) -> Channel | None:
        """What recruits, as far as it was said, or as the files show it; None where nothing is stimulated."""
        if (stated := channel_of(self.wanted.settings)) is not None:
            return stated
        taken = [c for n, c in CHANNELS.items() if n in sources]
        acting = [c for c in taken if self._values(c.column).any()]
        if len(acting) > 1:
            return varying([(self._values(WIDTH.column), self._values(AMPLITUDE.column))])
        return acting[0] if acting and acting == taken else None

    def looked_hz(self, time: Source) -> float | None:
        """The rate in Hz at which logs of events were written, to the three digits that rounding leaves; else None."""
        name = time.get("name")
        recordings = [p.recording.columns for p in self.seen.proposals if name in p.recording.columns]
        periods = [looking_period(r[name], {n: v for n, v in r.items() if n != name}) for r in recordings if name]
        known = [factor_of(time.get("unit", "s"), "time_s") * p for p in periods if p is not None]
        return 1.0 / float(f"{min(known):.3g}") if known else None

    def _could_be(self, column: str) -> tuple[str, ...]:
        """Columns of the files that could be this one, without those that a person named for another."""
        others = [words for other, words in self.wanted.columns.items() if other != column]
        taken = {name for words in others for name in column_named(words, self.seen.names)}
        return tuple(n for n in self.seen.could_be(column) if n not in taken)

    def _source(self, column: str, is_needed: bool) -> Source | None:
        if (option := self.wanted.columns.get(column)) is not None:
            return self.stated(column, option)
        candidates = self._could_be(column)
        if not is_needed and not candidates:
            return None
        return self._proposed(column, candidates, self.seen, is_needed)

    def _proposed(self, column: str, candidates: Sequence[str], seen: Seen, is_needed: bool) -> Source | None:
        """The only column that could be it, in the unit that it seems to be in; else it is asked for."""
        nothing = self.instead.get(column, "") if is_needed else f"; or nothing: --column {column}="
        if len(candidates) == 1:
            return self._with_unit(column, candidates[0], seen, nothing)
        free = self._free(column, seen)
        levers = [] if candidates else self._by_lever(column, seen)
        named = [n for n in levers if MEANT.get(column, frozenset()) & words_of(split_header(n)[0])]
        last = next(iter(free)) if not candidates and len(free) == 1 and not named else ""
        if last and not seen.unit_of(last) and seen.values(last).size:
            self.last[column] = last
            return self._with_unit(column, last, seen, nothing)
        if levers:
            own, those = own_unit(column, self.wanted.revolute), listed(named or levers, " or ")
            self._ask(column, f"NAME,scale=NUMBER ({those}; {own} for each unit of it{nothing})")
            return None
        self._ask(column, f"NAME:UNIT ({self._could(column, candidates, free)}{nothing})")
        return None

    def _could(self, column: str, candidates: Sequence[str], free: Mapping[str, str]) -> str:
        """What could be a column, in words: candidates, else what no other column takes, or another way to have it."""
        left = f"one of {listed(list(free.values()))}" if free else "no column is left"
        could = listed(candidates, " or ") if candidates else left
        if column == "time_s":
            could += "; or rate=HZ of a file without times"
        if not candidates and (rate := INTEGRATED.get(column)) in self.schema.columns:
            could += f"; without one --column {rate}=NAME:UNIT is integrated"
        return could

    def _free(self, column: str, seen: Seen) -> dict[str, str]:
        """All columns, in words with their units, but for those that another of the rig's takes."""
        others = [c for c in (*self.schema.columns, "time_s") if c != column]
        said = {n for c in others for n in column_named(self.wanted.columns.get(c, ""), seen.names)}
        alone = {names[0] for c in others if len(names := seen.could_be(c)) == 1} | {*self.last.values()}
        every = dict(zip(seen.names, seen.with_units(), strict=True))
        return {name: words for name, words in every.items() if name not in said | alone}

    def _by_lever(self, column: str, seen: Seen) -> list[str]:
        """Columns of torques for a force, which is one over its lever, and of forces for a torque."""
        other = LEVERS.get("".join(quantities_of(column, self.wanted.revolute)))
        return [n for n in seen.names if other and stated_unit(n, seen.unit_of(n))[0] == other]

    def _with_unit(self, column: str, name: str, seen: Seen, nothing: str) -> Source | None:
        unit = stated_unit(name, seen.unit_of(name))[1] or seen.unit_of(name)
        quantities = quantities_of(column, self.wanted.revolute)
        bare = name.partition(APART)[2] if seen is self.seen and self.trials[0].is_joined else name
        is_own = bare == column and unit in ("", stated_unit(bare)[1])
        if is_own or not quantities or quantities == ("pulses",):
            return {"name": name}
        own = own_unit(column, self.wanted.revolute)
        unit = unit or (self._unit_by_rate(name, seen) if column == "time_s" else "")
        if not unit:
            self._ask(column, f"{name}:UNIT ({seen.range_of(name)}: {own}, or which unit?)")
            return None
        if (found := known_unit(unit, quantities)) is not None:
            return {"name": name, "unit": found[1]}
        if turns_a_second(column, name, unit, self.wanted.revolute):
            return self._in_turns({"name": name})
        self._ask(column, f"{name},scale=NUMBER ({own} for each {unit}{nothing})")
        return None

    def _unit_by_rate(self, name: str, seen: Seen) -> str:
        """The unit of times without one whose steps are those of the rates that the files state, which is said."""
        rated = [(p.recording.columns[name], p.rate_hz or 0.0) for p in seen.proposals if name in p.recording.columns]
        units = {unit_of_step(float(np.median(np.diff(time))), rate_hz) for time, rate_hz in rated}
        unit = units.pop() if len(units) == 1 else ""
        if unit:
            rates = listed([f"{rate_hz:g}" for rate_hz in dict.fromkeys(rate_hz for _, rate_hz in rated)], " and ")
            self.assumed[f"{name} is in {unit}: its steps are those of {rates} Hz, which the file states"] = None
        return unit

    def _ask(self, column: str, what: str) -> None:
        self.missing[f"column {column}"] = f"--column {column}={what}"

    def stated(self, column: str, words: str, seen: Seen | None = None) -> Source | None:
        """A column as a person states it, in the unit of the file where the person names none; None for nothing.

        Raises
        ------
        InputError
            The words name no column of the files, a unit of another quantity, or none where the file has another one.
        """
        seen = seen or self.seen
        if not words:
            return None
        try:
            source = source_from_option(column, words, seen.names)
        except InputError as error:
            odd = "".join(f"; {sentence}" for sentence in self.said({}))
            raise InputError(f"{error.message}{odd}", column=error.column) from None
        self._check_unit(column, source)
        if source.keys() & {"unit", "rate_hz", "edge"}:
            return source
        return self._in_its_unit(column, source, words, seen)

    def _in_turns(self, source: Source) -> Source:
        """A speed in Hz as one in turns a second, which is said."""
        self.assumed[f"{source['name']} is in Hz: it is taken as turns a second, rev/s"] = None
        return {**source, "unit": "rev/s"}

    def _check_unit(self, column: str, source: Source) -> None:
        own = own_unit(column, self.wanted.revolute)
        hint = f"; of another quantity NAME,scale=NUMBER ({own} for each)" if own else ""
        if turns_a_second(column, "speed", source.get("unit", ""), self.wanted.revolute):
            hint = f"; turns a second are rev/s{hint}"
        if "unit" in source:
            place = f"--column {column}"
            factor_of(source["unit"], column, self.wanted.revolute, lambda why: InputError(why + hint, column=place))

    def _in_its_unit(self, column: str, source: Source, words: str, seen: Seen) -> Source:
        """A column whose unit nobody said, in that of the file."""
        own, quantities = own_unit(column, self.wanted.revolute), quantities_of(column, self.wanted.revolute)
        quantity, unit = stated_unit(source["name"], seen.unit_of(source["name"]))
        found = known_unit(unit, quantities)
        if "scale" not in source and turns_a_second(column, source["name"], unit, self.wanted.revolute):
            return self._in_turns(source)
        if found is None:
            if "scale" in source or not (quantity or unit) or column == "stim" or not quantities:
                return source
            what = f"a {quantity} in {unit}" if quantity else unit
            message = f"the file says {what}: expected NAME:UNIT, or NAME,scale=NUMBER ({own} for each)"
        elif found[1] == own:
            return source
        elif abs(source.get("scale", 1.0)) == 1.0:
            return {"name": source["name"], "unit": found[1], **source}
        else:
            message = f"a scale, and the file says {found[1]}: expected NAME:UNIT,scale=NUMBER"
        raise InputError(f"{message}, found {words!r}", column=f"--column {column}")

    def said(self, times: Mapping[str, Source]) -> tuple[str, ...]:
        """What is odd about all files, and how they are taken; a sentence of several files once."""
        by_sentence: dict[str, dict[str, None]] = {}
        for source, proposal in (one for trial in self.trials for one in trial.files.items()):
            sentences = [*proposal.said]
            if "rate_hz" in times.get(source, {}) and "time_s" not in self.wanted.columns:
                sentences.append(f"no column of times: {proposal.rate_hz:g} Hz is what the header says")
            for sentence in sentences:
                by_sentence.setdefault(sentence, {})[proposal.recording.path.name] = None
        return (*(f"{listed([*names])}: {sentence}" for sentence, names in by_sentence.items()), *self.assumed)

    def odd(self) -> tuple[str, ...]:
        """As `said`, and what readers left out: of files that do not say everything it may be what is missing."""
        return (*self.said({}), *dict.fromkeys(words for p in self.seen.proposals for words in p.recording.said))

    def text(self, columns: Mapping[str, Source], times: Mapping[str, Source], looked_hz: float | None) -> list[str]:
        """Lines of [columns], or of a table [sources.NAME] for each source."""
        options = {"resample_hz": self.wanted.resample_hz or looked_hz, "rows": EVENTS if looked_hz else None}
        options |= {"missing": INTERPOLATE if self.wanted.fill else None}
        is_plain, lines = not any(p.recording.said for p in self.seen.proposals), list[str]()
        for source, time in times.items():
            before, where = (f"{source}{APART}", f"sources.{source}") if source else ("", "columns")
            its = {c: s for c, s in columns.items() if str(s.get("name", "")).startswith(before)}
            own = {"time_s": time, **{c: {**s, "name": s["name"].removeprefix(before)} for c, s in its.items()}}
            names = [n.removeprefix(before) for n in self.seen.names if n.startswith(before)]
            form = self._one_form(source)
            for table, (called, every) in self._side_by_side(source).items():
                its = {c: {**s, "name": called[s["name"]]} if s.get("name") in called else s for c, s in own.items()}
                lines += columns_text(its, [*every], form, options, f"sources.{table}")
            if any(one.files[source].renamed is None for one in self.trials):
                lines += columns_text(own, names, form, options, where, is_plain)
        return lines

    def _side_by_side(self, source: str) -> dict[str, tuple[Mapping[str, str], dict[str, None]]]:
        """By the table of each trial that stands next to others the names of its columns, and all of its files."""
        out: dict[str, tuple[Mapping[str, str], dict[str, None]]] = {}
        for renamed in (p.renamed for one in self.trials if (p := one.files[source]).renamed is not None):
            _, every = out.get(renamed.name, ({}, {}))
            out[renamed.name] = renamed.called, every | dict.fromkeys(renamed.names)
        return out

    def _one_form(self, source: str) -> TextForm | None:
        forms = {p.form: p for p in (one.files[source] for one in self.trials)}
        if len(forms) > 1:
            forms = {after_comments(p.recording.path, form): p for form, p in forms.items()}
        if len(forms) > 1:
            found = [f"{p.recording.path.name} has {form_in_words(form)}" for form, p in [*forms.items()][:2]]
            message = f"expected files that are written alike, but {' and '.join(found)}; make a study of each kind"
            raise InputError(message)
        return next(iter(forms))


def column_named(words: str, names: Sequence[str]) -> tuple[str, ...]:
    """The column that an option names, `NAME[:UNIT][,key=number ...]`: at most one."""
    found = [n for n in names if words == n or words.startswith((f"{n}:", f"{n},"))]
    return (max(found, key=len),) if found else ()
