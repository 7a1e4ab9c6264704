"""The answer of a comparison: models by their errors on held-out trials, and which of them differ significantly."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import special

from fes_pin.data.errors import InputError
from fes_pin.data.results import Recorded, Saveable
from fes_pin.data.study import Study
from fes_pin.data.units import own_unit
from fes_pin.identify.fit import Fit
from fes_pin.infer.levels import UNUSUAL_LEVEL
from fes_pin.infer.result import shown
from fes_pin.search.likelihood_fits import ESTIMATORS, WHITE


@dataclass(frozen=True)
class Apart:
    """Difference of a model's E to that of the best on held-out trials, with its interval.

    Attributes
    ----------
    more, low, high
        Percent; the interval holds for all models at once.
    """

    more: float
    low: float
    high: float

    @property
    def told(self) -> bool:
        """Whether the interval is above zero, so that the difference is significant."""
        return self.low > 0.0

    def __str__(self) -> str:
        return f"{self.more:.2g} [{self.low:.2g}, {self.high:.2g}] %{'' if self.told else ' not significant'}"

    def record(self) -> dict[str, Any]:
        """The difference as `compare.json` has it."""
        return {"percent": shown(self.more), "low": shown(self.low), "high": shown(self.high), "told": self.told}


@dataclass(frozen=True, eq=False)
class Compared(Recorded):
    """One model.

    Attributes
    ----------
    words, source
        What it is made of, and where it was published; empty of the study's own.
    parameters
        How many are fitted.
    unfelt
        Effects of the publication that act in none of these trials.
    rmse
        By output column and then by "free", "horizon", "begun" and "free_rest": root mean squared error over held-out
        trials, in the unit of the column.
    percent
        By the same: E on held-out trials, percent; see `identify.error_measures`.
    squares
        By the same: shape (trials,), what each held-out trial adds to E, times the number of trials: their mean is E.
    apart
        By "free" and "horizon": against the best of that kind of error; None of the best.
    fit
        To all fitted trials.
    converged
        False if one of the fits did not end at an optimum.
    """

    name: str
    words: str
    source: str
    parameters: int
    unfelt: tuple[str, ...]
    rmse: Mapping[str, Mapping[str, float]]
    percent: Mapping[str, float]
    squares: Mapping[str, np.ndarray] = field(repr=False)
    apart: Mapping[str, Apart | None]
    fit: Fit = field(repr=False)
    converged: bool = True

    def record(self) -> dict[str, Any]:
        """The model as `compare.json` has it."""
        return {
            "name": self.name,
            "words": self.words,
            "source": self.source,
            "effects": [e.name for e in self.fit.model.effects],
            "not_felt": list(self.unfelt),
            "parameters": {n: shown(self.fit.values[n]) for n in self.fit.free},
            "rmse": {c: {k: shown(v) for k, v in errors.items()} for c, errors in self.rmse.items()},
            "error_percent": {k: shown(v) for k, v in self.percent.items()},
            "of_each_trial": {k: [shown(float(v)) for v in values] for k, values in self.squares.items()},
            "worse_than_best": {k: None if a is None else a.record() for k, a in self.apart.items()},
            "converged": self.converged,
        }


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Saveable):
    """Models ranked on held-out trials.

    Attributes
    ----------
    models
        Least free error first.
    held_out
        Names of the trials that were predicted, in the order of `squares`.
    by
        "role" if the study holds trials out, else "folds": each trial was predicted by fits without it.
    horizon_s, given_s
        How far ahead, and how much of a trial was given; s.
    """

    study: Study
    models: tuple[Compared, ...]
    held_out: tuple[str, ...]
    by: str
    horizon_s: float
    given_s: float | None
    warnings: tuple[str, ...] = ()
    wall_s: float = 0.0

    def model(self, name: str) -> Compared:
        """The model of that name.

        Raises
        ------
        InputError
            If it was not compared.
        """
        known = {m.name: m for m in self.models}
        if name not in known:
            raise InputError(f"no model {name!r}; there are {', '.join(known)}", column="name")
        return known[name]

    def best(self, kind: str = "free") -> tuple[str, ...]:
        """The models whose "free" or "horizon" error is not significantly above the least, the best first."""
        order = sorted(self.models, key=lambda m: m.percent[kind])
        return tuple(m.name for m in order if (a := m.apart[kind]) is None or not a.told)

    def record(self) -> dict[str, Any]:
        """`compare.json` as a dictionary, without the text and the table that a saved result has as well."""
        return {
            "study": self.study.name,
            "estimator": ESTIMATORS[WHITE],
            "held_out": {"by": self.by, "trials": list(self.held_out)},
            "horizon_s": shown(self.horizon_s),
            "given_s": None if self.given_s is None else shown(self.given_s),
            "best": {kind: list(self.best(kind)) for kind in ("free", "horizon")},
            "models": [m.record() for m in self.models],
            "warnings": list(self.warnings),
            "wall_s": round(self.wall_s, 2),
        }

    def columns(self) -> dict[str, list[Any]]:
        """The table of `to_frame`, by columns: a row a model, its errors E in percent."""
        kinds = dict.fromkeys(k for m in self.models for k in m.percent)
        out: dict[str, list[Any]] = {"model": [m.name for m in self.models]}
        out["parameters"] = [m.parameters for m in self.models]
        out |= {f"{kind}_percent": [m.percent.get(kind, math.nan) for m in self.models] for kind in kinds}
        for kind in ("free", "horizon"):
            apart = [m.apart[kind] or Apart(0.0, 0.0, 0.0) for m in self.models]
            out |= {f"{kind}_{n}": [getattr(one, n) for one in apart] for n in ("more", "low", "high")}
        return {**out, "converged": [m.converged for m in self.models]}

    def as_table(self) -> tuple[str, Sequence[str], Sequence[Sequence[str]], Sequence[str]]:
        """Title, head, rows and notes of the table that is printed."""
        rows = [_row(self, m) for m in self.models]
        return f"{self.study.name}: {headline(self)}", _head(self), rows, notes(self)

    def __repr__(self) -> str:
        return f"Comparison of {', '.join(m.name for m in self.models)} on {self.study.name}"


def apart_from(best: np.ndarray, other: np.ndarray, rivals: int, folds: int) -> Apart:
    """A t interval of the mean difference between the errors of a model and of the best, on held-out trials.

    Parameters
    ----------
    best, other
        Shape (trials,): errors of both on the same trials.
    rivals
        Models that are held against the best, which share `UNUSUAL_LEVEL` (Bonferroni).
    folds
        Parts that trials were dealt to, 1 for trials that no fit has had. Fits of folds share trials, and the variance
        of the mean is 1 + folds / (folds - 1) times that of independent differences: Nadeau and Bengio, Machine
        Learning 52 (2003), with their n2 / n1 = 1 / (folds - 1).
    """
    more = other - best
    count = len(more)
    mean = float(more.mean())
    if count < 2:
        return Apart(mean, -math.inf, math.inf)
    wider = 1.0 + folds / (folds - 1.0) if folds > 1 else 1.0
    deviation = float(more.std(ddof=1)) * math.sqrt(wider / count)
    half = float(special.stdtrit(count - 1, 1.0 - 0.5 * UNUSUAL_LEVEL / max(rivals, 1))) * deviation
    return Apart(mean, mean - half, mean + half)


def headline(found: Comparison) -> str:
    """The answer in one sentence."""
    first, *others = found.best()
    trials = f"{len(found.held_out)} held-out trials"
    if not others:
        return f"{first} predicts {trials} best."
    return f"{trials} do not distinguish {first} from {', '.join(others)}."


def _head(found: Comparison) -> tuple[str, ...]:
    kinds = ["free", f"{found.horizon_s:.3g} s ahead"]
    kinds += [f"rest, free / first {found.given_s:.3g} s given"] if found.given_s is not None else []
    return "model", "fitted", *kinds, "worse than the best by, E"


def _row(found: Comparison, one: Compared) -> tuple[str, ...]:
    cells = [_cell(one, ("free",)), _cell(one, ("horizon",))]
    if found.given_s is not None:
        cells.append(_cell(one, ("free_rest", "begun")) if "begun" in one.percent else "-")
    apart = "; ".join(f"{word} {one.apart[kind] or 'best'}" for kind, word in (("free", "free"), ("horizon", "ahead")))
    return one.name, str(one.parameters), *cells, apart


def _cell(one: Compared, kinds: Sequence[str]) -> str:
    columns = [f"{' / '.join(f'{errors[k]:.4g}' for k in kinds)} {own_unit(name)}" for name, errors in one.rmse.items()]
    return ", ".join(columns) + f" ({' / '.join(f'{one.percent[k]:.3g}' for k in kinds)} %)"


def notes(found: Comparison) -> list[str]:
    """Return the notes under the table."""
    how = "each trial by fits without it" if found.by == "folds" else "trials that the study holds out"
    lines = [f"root mean squared error on whole trials left out ({how}); in brackets the error E of eq. (2)"]
    lines.append(f"estimator: {ESTIMATORS[WHITE]}")
    for one in found.models:
        if one.words:
            less = f"; not felt here: {', '.join(one.unfelt)}" if one.unfelt else ""
            lines.append(f"{one.name}: {one.words} ({one.source}){less}")
        if not one.converged:
            lines.append(f"{one.name}: a fit did not end at an optimum")
    return [*lines, *(f"warning: {words}" for words in found.warnings)]
