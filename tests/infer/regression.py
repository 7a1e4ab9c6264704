"""A front end of inference that knows no rig: linear regression of repeated runs, with candidate columns and groups."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from types import SimpleNamespace

import numpy as np

from fes_pin.infer.covariance import covariance_of
from fes_pin.infer.distributions import chi2_tail, f_tail
from fes_pin.infer.family import Family
from fes_pin.infer.fits import Candidate, FittedSets, Names
from fes_pin.infer.held_out import Errors, added_likelihood, deal, held_out_gain
from fes_pin.infer.keys import Key
from fes_pin.infer.optimum import Optimum
from fes_pin.infer.problem import Linearized, normal_equations, whitened_sse
from fes_pin.infer.projection import Projection
from fes_pin.infer.result import Evidence
from fes_pin.infer.search import SearchResult
from fes_pin.infer.verdict import Verdict, Weighed

COUNT = 60
"""Samples of a run."""


class Regression(FittedSets[Optimum, None]):
    """Sets of columns fitted to runs that are repeats of each other, or of their group.

    Parameters
    ----------
    columns
        Candidates by name, each of shape (COUNT,).
    runs
        What was measured, shape (runs, COUNT), noise of unit variance.
    groups
        Of each run, 0 or 1: a column by the name `name:1` acts in the runs of group 1 alone.
    """

    def __init__(self, columns: dict[str, np.ndarray], runs: np.ndarray, groups: np.ndarray | None = None) -> None:
        super().__init__()
        count = len(runs)
        self.runs, self.groups = runs, np.zeros(count, int) if groups is None else groups
        self.columns = {n: np.tile(c, count) for n, c in columns.items()}
        if groups is not None:
            in_group = np.repeat(groups == 1, COUNT)
            self.columns |= {str(Key(n, group="1")): np.tile(c, count) * in_group for n, c in columns.items()}

    def part(self, names: Names, runs: slice | np.ndarray = slice(None)) -> Linearized:
        """Some runs as one trial, with their mean as its own unknown."""
        rows = np.arange(self.runs.size).reshape(self.runs.shape)[runs].ravel()
        x = np.stack([self.columns[n] for n in names], axis=1) if names else np.zeros((self.runs.size, 0))
        return Linearized(self.runs.ravel()[rows], x[rows], np.ones((len(rows), 1)))

    def fit(self, names: Names, runs: slice | np.ndarray = slice(None)) -> Optimum:
        part = self.part(names, runs)
        system = normal_equations([part])
        values = np.linalg.solve(system.hessian, system.gradient)
        (mean,) = system.local_steps(values)[0]
        left = replace(part, residual=part.residual - part.jacobian @ values - mean)
        return Optimum(
            free=names,
            parameters=dict(zip(names, values.tolist(), strict=True)),
            covariance=covariance_of(system.hessian, np.ones(len(names), bool)),
            at_bound=(),
            sse=whitened_sse([left]),
            converged=True,
            gradient_norm=0.0,
            unknowns=[{"mean": float(mean)}],
            parts=[left],
        )

    def left(self, names: Names, held: np.ndarray) -> np.ndarray:
        """What runs that are held out leave of a set that is fitted to the others."""
        fitted, part = self.fit(names, ~held), self.part(names, held)
        values, mean = np.array([fitted.parameters[n] for n in names]), fitted.unknowns[0]["mean"]
        return (part.residual - part.jacobian @ values - mean).reshape(-1, COUNT)

    def nominal(self) -> Optimum:
        self.fits[()] = self.fit(())
        return self.fits[()]

    @cached_property
    def family(self) -> Family:
        left, _ = self._left_of_others(self.fit(()))
        gram = left.T @ left
        return Family(gram, [slice(k, k + 1) for k in range(len(gram))], seed=0)

    def _left_of_others(self, base: Optimum) -> tuple[np.ndarray, np.ndarray]:
        """The columns that a set lacks, and its residual, with its parameters projected off."""
        projection = Projection(base.parts)
        others = [c[:, None] for n, c in self.columns.items() if n not in base.free]
        return projection(np.concatenate(others, axis=1)), projection.residual

    def _scores(self, base: Optimum) -> dict[str, float]:
        (left, residual), others = self._left_of_others(base), [n for n in self.columns if n not in base.free]
        powers = np.sum(left**2, axis=0)
        return {n: float(g**2 / p) for n, g, p in zip(others, residual @ left, powers, strict=True) if p > 1e-9}

    def candidates(self, base: Optimum) -> dict[str, Candidate[None]]:
        return {n: Candidate(score, None) for n, score in self._scores(base).items()}

    def begin(self, base: Optimum, starts: Mapping[Names, None]) -> dict[Names, Optimum]:
        return {names: self.fit(names) for names in starts}

    def without(self, names: Names, name: str) -> Optimum:
        rest = tuple(n for n in names if n != name)
        return self.fits.setdefault(rest, self.fit(rest))

    def extension_p_value(self, fitted: Optimum) -> float:
        scores = self._scores(fitted).values()
        return self.family.adjusted(min((float(chi2_tail(s, 1)) for s in scores), default=1.0))

    def predicts_better(self, larger: Optimum, smaller: Optimum) -> bool:
        return larger.criterion < smaller.criterion

    def leaves_noise(self, fitted: Optimum) -> bool:
        """The test of lack of fit against pure error: repeats share their columns (Draper and Smith 1998, 2.1)."""
        left = fitted.parts[0].residual.reshape(self.runs.shape)
        means = [left[self.groups == g].mean(axis=0) for g in np.unique(self.groups)]
        sizes = [int((self.groups == g).sum()) for g in np.unique(self.groups)]
        between = sum(n * float(m @ m) for n, m in zip(sizes, means, strict=True))
        free = COUNT * len(sizes) - fitted.degrees - 1
        pure = fitted.sse - between
        return f_tail((between / free) / (pure / (self.runs.size - COUNT * len(sizes))), free, self.runs.size) > 0.01


class RegressionVerdict(Verdict[Optimum, Regression, Weighed]):
    """Runs are held out in turn, every group staying in what is fitted; what is left is judged as the search does."""

    def weigh(self, found: SearchResult[Optimum]) -> Weighed:
        models, sets = self.search.models, {"": found.nominal, "+": found.best, **found.without}
        runs, groups = models.runs, models.groups
        squares, evidence = {n: [] for n in sets}, {n: Evidence(0.0, 0.0) for n in found.without}
        for out in deal(range(len(runs)), groups.tolist()):
            held = np.isin(np.arange(len(runs)), out)
            left = {n: models.left(f.free, held) for n, f in sets.items()}
            for n, rows in left.items():
                squares[n] += np.sum(rows**2, axis=1).tolist()
            for n, e in evidence.items():
                more = added_likelihood(left[n].ravel(), left["+"].ravel())
                evidence[n] = Evidence(e.added + more.added, e.squares + more.squares)
        spread, noise = np.full(len(squares[""]), COUNT), np.full(len(squares[""]), float(COUNT))
        errors = {n: Errors(np.array(v), spread, noise) for n, v in squares.items()}
        gains = {n: held_out_gain(errors[""], errors[n], errors["+"], seed=0) for n in found.without}
        return Weighed(gains, evidence, SimpleNamespace(unexplained=not models.leaves_noise(found.best)))
