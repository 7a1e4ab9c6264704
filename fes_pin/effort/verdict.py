"""The verdict on causes of an effort: parts of the data that are held out, and tests of lack of fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fes_pin.effort.fits import EffortSets
from fes_pin.effort.problem import EffortFit
from fes_pin.infer.distributions import f_tail
from fes_pin.infer.held_out import FOLDS, Errors, added_likelihood, deal, held_out_gain, identified_folds
from fes_pin.infer.levels import CLAIM_LEVEL
from fes_pin.infer.projection import Projection
from fes_pin.infer.result import Evidence, Remainder
from fes_pin.infer.scatter import scores_of
from fes_pin.infer.search import Search, SearchResult
from fes_pin.infer.verdict import State, Verdict, Weighed

PARTS = 4
"""Parts of a trial that are held out by themselves where there are fewer trials than `FOLDS`."""
PLACES = 7
"""Places of the hat functions by which a residual is tested for a dependence on a variable."""
KEPT_OF = 1e-3
"""Share of a hat function, and of the largest direction of all, that the fitted parameters must leave."""

EffortSearch = Search[EffortFit, EffortSets]
EffortState = State[EffortFit, EffortSets, Weighed]


def units_of(lengths: Sequence[int]) -> list[np.ndarray]:
    """Return the unit of evidence of each row of each trial: a trial, or a quarter of one where there are few."""
    parts = 1 if len(lengths) >= FOLDS else PARTS
    return [parts * k + (parts * np.arange(n)) // n for k, n in enumerate(lengths)]


class EffortVerdict(Verdict[EffortFit, EffortSets, Weighed]):
    """The verdict: each cause must predict the effort of parts that were held out."""

    def __init__(self, search: EffortSearch) -> None:
        super().__init__(search)
        self.units = units_of(search.models.rows.lengths)
        count = int(self.units[-1][-1]) + 1
        self.folds = [np.isin(np.arange(count), out) for out in deal(range(count))]
        self._left: dict[tuple[object, ...], list[np.ndarray]] = {}

    def refits(self, fitted: EffortFit) -> list[EffortFit]:
        """Return plain fits of a set to all rows but those of each fold."""
        final = self.search.models.final
        return [final(fitted, [~fold[one] for one in self.units]) for fold in self.folds]

    def predicted(self, best: EffortFit) -> np.ndarray:
        """Return which units are in a fold that counts, shape (units,) of bool; see `identified_folds`."""
        pieces = [
            replace(part, residual=part.residual[rows], jacobian=part.jacobian[rows], local=part.local[rows])
            for part, one in zip(best.parts, self.units, strict=True)
            for rows in (one == unit for unit in np.unique(one))
        ]
        folds = identified_folds(best, pieces, [np.flatnonzero(fold).tolist() for fold in self.folds])
        return np.isin(np.arange(len(pieces)), [k for out in folds for k in out])

    def left(self, fitted: EffortFit) -> list[np.ndarray]:
        """Return the residual of the effort of each trial by fits without the part of a row."""
        key = (fitted.names, *sorted(fitted.forms.items()))
        if key not in self._left:
            out = [np.zeros(len(one)) for one in self.units]
            for fold, again in zip(self.folds, self.refits(fitted), strict=True):
                problem = self.search.models.problem(again.names, again.forms)
                for one, mine, unit in zip(out, problem.residuals(again.values)[0], self.units, strict=True):
                    one[fold[unit]] = mine[fold[unit]]
            self._left[key] = out
        return self._left[key]

    def weigh(self, found: SearchResult[EffortFit]) -> Weighed:
        """Return gains of causes in the low-passed effort of parts that are held out, and the lack of fit."""
        best = found.best
        remainder = lack_of_fit(self.search.models, best)
        if not best.names:
            return Weighed({}, {}, remainder)
        sets = {"": found.nominal, "+": best, **found.without}
        units = self.predicted(best)
        left = {n: self._whitened(self._residual(f, units), best, units) for n, f in sets.items()}
        errors = {n: self._errors(one, units) for n, one in left.items()}
        gains = {n: held_out_gain(errors[""], errors[n], errors["+"], self.search.models.seed) for n in found.without}
        evidence = {}
        for name, less in found.without.items():
            added = added_likelihood(left[name], left["+"])
            scatter = self.search.models.excess_scatter(best, less)
            evidence[name] = Evidence(added.added / scatter, added.squares / scatter)
        return Weighed(gains, evidence, remainder, is_robust=True)

    def errors_of(self, fitted: EffortFit, best: EffortFit) -> Errors:
        """Return squared errors of the low-passed effort by fits without the part of a row, at the weights of a set."""
        units, efforts = self.predicted(best), self.search.models.rows.efforts(fitted.values)
        errors = self._errors(self._whitened(self._residual(fitted, units), best, units), units)
        spread = self._errors(self._whitened([u - u.mean() for u in efforts], best, units), units)
        return replace(errors, spread=spread.squares)

    def _residual(self, fitted: EffortFit, units: np.ndarray) -> list[np.ndarray]:
        """Return the residual by fits without the part of a row; that of the fit itself where no part is predicted."""
        if units.any():
            return self.left(fitted)
        return self.search.models.problem(fitted.names, fitted.forms).residuals(fitted.values)[0]

    def _whitened(self, efforts: Sequence[np.ndarray], best: EffortFit, units: np.ndarray) -> np.ndarray:
        """Return rows at the weights of a set, end to end: of some units, or of all where these are none."""
        roots = self.search.models.roots(best)
        rows = np.concatenate([one * w for one, w in zip(efforts, roots, strict=True)])
        return np.asarray(rows[self._rows_of(units)])

    def _rows_of(self, units: np.ndarray) -> np.ndarray:
        return np.asarray((units | ~units.any())[np.concatenate(self.units)])

    def _errors(self, left: np.ndarray, units: np.ndarray) -> Errors:
        """Return squared errors by units of evidence; the spread is that of the effort's noise."""
        _, unit = np.unique(np.concatenate(self.units)[self._rows_of(units)], return_inverse=True)
        count = np.bincount(unit).astype(float)
        return Errors(np.bincount(unit, left**2), count, count)


def lack_of_fit(sets: EffortSets, fitted: EffortFit) -> Remainder:
    """Return whether the residual depends on position, speed or time, by robust score tests of hat functions.

    The scores of pieces of the data scatter about their mean as Hotelling's T^2 has it, whatever the noise.
    """
    tracks = sets.rows.tracks
    variables = {
        "position": [t.q[t.rows] for t in tracks],
        "velocity": [t.v[t.rows] for t in tracks],
        "time": [t.time[t.rows] / sets.rows.sizes.seconds for t in tracks],
    }
    found = {name: _depends(fitted, np.concatenate(many)) for name, many in variables.items()}
    where = min(found, key=lambda n: found[n])
    p = min(1.0, len(found) * found[where])
    return Remainder(p < CLAIM_LEVEL, p, where if p < CLAIM_LEVEL else None, CLAIM_LEVEL)


def _depends(fitted: EffortFit, variable: np.ndarray) -> float:
    """Return the p-value of a dependence of the residual on a variable of each row, shape (m,)."""
    projection = Projection(fitted.parts)
    places = np.unique(np.quantile(variable, np.linspace(0.0, 1.0, PLACES)))
    hats = np.stack([np.interp(variable, places, row) for row in np.eye(len(places))], axis=1)
    left = projection(hats)
    keep = np.sum(left**2, axis=0) > KEPT_OF * np.sum(hats**2, axis=0)
    if not keep.any():
        return 1.0
    basis, sizes, _ = np.linalg.svd(left[:, keep], full_matrices=False)
    basis = basis[:, sizes > KEPT_OF * sizes[0]]
    ends = np.cumsum([len(p.residual) for p in fitted.parts])[:-1]
    parts = [replace(p, jacobian=b) for p, b in zip(fitted.parts, np.split(basis, ends), strict=True)]
    scores = scores_of(parts)
    pieces, k = scores.shape
    whole = scores.sum(axis=0)
    about = scores - scores.mean(axis=0)
    spread = about.T @ about * pieces / (pieces - 1.0)
    square = float(whole @ np.linalg.lstsq(spread, whole, rcond=1e-9)[0])
    return f_tail(square * (pieces - k) / (k * (pieces - 1.0)), k, pieces - k) if pieces > k else 1.0
