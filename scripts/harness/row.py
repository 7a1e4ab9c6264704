"""One answer beside the truth."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from harness.generator import Item, Truth

KINDS = ("nothing", "one", "two", "outside", "no form")
ADEQUATE, STOPPED = "adequate", "stopped"
"""The verdict where nothing is named nor left, and that of a search that a limit ended or that did not converge."""


@dataclass(frozen=True)
class Row:
    """What was answered of a study.

    Attributes
    ----------
    sets
        Each named cause or change with what cannot be told from it, in their order.
    left
        Lack of fit: the residual is more than noise.
    estimates
        Name, truth, estimate of the nominal model (None where it has none), estimate and its standard deviation.
    errors
        By kind, in percent: of the nominal model, and of the extended one.
    cpu_s
        Processor time of the answer.
    study
        Hash of the study's files.
    code
        Hash of the code that answered.
    error
        Of a study without an answer.
    unseen
        Error E of the answer's model on the trial that nobody was shown, percent; None where there is none.
    nearest
        See `Truth`.
    against
        Errors of the answer's model, of the believed model and of a regression, percent; see `never_worse`.
    true
        Errors of the true model by the same measures, percent, where the answer's are worse than another's.
    """

    key: str
    hidden: tuple[str, ...]
    part: str
    outside: bool
    code: str
    study: str = ""
    verdict: str = ""
    sets: tuple[tuple[str, ...], ...] = ()
    left: bool = False
    estimates: tuple[tuple[str, float, float | None, float, float], ...] = ()
    errors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    cpu_s: float = 0.0
    error: str | None = None
    unseen: float | None = None
    nearest: tuple[str, ...] | None = None
    against: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    true: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, stored: Mapping[str, Any]) -> Row:
        """The row that a line of a store holds."""
        return cls(**{name: read_only(value) for name, value in stored.items()})

    @property
    def kind(self) -> str:
        """One of `KINDS`."""
        if self.hidden and self.nearest is not None:
            return "no form"
        return "outside" if self.outside else KINDS[min(len(self.hidden), 2)]

    @property
    def right(self) -> bool:
        """Nothing is named where nothing is hidden; one cause stands in the first set, of more each in a set of its
        own; of what the library does not have a lack of fit is reported, or no wrong name and one of the nearest."""
        if self.outside:
            return self.left
        if self.nearest is not None:
            return not self.misnamed and self.near
        if not self.hidden:
            return not self.sets
        if len(self.hidden) == 1:
            return bool(self.sets) and self.hidden[0] in self.sets[0]
        found = [{k for k, names in enumerate(self.sets) if cause in names} for cause in self.hidden]
        return all(found) and len(set().union(*found)) >= len(found)

    @property
    def misnamed(self) -> bool:
        """A set has none of the causes that are hidden or nearest."""
        known = {*self.hidden, *(self.nearest or ())}
        return not all(known & set(names) for names in self.sets)

    @property
    def near(self) -> bool:
        """One of the nearest causes stands in a set, if there is one."""
        return not self.nearest or any(set(self.nearest) & set(names) for names in self.sets)

    @property
    def first(self) -> bool:
        """It is right, and each hidden cause is the one that its set is named by."""
        return self.right and not self.outside and set(self.hidden) <= {names[0] for names in self.sets}

    @property
    def alone(self) -> bool:
        """It is right, nothing is named besides, and nothing else could be it."""
        return self.right and not self.outside and sorted(self.sets) == sorted((cause,) for cause in self.hidden)

    @property
    def further(self) -> bool:
        """More is named than is hidden, or than is nearest."""
        return len(self.sets) > max(len(self.hidden), len(self.nearest or ()))

    @property
    def exact(self) -> bool:
        """The extended model has the causes that are hidden, and no other; where they have no form it is right."""
        if self.nearest is not None:
            return self.right
        return sorted(names[0] for names in self.sets) == sorted(self.hidden)


def read_only(value: Any) -> Any:
    """A value of JSON, its lists as tuples."""
    if isinstance(value, dict):
        return {name: read_only(one) for name, one in value.items()}
    return tuple(read_only(one) for one in value) if isinstance(value, list) else value


def sets_of(record: Mapping[str, Any]) -> tuple[tuple[str, ...], ...]:
    """Each cause or change that an answer names, with what cannot be told from it."""
    causes = record["causes"] if "causes" in record else record["changes"]
    return tuple((c["name"], *c["equivalents"]) for c in causes)


def _is_left(remainder: Mapping[str, Any]) -> bool:
    """Whether there is a lack of fit. One that all groups share is no change, and does not count."""
    return bool(remainder["unexplained"] and not remainder.get("in_every_group", False))


def judged(item: Item, truth: Truth, record: Mapping[str, Any], **known: Any) -> Row:
    """An answer, as JSON has it, beside the truth."""
    beside, nearest = set(truth.beside) - set(item.hidden), set(truth.nearest or ())
    return Row(
        item.key,
        item.hidden,
        truth.part or item.part,
        item.outside,
        verdict=record["verdict"],
        sets=tuple(names for names in sets_of(record) if nearest & set(names) or not beside & set(names)),
        left=bool(record["verdict"] == "unexplained" or _is_left(record["remainder"])),
        estimates=tuple(_estimates(truth.parameters, record)),
        errors=dict(_errors(record)),
        nearest=truth.nearest,
        **known,
    )


def _estimates(
    true: Mapping[str, float], record: Mapping[str, Any]
) -> Iterator[tuple[str, float, float | None, float, float]]:
    fitted = dict(record.get("extended", {}).get("parameters", {}))
    for cause in record.get("causes", ()):
        if place := cause.get("site") or cause.get("trial"):
            fitted |= {f"{cause['name']} at {place}": one for one in cause["parameters"].values()}
    nominal = record.get("nominal", {}).get("parameters", {})
    for name, value in true.items():
        if (found := fitted.get(name)) and found["std"] and math.isfinite(found["std"]):
            yield name, value, nominal.get(name, {}).get("value"), found["value"], found["std"]


def _errors(record: Mapping[str, Any]) -> Iterator[tuple[str, tuple[float, float]]]:
    before, after = (record.get(which, {}).get("error_percent", {}) for which in ("nominal", "extended"))
    for kind in ("held_out", "horizon"):
        if before.get(kind) is not None and after.get(kind) is not None:
            yield kind, (before[kind], after[kind])
