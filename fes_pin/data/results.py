"""Base of results: read-only, comparable, copied, shown as a table, saved as JSON and loaded again."""

import html
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Self

from fes_pin.data.errors import InputError
from fes_pin.data.files import read_json
from fes_pin.data.outputs import written_by
from fes_pin.data.provenance import Provenance
from fes_pin.data.read_only import ReadOnly, as_dicts
from fes_pin.data.show import DataFrame, by_columns, frame, table_html, table_text
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.data.trial_files import trial_csv
from fes_pin.infer.keys import Key
from fes_pin.infer.result import ON, STOPPED, Cause, Explained, Named, Remainder, shown
from fes_pin.infer.text import listed, percent
from fes_pin.infer.why import Why

RESULT, TEXT, TABLE = "result", "text", "table"
"""Keys that every saved result has in addition to those of its kind: its kind, its text by lines, its table by
columns."""
INDEX = {"Fit": "parameter"}
"""Column that is the index of the frame, by kind; other results are numbered by row."""
NEXT_FILE = "next_trial.csv"
"""File of the trial that is proposed."""
UNCOMPARED = ("wall_s", "provenance")
"""Keys of a record that say how a result was made, not what it is."""


class Recorded(ReadOnly):
    """Base of objects with a record. Two are equal if their records are, to the printed digits, whatever their
    computing time and provenance."""

    def _kind(self) -> str:
        return type(self).__name__

    def record(self) -> dict[str, Any]:
        """Return its content as plain values for JSON."""
        raise NotImplementedError

    def _said(self) -> str:
        known = {n: v for n, v in self.record().items() if n not in UNCOMPARED}
        return json.dumps([self._kind(), known], sort_keys=True)

    def __eq__(self, other: object) -> bool:
        return self is other or (self._said() == other._said() if isinstance(other, Recorded) else NotImplemented)

    def __hash__(self) -> int:
        return hash(self._said())


class Saveable(Recorded):
    """Base of results with a record and a table. A loaded result equals the one that was saved."""

    def columns(self) -> dict[str, list[Any]]:
        """The table of `to_frame`, by columns."""
        raise NotImplementedError

    def as_table(self) -> tuple[str, Sequence[str], Sequence[Sequence[str]], Sequence[str]]:
        """Title, head, rows and notes of the table that is printed."""
        raise NotImplementedError

    def to_frame(self) -> DataFrame:
        """The result as a frame of pandas: a row a parameter of each cause or change, a model, or a study.

        The parameters of a fit are its index.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        return frame(self.columns(), INDEX.get(self._kind()))

    def to_json(self) -> str:
        """The text of the JSON file that `save_result` writes."""
        table = {n: [_cell(v) for v in values] for n, values in self.columns().items()}
        saved = {**self.record(), RESULT: self._kind(), TEXT: str(self).split("\n"), TABLE: table}
        return json.dumps(saved, indent=1, allow_nan=False) + "\n"

    def __str__(self) -> str:
        return table_text(*self.as_table())

    def _repr_html_(self) -> str:
        return table_html(*self.as_table())


@dataclass(frozen=True)
class Plan:
    """An experiment that would distinguish two causes, or the reason why none does: base of those of rigs and walks.

    Attributes
    ----------
    why
        The reason, in words.
    separates
        The two causes; of several rivals the one that the experiment separates least.
    trial
        The trial to run: its inputs and conditions, without outputs; None where no trial separates the two.
    """

    why: str
    separates: tuple[str, str]
    trial: Trial | None = None

    def record(self, files: Sequence[str] = ("file",)) -> dict[str, Any]:
        """Return the experiment as JSON files have it; `files` are the keys of a `[[trial]]` that name `NEXT_FILE`."""
        trial = None
        if (one := self.trial) is not None:
            conditions = {n: shown(v) for n, v in one.conditions.items()}
            trial = {**dict.fromkeys(files, NEXT_FILE), "kind": one.kind, **conditions}
        return {"why": self.why, "separates": list(self.separates), "trial": trial}


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Result(Saveable):
    """The result of an inference: base of diagnoses and contrasts.

    Attributes
    ----------
    verdict
        The verdict in one word; "stopped" where a limit of time ended the search, or fits did not converge. Then the
        causes are the best set so far, and nothing is claimed about other causes.
    causes
        Named causes, largest gain first, or changes, most significant first.
    remainder
        Lack of fit.
    warnings
        Warnings about the study, and about steps that could not be made, one line each.
    reason
        Why the model has a lack of fit, where no test of residuals finds it: nothing could be fitted, or an error
        remains that is no noise.
    next_experiment
        The experiment that would distinguish the first cause from its equivalents.
    provenance
        Time, versions and files of its making.
    why
        How the answer was reached, and why no other cause is named; None where nothing was searched.
    """

    study: Study
    verdict: str
    causes: tuple[Named, ...]
    remainder: Remainder
    warnings: tuple[str, ...] = ()
    wall_s: float = 0.0
    reason: str | None = None
    next_experiment: Plan | None = None
    provenance: Provenance | None = None
    why: Why | None = None
    KIND: ClassVar[type[Named]] = Cause
    """Type of the causes."""
    FILE: ClassVar[str] = "diagnosis.json"
    MODEL: ClassVar[str] = "the model"
    """The diagnosed model, in words."""

    @property
    def is_stopped(self) -> bool:
        """Whether the search ended before it was done."""
        return self.verdict == STOPPED

    @property
    def judged_on(self) -> str:
        """The predictions whose errors count, in words."""
        return ""

    def errors(self) -> list[Explained]:
        """Return errors of every kind of prediction, on fitted data and, last, on held-out data."""
        return []

    @property
    def explained(self) -> Explained | None:
        """The gain of all causes together, with its reference and measure; None without errors."""
        return next((one for one in reversed(self.errors()) if one.what == self.judged_on), None)

    def not_fitted(self) -> list[tuple[str, str]]:
        """Return what is said of candidates without a fit of them, in words."""
        return []

    def title(self) -> str:
        """Return the verdict in a few words."""
        begun = "stopped: best set so far: " if self.is_stopped else ""
        lacks = list(dict.fromkeys(one.name.replace("_", " ") for one in self.causes if not one.words))
        said = [one.words for one in self.causes if one.words]
        said += [f"{self.MODEL} lacks {listed(lacks)}"] if lacks else []
        nothing = {
            STOPPED: "no cause, and no claim about causes that were not tried",
            "adequate": f"{self.MODEL} is adequate: these data justify no extension of it",
            "unexplained": f"{self.MODEL} misses something, and nothing in the library explains it",
        }
        more = ", and something more" if self.causes and self.remainder.unexplained else ""
        return f"{begun}{listed(said) if said else nothing[self.verdict]}{more}"

    def headline(self) -> str:
        """Return the verdict in one sentence, with the gain of all causes and its reference."""
        explains = f": that explains {self.explained}" if self.explained and self.causes else ""
        return f"{self.title()}{explains}{f': {self.reason}' if self.reason else ''}."

    def notes(self) -> list[tuple[str, str]]:
        """Return notes in addition to the table of causes, by topic."""
        assumed = "; ".join(f"{topic}: {words}" for topic, words in self.assumed().items())
        rows = [*self.judged(), *([("assumed", assumed)] if assumed else []), ("next", self.advice())]
        return rows + [("warning", words) for words in self.warnings]

    def assumed(self) -> dict[str, str]:
        """Return what the answer takes as known, in words by topic."""
        return {"estimator": self.why.estimator} if self.why else {}

    def effect(self, name: str) -> type | None:
        """Return the class of a cause, with its equation; None without one."""
        return None

    def advice(self) -> str:
        """Return the next step, in words."""
        if self.is_stopped:
            return "diagnose again without a limit of time, or with a longer one, before this answer is used"
        if self.next_experiment is not None and self.causes:
            return f"to separate {listed(list(self.next_experiment.separates))}: {self.next_experiment.why}"
        if self.causes:
            care = ", with care: it lacks something" if self.remainder.unexplained else ""
            return f"use the extended model{self.use_for()}{care}"
        if self.remainder.unexplained:
            return "check the sensors and conditions of what is missed most, or write a cause of your own"
        return "keep the model; to look for causes that these data cannot show, record other ones"

    def use_for(self) -> str:
        """Return what an extended model may be used for, in words; empty where nothing restricts it."""
        return ""

    def explain(self, name: str) -> list[str]:
        """Return why a cause is named or is not, a line for each place or group in which it was tried."""
        said = [(one.name, f"named ({one.tested()})") for one in self.causes]
        said += [(n, f"equivalent to {one.name}, which is named") for one in self.causes for n in one.equivalents]
        said += list(self.why.reasons().items()) if self.why else []
        said += self.not_fitted()
        lines = [f"{n}: {words}" for n, words in said if name in (n, Key.of(n).name)]
        known = listed(sorted({Key.of(n).name for n, _ in said}))
        return lines or [f"{name}: not fitted; candidates were {known}"]

    def judged(self) -> list[tuple[str, str]]:
        """Return the measure and the data by which each cause is judged, with its gain."""
        gains: dict[str, list[str]] = {}
        for one in self.causes:
            if (gain := one.judged) is not None:
                gains.setdefault(f"{gain.measure}, {ON[gain.on]}", []).append(f"{one.name} {gain}")
        return [(f"judged by {measure}", ", ".join(names)) for measure, names in gains.items()]

    def own_record(self) -> dict[str, Any]:
        """Return the part of the record that only this kind of result has."""
        raise NotImplementedError

    def head(self) -> tuple[str, ...]:
        """Return the titles of the table of causes."""
        held_out = any(one.gain_held_out.is_held_out for one in self.causes if isinstance(one, Cause))
        lost = f"lost without it, {'held out' if held_out else 'fitted'}"
        return "cause", "where", "parameters, 95 %", lost, "p", "equivalents"

    def record(self) -> dict[str, Any]:
        """The JSON file as a dictionary, without the text and the table that a saved result has as well."""
        return {
            "study": self.study.name,
            "verdict": self.verdict,
            f"{self.KIND.__name__.lower()}s": [one.record() for one in self.causes],
            "remainder": self.remainder.record(),
            **({"explained": self.explained.record()} if self.explained else {}),
            **({"errors": [one.errors() for one in errors]} if (errors := self.errors()) else {}),
            "next": self.advice(),
            "assumed": self.assumed(),
            **self.own_record(),
            **({"why": self.why.record()} if self.why else {}),
            "warnings": list(self.warnings),
            "wall_s": round(self.wall_s, 2),
            **({"provenance": self.provenance.record()} if self.provenance else {}),
        }

    def columns(self) -> dict[str, list[Any]]:
        """The table of `to_frame`, by columns: a row an estimate of each that is named, none without one."""
        return by_columns(self.KIND.head(), [row for one in self.causes for row in one.columns()])

    def as_table(self) -> tuple[str, Sequence[str], Sequence[Sequence[str]], Sequence[str]]:
        """Title, head, rows and notes of the table that is printed."""
        errors: dict[str, list[str]] = {}
        for one in self.errors():
            values = " -> ".join(dict.fromkeys([percent(one.nominal), percent(one.extended)]))
            errors.setdefault(f"error E {ON[one.on]}", []).append(f"{one.what} {values}")
        said = [(one.name, one.sentence.removesuffix(".")) for one in self.causes if one.sentence and not one.words]
        lines = said + [(topic, ", ".join(many)) for topic, many in errors.items()] + self.notes()
        title, rows = f"{self.study.name}: {self.headline()}", [one.row() for one in self.causes]
        return title, self.head(), rows, [f"{topic}: {words}" for topic, words in lines]

    def files(self) -> dict[str, str | bytes]:
        """Content of every file of the answer but the report, by name."""
        proposed = self.next_experiment.trial if self.next_experiment else None
        return {self.FILE: self.to_json(), **({NEXT_FILE: trial_csv(proposed)} if proposed else {})}

    def ended(self, began: float, made: Provenance, limit: float | None) -> Self:
        """Return the same with its origin and computing time; stopped where a limit of time ended its search.

        Parameters
        ----------
        began
            When it was begun, of `time.perf_counter`.
        made
            Its origin.
        limit
            The limit that ended the search, s; None where none did.
        """
        done = replace(self, provenance=made, wall_s=time.perf_counter() - began)
        if limit is None:
            return done
        said = f"the search was stopped at its limit of {limit:g} s: best set so far"
        return replace(done, verdict=STOPPED, warnings=(*self.warnings, said))

    def by_command(self, command: str) -> Self:
        """The same with a command line in its provenance."""
        made = self.provenance
        return self if made is None else replace(self, provenance=replace(made, command=command))

    def __repr__(self) -> str:
        names = f" ({', '.join(one.name for one in self.causes)})" if self.causes else ""
        return f"{type(self).__name__} of {self.study.name}: {self.verdict}{names}"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ModelResult(Result):
    """The result about one model: base of diagnoses of rigs and of walks.

    Attributes
    ----------
    absorbed
        Causes that are not testable with these data.
    nominal_error, extended_error
        E in percent: on the fitted data, and on held-out data; None where it is not computed.
    ceiling_percent
        E of noise alone.
    """

    causes: tuple[Cause, ...]
    absorbed: tuple[str, ...]
    nominal_error: tuple[float | None, float | None]
    extended_error: tuple[float | None, float | None]
    ceiling_percent: float

    def not_fitted(self) -> list[tuple[str, str]]:
        """Return the causes that are not testable, in words."""
        return [(n, "not testable with these data") for n in self.absorbed]

    @property
    def model(self) -> Any:
        """The extended model: of a rig a `Model`, of a walk a `Body`."""
        raise NotImplementedError

    def models_record(
        self, nominal: dict[str, Any], extended: dict[str, Any], noise: dict[str, Any], files: Sequence[str] = ("file",)
    ) -> dict[str, Any]:
        """Return the part of the record about both models and the next experiment; `files` as in `Plan.record`."""
        return {
            "absorbed": list(self.absorbed),
            "nominal": nominal,
            "extended": extended,
            "noise": noise,
            "ceiling_percent": shown(self.ceiling_percent),
            "next_experiment": self.next_experiment.record(files) if self.next_experiment else None,
        }


def _cell(value: Any) -> Any:
    return shown(value) if isinstance(value, float) else value


@dataclass(frozen=True, eq=False, repr=False)
class SavedResult(Saveable):
    """A result as it was saved: what it said, to the digits that are printed, without the study, fits and models.

    It has the verdict, the causes or changes, every value, the text and the table, and equals what was saved.
    It cannot simulate or draw a report: keep `model.toml` and the report with it, or the result itself by `pickle`.

    Attributes
    ----------
    kind
        "Diagnosis", "WalkDiagnosis", "Contrast", "Comparison", "Fit" or "Cohort".
    found
        The record, read-only, by the keys of the JSON file.
    text
        What `print` showed of the result.
    table
        The columns of its frame; None for a number that is not finite.
    """

    kind: str
    found: Mapping[str, Any]
    text: str
    table: Mapping[str, tuple[Any, ...]]

    def _kind(self) -> str:
        return self.kind

    @property
    def verdict(self) -> str | None:
        """The verdict; None of a result that has none."""
        return self.found.get("verdict")

    @property
    def causes(self) -> tuple[Mapping[str, Any], ...]:
        """Causes of a diagnosis, or changes of a contrast, as mappings by the keys of the JSON file."""
        return tuple(self.found.get("causes", self.found.get("changes", ())))

    def record(self) -> dict[str, Any]:
        """Return the saved record, as plain values."""
        return dict(as_dicts(self.found))

    def columns(self) -> dict[str, list[Any]]:
        """The table of `to_frame`, by columns."""
        return {n: list(values) for n, values in self.table.items()}

    def __repr__(self) -> str:
        return f"saved {self.kind} of {self.found.get('study', 'studies')}: {self.verdict or 'no verdict'}"

    def __str__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.text)}</pre>"


def save_result(result: Saveable, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a result as JSON, whole or not at all; `load_result` reads it.

    Parameters
    ----------
    result
        What `diagnose`, `contrast`, `compare`, `fit` or a cohort gave. Numbers are written to the digits that are
        printed.
    path
        Of the file, `.json`; `fes-pin diagnose`, `contrast` and `compare` write the same as `diagnosis.json` and so on.
    overwrite
        Replace a file that this function did not write, or that was changed since.

    Raises
    ------
    InputError
        It is no such result, or the file cannot be written, was read, or is one of others.
    """
    if not isinstance(result, Saveable):
        kind = type(result).__name__
        message = f"expected a result of diagnose, contrast, compare, fit or a cohort, found {kind}"
        raise InputError(message, column="result")
    written_by("save_result", path, result.to_json(), (".json",), overwrite)


def load_result(path: str | Path) -> SavedResult:
    """Read a result that `save_result` or a command wrote: see `SavedResult` for what it can do.

    Raises
    ------
    InputError
        The file cannot be read, or is no result.
    """
    found = read_json(path)
    found = found if isinstance(found, dict) else {}
    kind, lines, table = (found.pop(n, None) for n in (RESULT, TEXT, TABLE))
    whole = isinstance(kind, str) and isinstance(lines, list) and isinstance(table, dict)
    if not whole or not all(isinstance(column, list) for column in table.values()):
        raise InputError(f"expected a result that fes-pin saved, with {RESULT}, {TEXT} and {TABLE}", file=path)
    return SavedResult(kind, found, "\n".join(map(str, lines)), table)
