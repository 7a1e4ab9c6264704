"""A front end of inference that knows no rig: linear regression of repeated runs, with candidate columns and groups."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace

import numpy as np

from fes_pin.infer.distributions import chi2_tail, f_tail
from fes_pin.infer.family import Family
from fes_pin.infer.fits import Candidate, FittedSets
from fes_pin.infer.held_out import Errors, added_likelihood, deal, held_out_gain
from fes_pin.infer.levels import PARAMETER_PRICE, SEPARABLE
from fes_pin.infer.result import Evidence
from fes_pin.infer.search import Names, SearchResult
from fes_pin.infer.verdict import Verdict, Weighed

COUNT = 60
"""Samples of a run."""


@dataclass(frozen=True)
class Line:
    """A fitted set of columns; `values` and `covariance` are those of the candidates, in the order of their names."""

    sse: float
    degrees: int
    values: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray

    @property
    def price(self) -> float:
        return self.sse + PARAMETER_PRICE * self.degrees


class Regression(FittedSets[Line, None]):
    """Sets of columns fitted to runs that are repeats of each other, or of their group.

    Parameters
    ----------
    columns
        Candidates by name, each of shape (COUNT,).
    runs
        What was measured, shape (runs, COUNT), noise of unit variance.
    groups
        Of each run, 0 or 1: a column by the name `name@1` acts in the runs of group 1 alone.
    """

    def __init__(self, columns: dict[str, np.ndarray], runs: np.ndarray, groups: np.ndarray | None = None) -> None:
        super().__init__()
        count = len(runs)
        self.runs, self.groups = runs, np.zeros(count, int) if groups is None else groups
        self.columns = {n: np.tile(c, count) for n, c in columns.items()}
        if groups is not None:
            in_group = np.repeat(groups == 1, COUNT)
            self.columns |= {f"{n}@1": np.tile(c, count) * in_group for n, c in columns.items()}

    def fit(self, names: Names) -> Line:
        y, one = self.runs.ravel(), np.ones(self.runs.size)
        x = np.stack([one, *(self.columns[n] for n in names)], axis=1)
        values, *_ = np.linalg.lstsq(x, y, rcond=None)
        left = y - x @ values
        covariance = np.linalg.pinv(x.T @ x)
        return Line(float(left @ left), len(names), values[1:], covariance[1:, 1:], left.reshape(self.runs.shape))

    def left(self, names: Names, held: np.ndarray) -> np.ndarray:
        """What runs that are held out leave of a set that is fitted to the others."""
        x = np.stack([np.ones(self.runs.size), *(self.columns[n] for n in names)], axis=1)
        rows = np.repeat(held, COUNT)
        values, *_ = np.linalg.lstsq(x[~rows], self.runs[~held].ravel(), rcond=None)
        return self.runs[held] - (x[rows] @ values).reshape(-1, COUNT)

    def nominal(self) -> Line:
        self.fits[()] = self.fit(())
        return self.fits[()]

    @cached_property
    def family(self) -> Family:
        x = np.stack(list(self._projected(()).values()), axis=1)
        return Family(x.T @ x, [slice(k, k + 1) for k in range(x.shape[1])], seed=0)

    def _projected(self, names: Names) -> dict[str, np.ndarray]:
        """Further columns, without the part that a set takes up."""
        x = np.stack([np.ones(self.runs.size), *(self.columns[n] for n in names)], axis=1)
        basis = np.linalg.qr(x)[0]
        return {n: c - basis @ (basis.T @ c) for n, c in self.columns.items() if n not in names}

    def _scores(self, names: Names) -> dict[str, float]:
        left = self.fits[names].residual.ravel()
        return {n: float((c @ left) ** 2 / (c @ c)) for n, c in self._projected(names).items() if c @ c > 1e-9}

    def candidates(self, base: Line) -> dict[str, Candidate[None]]:
        return {n: Candidate(score, None) for n, score in self._scores(self.names(base)).items()}

    def begin(self, base: Line, starts: Mapping[Names, None]) -> dict[Names, Line]:
        return {names: self.fit(names) for names in starts}

    def names(self, fitted: Line) -> Names:
        return next(n for n, f in self.fits.items() if f is fitted)

    def without(self, names: Names, name: str) -> Line:
        rest = tuple(n for n in names if n != name)
        return self.fits.setdefault(rest, self.fit(rest))

    def extension_p_value(self, fitted: Line) -> float:
        scores = self._scores(self.names(fitted)).values()
        return self.family.adjusted(min((float(chi2_tail(s, 1)) for s in scores), default=1.0))

    def predicts_better(self, larger: Line, smaller: Line) -> bool:
        return larger.price < smaller.price

    def leaves_noise(self, fitted: Line) -> bool:
        """The test of lack of fit against pure error: repeats share their columns (Draper and Smith 1998, 2.1)."""
        means = [fitted.residual[self.groups == g].mean(axis=0) for g in np.unique(self.groups)]
        sizes = [int((self.groups == g).sum()) for g in np.unique(self.groups)]
        between = sum(n * float(m @ m) for n, m in zip(sizes, means, strict=True))
        free = COUNT * len(sizes) - fitted.degrees - 1
        pure = fitted.sse - between
        return f_tail((between / free) / (pure / (self.runs.size - COUNT * len(sizes))), free, self.runs.size) > 0.01


class RegressionVerdict(Verdict[Line, Weighed]):
    """Runs are held out in turn, every group staying in what is fitted; what is left is judged as the search does."""

    def weigh(self, found: SearchResult[Line]) -> Weighed:
        models, sets = self.search.models, {"": found.nominal, "+": found.best, **found.without}
        runs, groups = models.runs, models.groups
        squares, evidence = {n: [] for n in sets}, {n: Evidence(0.0, 0.0) for n in found.without}
        for out in deal(range(len(runs)), groups.tolist()):
            held = np.isin(np.arange(len(runs)), out)
            left = {n: models.left(models.names(f), held) for n, f in sets.items()}
            for n, rows in left.items():
                squares[n] += np.sum(rows**2, axis=1).tolist()
            evidence = {n: e + added_likelihood(left[n].ravel(), left["+"].ravel()) for n, e in evidence.items()}
        spread, noise = np.full(len(squares[""]), COUNT), np.full(len(squares[""]), float(COUNT))
        errors = {n: Errors(np.array(v), spread, noise) for n, v in squares.items()}
        gains = {n: held_out_gain(errors[""], errors[n], errors["+"], seed=0) for n in found.without}
        return Weighed(gains, evidence, SimpleNamespace(unexplained=not models.leaves_noise(found.best)))


def equivalents(best: Line, rivals: list[Line], fits: dict[Names, Line]) -> list[Names]:
    """Sets that a difference of `SEPARABLE` in price does not tell from the best."""
    return [n for n, f in fits.items() if any(f is r for r in rivals) and f.price < best.price + SEPARABLE]
