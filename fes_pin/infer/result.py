"""Results of an inference, whatever was measured: estimates, gains, causes and changes, lack of fit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeVar

from fes_pin.infer.family import SMALLEST_P
from fes_pin.infer.levels import CONFIDENCE_95, MOST_PERCENT, NOTHING_PERCENT
from fes_pin.infer.optimum import Optimum
from fes_pin.infer.text import percent, plain_name, probability, quantity

CELLS = ("value", "std", "unit", "low", "high", "at_bound")
"""Columns of tables of estimates; `low` and `high` are the ends of the 95 % interval."""
SEEN = "would have been seen in 95 of 100"
"""What is said of a size that a test finds with the power `levels.SEEN_POWER`."""
DIGITS = 6
"""Significant digits printed: the last that does not depend on how sums are ordered."""


def shown(value: float | None, digits: int = DIGITS) -> float | None:
    """Return a number rounded to significant digits; None if it is not finite."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.{digits}g}")


def p_shown(value: float) -> float | None:
    """Return a p-value rounded for print; none is zero."""
    return shown(max(value, SMALLEST_P)) if math.isfinite(value) else None


@dataclass(frozen=True)
class ParameterEstimate:
    """A value with its standard deviation and unit.

    Attributes
    ----------
    std
        Standard deviation: infinite if the value is not identified, 0 if it is held, NaN at a bound.
    at_bound
        Whether the value is at a bound of the parameter. Its 95 % interval is then one-sided: from the bound to the
        other end.
    ends
        Ends of its 95 % interval, where these are not 1.96 standard deviations to either side.
    """

    value: float
    std: float
    unit: str = ""
    at_bound: bool = False
    ends: tuple[float, float] | None = None

    @classmethod
    def of(cls, fitted: Optimum, name: str, unit: str, wider: float = 1.0) -> ParameterEstimate:
        """Return the estimate of a parameter of a fit, with its standard deviation times `wider`."""
        value = fitted.values[name]
        if name not in fitted.free:
            return cls(value, 0.0, unit)
        if name in fitted.at_bound:
            low, high = (value + wider * (end - value) for end in fitted.interval(name))
            return cls(value, math.nan, unit, True, (low, high))
        return cls(value, wider * fitted.std(name), unit, ends=fitted.interval(name) if wider == 1.0 else None)

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        half = CONFIDENCE_95 * self.std
        return self.ends or (self.value - half, self.value + half)

    def one_sided(self) -> str:
        """The end of a one-sided interval that is not the bound, in words."""
        low, high = self.interval
        word, end = ("most", high) if high - self.value >= self.value - low else ("least", low)
        return f"at {word} {end:.3g}" if math.isfinite(end) else "not identified"

    def __str__(self) -> str:
        if not self.at_bound:
            return quantity(self.value, self.std, self.interval, self.unit)
        return f"{self.value:.4g} {self.unit} (at its bound, {self.one_sided()})".replace("  ", " ")

    def cells(self) -> tuple[Any, ...]:
        """Return its cells of a table, in the order of `CELLS`."""
        return self.value, self.std, self.unit, *self.interval, self.at_bound

    def record(self) -> dict[str, Any]:
        """Return the estimate for JSON, with its 95 % interval; `at_bound` is in it only at a bound."""
        low, high = map(shown, self.interval)
        bound = {"at_bound": True} if self.at_bound else {}
        return {"value": shown(self.value), "std": shown(self.std), "low": low, "high": high, **bound}


HELD_OUT, CROSS_VALIDATED, FITTED, STOPPED = "held_out", "cross_validated", "fitted", "stopped"
"""Data on which a gain is found: a part that was held out from the start, each part by fits without it, the fitted
data, or the fitted data because a limit ended the search before any part was held out."""
ON = {
    HELD_OUT: "held out",
    CROSS_VALIDATED: "cross-validated",
    FITTED: "on what was fitted",
    STOPPED: "on what was fitted, as the search was stopped",
}
"""The same in words."""
ERROR, LIKELIHOOD = "squared error above the noise", "twice the log-likelihood"
"""Measures of the gain of a cause: the nominal model's squared error minus that of noise alone, or the increase of
twice the log-likelihood."""


@dataclass(frozen=True)
class Gain:
    """Gain of a cause: the share of the nominal model's error that it removes, percent, with its 95 % interval.

    Attributes
    ----------
    ahead_s
        Horizon of the predictions, s, where that is longer than the usual one.
    on
        Data on which it is found: a key of `ON`.
    measure
        What it is counted in.
    given
        Low end of the share of the error that the other causes leave, percent.
    """

    percent: float
    low: float
    high: float
    ahead_s: float | None = None
    on: str = CROSS_VALIDATED
    measure: ClassVar[str] = ERROR
    given: float = math.nan

    def __str__(self) -> str:
        if self.is_none:
            return "none computed"
        further = "" if self.ahead_s is None else f", {self.ahead_s:.2g} s ahead"
        return f"{self.percent:.0f} % [{self.low:.0f}, {self.high:.0f}]{further}"

    @property
    def is_none(self) -> bool:
        """Whether none was computed."""
        return math.isnan(self.percent)

    @property
    def is_material(self) -> bool:
        """Whether the low end of its interval is above `NOTHING_PERCENT`, or most of what other causes leave is.

        Next to a large cause a smaller one removes little of the nominal error, but perhaps most of what remains. Of
        data that were fitted, a flexible form may remove most of a negligible remainder.
        """
        is_felt = self.is_held_out or self.percent > NOTHING_PERCENT
        return self.low > NOTHING_PERCENT or (is_felt and self.given > MOST_PERCENT)

    @property
    def is_held_out(self) -> bool:
        """Whether it is found on held-out data."""
        return self.on in (HELD_OUT, CROSS_VALIDATED)

    def record(self) -> dict[str, Any]:
        """As JSON files have it."""
        size = {"percent": shown(self.percent), "low": shown(self.low), "high": shown(self.high)}
        return {"measure": self.measure, "on": self.on, **size}


NO_GAIN = Gain(math.nan, math.nan, math.nan)
"""Gain of a cause for which no error is computed."""


@dataclass(frozen=True)
class Evidence:
    """Evidence for a cause: what it adds to twice the log-likelihood of held-out data.

    The residual without it is the residual with it plus a difference Delta of predictions, all whitened:
    |r + Delta|^2 - |r|^2 = |Delta|^2 + 2 r'Delta, which scatters by 2 |Delta| where r is noise.

    Attributes
    ----------
    added
        The increase of twice the log-likelihood.
    squares
        |Delta|^2.
    on, measure
        As of `Gain`.
    """

    added: float
    squares: float
    on: str = CROSS_VALIDATED
    measure: ClassVar[str] = LIKELIHOOD

    @property
    def low(self) -> float:
        """Lower end of the 95 % interval."""
        return self.added - 2.0 * CONFIDENCE_95 * math.sqrt(self.squares)

    @classmethod
    def of(cls, added: float) -> Evidence:
        """Return the evidence of a likelihood ratio: that of a true cause scatters by twice the root of its mean."""
        return cls(added, max(added, 0.0)) if math.isfinite(added) else cls(0.0, 0.0)

    @property
    def high(self) -> float:
        """Upper end of the 95 % interval."""
        return 2.0 * self.added - self.low

    def __str__(self) -> str:
        return f"{self.added:.0f} [{self.low:.0f}, {self.high:.0f}]"

    def record(self) -> dict[str, Any]:
        """As JSON files have it."""
        size = {"added": shown(self.added), "low": shown(self.low), "high": shown(self.high)}
        return {"measure": self.measure, "on": self.on, **size}


@dataclass(frozen=True)
class Remainder:
    """Lack of fit: whether residuals of the model are more than noise, its p-value, and where they are largest.

    Attributes
    ----------
    level
        Level of the test; NaN where there was none.
    reason
        Why there is a lack of fit where no test finds it, in words.
    everywhere
        Whether it is one of every group of the data: an error of the model that all share, and no change.
    """

    unexplained: bool
    p_value: float
    where: str | None
    level: float = math.nan
    reason: str | None = None
    everywhere: bool = False

    @property
    def of_some(self) -> bool:
        """Whether it is one of some data alone, or of data in no groups."""
        return self.unexplained and not self.everywhere

    def tested(self) -> str:
        """Return its p-value and the level, in words."""
        level = f", level {self.level:g}" if math.isfinite(self.level) else ""
        return f"{probability(self.p_value)}{level}"

    def record(self) -> dict[str, Any]:
        """As JSON files have it."""
        test = {"p_value": p_shown(self.p_value), "level": shown(self.level)}
        shared = {"in_every_group": True} if self.everywhere else {}
        return {"unexplained": self.unexplained, **test, "where": self.where, **shared}


@dataclass(frozen=True)
class Explained:
    """Gain of all causes together: errors of a constant, of the fitted nominal model and of the extended model.

    Errors are E: squares in percent of those of the measurement about its mean. A constant has therefore 100.

    Attributes
    ----------
    what
        The predictions, in words.
    on
        Data on which errors are found: a key of `ON`.
    noise
        Error of noise alone; None where that is not known.
    """

    what: str
    on: str
    nominal: float
    extended: float
    noise: float | None = None
    constant: float = 100.0

    def of(self, reference: float) -> float:
        """Return the share of a model's error that the extended model removes, percent; below 0 where it adds some."""
        return 100.0 * (reference - self.extended) / max(reference, 1e-300)

    @property
    def above_noise(self) -> float:
        """Share of the nominal model's error above the noise that the extended model removes, percent."""
        gone = self.nominal - self.extended
        return 100.0 * gone / max(self.nominal - (self.noise or 0.0), gone, 1e-300)

    def __str__(self) -> str:
        above = "" if self.noise is None else " above the noise"
        alone = "" if self.noise is None else f"; noise alone leaves {percent(self.noise)}"
        share = f"{self.above_noise:.0f} %" if self.extended <= self.nominal else "none"
        errors = f"E {percent(self.nominal)} -> {percent(self.extended)}, {ON[self.on]}"
        return f"{share} of the squared error{above} of {self.what}: {errors}{alone}"

    def errors(self) -> dict[str, Any]:
        """Return the errors of both models as JSON files have them, with their measure and data."""
        measure = {"measure": f"squared error of {self.what}", "on": self.on}
        return {**measure, "nominal": shown(self.nominal), "extended": shown(self.extended)}

    def record(self) -> dict[str, Any]:
        """As JSON files have it."""
        errors = {n: shown(getattr(self, n)) for n in ("constant", "nominal", "extended", "noise")}
        gains = {"constant": self.of(self.constant), "nominal": self.of(self.nominal), "above_noise": self.above_noise}
        record = {"measure": f"squared error of {self.what}", "on": self.on, "error_percent": errors}
        return {**record, "gain_percent": {n: shown(value) for n, value in gains.items()}}


@dataclass(frozen=True)
class Ranked:
    """A rival set: its names, and the loss of twice the log-likelihood with it in the place of the chosen set."""

    names: tuple[str, ...]
    shortfall: float


V_co = TypeVar("V_co", covariant=True)


class Held(Mapping[str, V_co]):
    """A mapping that cannot be changed, not even after it was copied or pickled."""

    def __init__(self, values: Mapping[str, V_co]) -> None:
        self._values = dict(values)

    def __getitem__(self, name: str) -> V_co:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return repr(self._values)


def _held(value: object) -> object:
    """Return mappings, and mappings in these, as such that cannot be changed; other values as they are."""
    return Held({n: _held(v) for n, v in value.items()}) if isinstance(value, Mapping) else value


@dataclass(frozen=True, eq=False, kw_only=True)
class Named:
    """A named cause or change. Two are equal if their records are.

    Attributes
    ----------
    parameters
        Estimates by name.
    equivalents
        Candidates that these data cannot distinguish from it: to be read as one set with it.
    p_value
        Family-wise p-value of its gain, over all candidates.
    site
        Where it acts, if it can act at several places; empty if there is one.
    trial
        The only trial that it concerns, if it does not concern all.
    words
        The change in words, where the name alone does not state it.
    sentence, equation
        Of a cause, in its form as fitted; a parameter has its name without a unit in the equation.
    evidence
        Its evidence in held-out data; None where the model has a lack of fit.
    """

    name: str
    parameters: Mapping[str, object]
    equivalents: tuple[str, ...]
    p_value: float
    site: str = ""
    trial: str | None = None
    words: str = ""
    sentence: str = ""
    equation: str = ""
    evidence: Evidence | None = None
    PLACE: ClassVar[tuple[str, ...]] = ("stage", "site")
    """Attribute that says where it acts."""
    CELL: ClassVar[tuple[str, ...]] = ("parameter",)
    """Columns that say which of its values an estimate is."""
    GAIN: ClassVar[tuple[str, ...]] = ()
    """Columns of its gain."""

    def __post_init__(self) -> None:
        vars(self).update({n: _held(value) for n, value in vars(self).items()})

    @property
    def judged(self) -> Gain | Evidence | None:
        """The gain by which it is named, with its measure; None where it is named by its p-value alone."""
        return self.evidence

    def tested(self) -> str:
        """Return its p-value and the gain by which it is named, in words."""
        return probability(self.p_value) + (f", {self.judged.measure} {self.judged}" if self.judged else "")

    def label(self, name: str, one: ParameterEstimate) -> str:
        """Return the name of a parameter as printed: in words, but for one of a site, which may be that of a trial."""
        is_of_trial = self.site and not name.endswith(f"_{one.unit.lower()}")
        return name if is_of_trial else plain_name(name, one.unit)

    def estimates(self) -> list[tuple[tuple[str, ...], ParameterEstimate]]:
        """Return every estimate of it, with its cells of `CELL`."""
        raise NotImplementedError

    def row(self) -> tuple[str, ...]:
        """Return its cells of a printed table."""
        raise NotImplementedError

    def columns(self) -> list[tuple[Any, ...]]:
        """Return its rows of a table for computation, one an estimate."""
        place = [getattr(self, n) for n in self.PLACE if n not in self.CELL]
        last = (self.p_value, *self._gain_cells(), ", ".join(self.equivalents))
        return [(self.name, *place, *cell, *one.cells(), *last) for cell, one in self.estimates()]

    @classmethod
    def head(cls) -> tuple[str, ...]:
        """Return the names of `columns`."""
        place = [n for n in cls.PLACE if n not in cls.CELL]
        return (cls.__name__.lower(), *place, *cls.CELL, *CELLS, "p_value", *cls.GAIN, "equivalents")

    def _gain_cells(self) -> tuple[float, ...]:
        return ()

    def _parameters(self) -> dict[str, Any]:
        raise NotImplementedError

    def _gains(self) -> dict[str, Any]:
        return {"judged_by": self.judged.record()} if self.judged else {}

    def record(self) -> dict[str, Any]:
        """As JSON files have it."""
        place = {
            n: value for n in (*self.PLACE, "trial", "words", "sentence", "equation") if (value := getattr(self, n))
        }
        own = {"parameters": self._parameters(), "equivalents": list(self.equivalents)}
        return {"name": self.name, **place, **own, "p_value": p_shown(self.p_value), **self._gains()}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Named) and type(other) is type(self) and other.record() == self.record()

    def __hash__(self) -> int:
        return hash((self.name, self.site, self.trial, self.p_value))


@dataclass(frozen=True, eq=False, kw_only=True)
class Cause(Named):
    """One named cause.

    Attributes
    ----------
    stage
        Stage of the signal path.
    gain_fit
        Gain in percent on the fitted data.
    gain_held_out
        Gain on held-out data; on the fitted data where nothing could be held out.
    chosen_again
        Number of folds in which it, or an equivalent, was chosen without the held-out data, and number of folds.
    elsewhere
        Other sites of the same cause that explain the data as well.
    further
        Other gains by name, percent: for walking "other_leg", the gain on one leg's single supports of sizes fitted to
        those of the other leg, for causes that belong to neither leg.
    """

    parameters: Mapping[str, ParameterEstimate]
    stage: str
    gain_fit: float
    gain_held_out: Gain
    chosen_again: tuple[int, int] | None = None
    elsewhere: tuple[str, ...] = ()
    further: Mapping[str, float | None] = field(default_factory=dict)
    GAIN: ClassVar[tuple[str, ...]] = ("gain_percent", "gain_low", "gain_high")

    @property
    def judged(self) -> Gain | Evidence:
        """The gain by which it is named: evidence of the likelihood, or the gain in errors where there is none."""
        return self.evidence or self.gain_held_out

    @property
    def chosen_in_some(self) -> tuple[int, int] | None:
        """`chosen_again` where some folds choose another set; None where none does."""
        again = self.chosen_again
        return again if again is not None and again[0] < again[1] else None

    def estimates(self) -> list[tuple[tuple[str, ...], ParameterEstimate]]:
        """Return every parameter by name."""
        return [((n,), one) for n, one in self.parameters.items()]

    def row(self) -> tuple[str, ...]:
        """Return name, site, values, gain and equivalents."""
        values = "\n".join(f"{self.label(n, one)} {one}" for n, one in self.parameters.items())
        where = f"trial {self.trial}" if self.trial is not None else self.site or self.stage
        test = probability(self.p_value).removeprefix("p = ").removeprefix("p ")
        return self.name, where, values, str(self.gain_held_out), test, ", ".join(self.equivalents) or "-"

    def _gain_cells(self) -> tuple[float, ...]:
        return self.gain_held_out.percent, self.gain_held_out.low, self.gain_held_out.high

    def _parameters(self) -> dict[str, Any]:
        # the names of parameters without a site have units
        return {n: one.record() | ({"unit": one.unit} if self.site else {}) for n, one in self.parameters.items()}

    def _gains(self) -> dict[str, Any]:
        gain, some = self.gain_held_out, self.chosen_in_some
        return {
            **({"chosen_again": list(some)} if some else {}),
            "gain_percent": {
                "fit": shown(self.gain_fit),
                "held_out": shown(gain.percent) if gain.is_held_out else None,
                "ci95": None if gain.is_none else [shown(gain.low), shown(gain.high)],
                **({"ahead_s": shown(gain.ahead_s)} if gain.ahead_s is not None else {}),
                **{n: shown(value) for n, value in self.further.items()},
            },
            **super()._gains(),
        }


ABSENT = "absent"
"""What is printed for the size of a cause in a group that does not have it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Change(Named):
    """One change between groups.

    Attributes
    ----------
    kind
        "nominal", a parameter of the nominal model; "effect", a cause; or "condition", a trial that was misread.
    group
        The group that has a value of its own.
    parameters
        By name and group: of a group that does not have the cause its null, without deviation.
    """

    parameters: Mapping[str, Mapping[str, ParameterEstimate]]
    kind: str
    group: str
    PLACE: ClassVar[tuple[str, ...]] = ("kind", "group", "site")
    CELL: ClassVar[tuple[str, ...]] = ("parameter", "group")

    def estimates(self) -> list[tuple[tuple[str, ...], ParameterEstimate]]:
        """Return every parameter by name and group."""
        return [((n, g), one) for n, groups in self.parameters.items() for g, one in groups.items()]

    def _parameters(self) -> dict[str, Any]:
        return {n: {g: one.record() for g, one in groups.items()} for n, groups in self.parameters.items()}

    def row(self) -> tuple[str, ...]:
        """Return name, kind of change, values by group, p-value and equivalents."""
        lines = [
            f"{self.label(name, groups[self.group])}: "
            + ", ".join(f"{g} {one if one.std else ABSENT}" for g, one in groups.items())
            for name, groups in self.parameters.items()
        ]
        return self.name, self.words, "\n".join(lines), probability(self.p_value), ", ".join(self.equivalents) or "-"
