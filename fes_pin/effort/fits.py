"""Sets of causes of an effort as the search of `infer` fits them."""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from fes_pin.effort.columns import CauseOfEffort, Values
from fes_pin.effort.pairs import CONFOUNDED, joint_scores
from fes_pin.effort.problem import HELD_ROWS, HOLD, EffortFit, EffortProblem, Rows, own
from fes_pin.infer.distributions import chi2_tail
from fes_pin.infer.family import Family
from fes_pin.infer.fits import Candidate, FittedSets, Names
from fes_pin.infer.levels import CONFIDENCE_95, DRIVEN_LEVEL, SEPARABLE
from fes_pin.infer.maximise import alternate
from fes_pin.infer.optimum import Optimum
from fes_pin.infer.projection import Projection
from fes_pin.infer.scatter import excess_scatter, least_apart, with_honest_intervals
from fes_pin.infer.search import BEAM, FITTED
from fes_pin.models.effects import effect_named
from fes_pin.models.effects.coulomb_friction import STATED
from fes_pin.models.rigs.joint import Joint
from fes_pin.models.stage import Effect

LIMITS = {n: (one.lower, one.upper) for n, one in Joint.parameters().items()}
"""Bounds of the nominal parameters."""


Forms = Mapping[str, tuple[int, ...]]


def fit_of(
    problem: EffortProblem,
    values: Values,
    forms: Forms,
) -> EffortFit:
    """Return the fit of a problem from start values."""
    found = alternate(problem, values)
    assert problem.variances is not None
    known = {n: getattr(found, n) for n in Optimum.__dataclass_fields__}
    return EffortFit(**known, names=problem.names, forms=forms, variances=problem.variances)


def _is_off_bounds(fitted: EffortFit) -> bool:
    nothing = 0.0, -fitted.values.get(STATED, 0.0)  # of a friction that is stated
    return not any("." in n and fitted.values[n] not in nothing for n in fitted.at_bound)


def effect_of(values: Values, cause: CauseOfEffort) -> Effect:
    """Return a cause with its values as the catalogue has it, without its forms, which differ between estimators."""
    kind, forms = effect_named(cause.name).on(values), {n for one in cause.forms for n in one}
    known = {n: v for n, v in own(values, cause.name).items() if n not in forms}
    own_values: dict[str, Any] = {n: x.nearest(known[n]) for n, x in kind.parameters().items() if n in known}
    return kind(**own_values)


class EffortSets(FittedSets[EffortFit, Values]):
    """Sets of causes of one driven joint, compared by the likelihood of Student's t.

    Parameters
    ----------
    rows
        The trials.
    nominal_values
        Nominal parameters by name.
    fitted
        Those that are fitted.
    seed
        Of simulations.
    """

    def __init__(self, rows: Rows, nominal_values: Values, fitted: Sequence[str], seed: int = 0) -> None:
        super().__init__()
        self.rows, self.seed, self.takes_forms = rows, seed, False
        self._formed: set[tuple[Names, frozenset[Hashable]]] = set()
        self._plain: dict[tuple[int, bool], tuple[EffortFit, EffortFit]] = {}
        self.is_imposed = all(t.record.kind == "imposed" for t in rows.tracks)
        self.values = {**nominal_values, HOLD: HELD_ROWS * (not self.is_imposed)}
        self.base = {n: LIMITS[n] for n in fitted} | ({HOLD: (0.0, HELD_ROWS)} if self.is_imposed else {})
        self.library = rows.library

    @property
    def estimator(self) -> str:
        """How sets are fitted, in words."""
        return "least squares of the low-passed effort"

    def limits(self, names: Sequence[str], forms: Forms) -> dict[str, tuple[float, float]]:
        """Return the bounds of what is fitted of a set, by name, the nominal parameters first."""
        out = dict(self.base)
        for name in names:
            cause = self.library[name]
            out |= {f"{name}.{n}": x[:2] for n, x in cause.amplitudes.items()}
            out |= {f"{name}.{n}": x for n, x in cause.free.items()}
            for k in forms.get(name, ()):
                out |= {f"{name}.{n}": x[1:] for n, x in cause.forms[k].items()}
        return out

    def problem(
        self, names: Sequence[str], forms: Forms, robust: bool = True, kept: Sequence[np.ndarray] | None = None
    ) -> EffortProblem:
        """Return the problem of a set; see `EffortProblem`."""
        return EffortProblem(self.rows, names, self.limits(names, forms), None, robust, kept)

    def fit(self, names: Names, values: Values, forms: Forms) -> EffortFit:
        """Return the fit of a set from start values, which need not have those of the nominal model.

        A shape that ends at its bound is held where it started, if that is hardly less likely: the data do not show it.
        """
        problem, start = self.problem(names, forms), {**self.values, **values}
        found = fit_of(problem, start, forms)
        unseen = {f"{n}.{x}" for n in names for x in self.library[n].free} & {*found.at_bound}
        if not unseen:
            return found
        limits = {n: x for n, x in problem.limits.items() if n not in unseen}
        begun = {**found.values, **{n: start[n] for n in unseen}}
        held = fit_of(EffortProblem(self.rows, names, limits, problem.variances), begun, forms)
        return held if held.sse < found.sse + SEPARABLE else found

    def fitted_set(self, names: Names) -> EffortFit:
        """Return the fit of a set; of one that no search fitted, from the best of its subsets, a cause at a time."""
        while names not in self.fits:
            base = min((k for k in self.fits if {*k} < {*names}), key=self._by)
            known = {n: c for n, c in self.candidates(self.fits[base]).items() if n in names}
            start = max(known, key=lambda n: known[n].gain, default=None)
            more = start or next(n for n in names if n not in base)
            begun = known[more].start if start else self._tried[more][0]
            larger = tuple(sorted((*base, more)))
            self.fits |= self.begin(self.fits[base], {larger: begun})
        return self.fits[names]

    def nominal(self) -> EffortFit:
        """Fit the nominal model, and simulate the family of score tests of all candidates in it."""
        self.fits[()] = self.fit((), {}, {})
        self.family = self._family(self.fits[()])
        return self.fits[()]

    def first(self) -> Names:
        """Return the best two causes if both are likelier than any one, and each is significant given the other.

        Friction and an offset of its size oppose each other in half of all motion, and friction and drag bend a torque
        to opposite sides: one without the other leaves an error that a wrong cause takes up.
        """
        self.extend((), FITTED)
        self.fits |= self.begin(self.fits[()], self._likeliest_pairs(BEAM))
        if not self.ranked(2):
            return ()
        best, pair = (self.fits[self.ranked(size)[0]] for size in (1, 2))
        given = (self.p_value(pair, self.without(pair.names, n)) for n in pair.names)
        is_better = pair.criterion < best.criterion and all(p < self.level(pair) for p in given)
        return pair.names if is_better and self.is_possible(pair) else ()

    def _likeliest_pairs(self, count: int) -> dict[Names, dict[str, float]]:
        """Return the start values of the sets of two causes of largest joint score within their bounds."""
        base, out = self.fits[()], dict[Names, dict[str, float]]()
        projection, places = Projection(base.parts), [(n, tried) for n, many in self._tried.items() for tried in many]
        each = [columns for n in self._tried for columns in self._whitened(base, n)]
        squares = [float(np.sum(one**2)) for one in each]
        found = joint_scores(projection.residual, [projection(one) for one in each], squares)
        for pair in sorted(found, key=lambda one: -one.gain):
            both = {places[k][0]: (places[k][1], sizes) for k, sizes in zip(pair[:2], pair.sizes, strict=True)}
            if len(both) > 1 and all(self._is_within(n, sizes) for n, (_, sizes) in both.items()):
                starts = ({**tried, **self._sized(n, sizes)} for n, (tried, sizes) in both.items())
                out.setdefault(tuple(sorted(both)), dict(ChainMap(*starts)))
            if len(out) == count:
                break
        return out

    def _sized(self, name: str, sizes: Iterable[float]) -> dict[str, float]:
        """Return the amplitudes of a cause by their full names."""
        return dict(zip((f"{name}.{n}" for n in self.library[name].amplitudes), map(float, sizes), strict=True))

    def _is_within(self, name: str, sizes: Iterable[float]) -> bool:
        """Return whether the amplitudes of a cause are within their bounds."""
        limits = self.library[name].amplitudes.values()
        return all(low < v < high for v, (low, high, _) in zip(sizes, limits, strict=True))

    @cached_property
    def _tried(self) -> dict[str, list[dict[str, float]]]:
        """The values of each cause at which it is tried, by its name."""
        out: dict[str, list[dict[str, float]]] = {}
        for name, cause in self.library.items():
            sizes = {n: x[2] for n, x in cause.amplitudes.items()}
            out[name] = [{f"{name}.{n}": v for n, v in {**sizes, **shape}.items()} for shape in cause.shapes]
        return out

    def _slopes(self, base: EffortFit, cause: CauseOfEffort, tried: Values) -> list[np.ndarray]:
        """Return the change of each trial's prediction by the amplitudes of a cause, at values that are tried."""
        values, names = {**base.values, **tried}, (*base.names, cause.name)
        amplitudes = [f"{cause.name}.{n}" for n in cause.amplitudes]
        if cause.torques is not None:
            gain = 1.0 + base.values.get("effort_gain.error", 0.0)
            columns = self.rows.columns(values, names, cause.name)
            return [np.stack([one[n] for n in amplitudes], axis=1) / gain for one in columns]
        without, _ = self.problem(base.names, base.forms).residuals(base.values)
        there, _ = self.problem(names, base.forms).residuals(values)
        (size,) = (tried[n] for n in amplitudes)
        return [((a - b) / size)[:, None] for a, b in zip(without, there, strict=True)]

    def roots(self, fitted: EffortFit) -> list[np.ndarray]:
        """Return the roots of the weights of each trial's rows in a fit."""
        problem = self.problem(fitted.names, fitted.forms)
        left, _ = problem.residuals(fitted.values)
        return [problem.roots(k, one, fitted.variances)[0] for k, one in enumerate(left)]

    def _whitened(self, base: EffortFit, name: str) -> list[np.ndarray]:
        """Return the columns of a candidate at each place where it is tried, whitened, shape (m, amplitudes)."""
        cause, roots = self.library[name], self.roots(base)
        each = [self._slopes(base, cause, tried) for tried in self._tried[name]]
        return [np.concatenate([s * r[:, None] for s, r in zip(one, roots, strict=True)]) for one in each]

    def candidates(self, base: EffortFit) -> Mapping[str, Candidate[Values]]:
        """Return the causes that a set lacks, with the gain of their score and the place where that is largest."""
        projection, out = Projection(base.parts), dict[str, Candidate[Values]]()
        for name in (n for n in self.library if n not in base.names):
            best: tuple[float, dict[str, float]] | None = None
            for tried, columns in zip(self._tried[name], self._whitened(base, name), strict=True):
                gain, sizes = _score(projection, columns)
                limits = list(self.library[name].amplitudes.values())
                sizes = [min(max(s, x[0]), x[1]) for s, x in zip(sizes, limits, strict=True)]
                if any(sizes) and (best is None or gain > best[0]):
                    best = gain, {**tried, **self._sized(name, sizes)}
            if best is not None:
                out[name] = Candidate(best[0], best[1])
        return out

    def _family(self, base: EffortFit) -> Family:
        """Return the family of all candidates, at each place where they are tried."""
        projection, many, blocks = Projection(base.parts), [], list[slice]()
        for name in self.library:
            for columns in self._whitened(base, name):
                start = blocks[-1].stop if blocks else 0
                blocks.append(slice(start, start + columns.shape[1]))
                many.append(projection(columns))
        left = np.concatenate(many, axis=1)
        return Family(left.T @ left, blocks, self.seed)

    def begin(self, base: EffortFit, starts: Mapping[Names, Values]) -> Mapping[Names, EffortFit]:
        """Return fits of sets that extend a base."""
        return {names: self.fit(names, {**base.values, **start}, base.forms) for names, start in starts.items()}

    def form_of(self, fitted: EffortFit) -> frozenset[Hashable]:
        """Return the forms of the causes in a fit."""
        return frozenset((n, k) for n, many in fitted.forms.items() for k in many)

    def without(self, names: Names, name: str) -> EffortFit:
        """Return the fit of a set without one cause, in the forms that the others have in it, or in better ones.

        A cause must gain more than a further form of the others does: a spring that hardens looks like a second cause.
        """
        whole, rest = self.fits[names], tuple(n for n in names if n != name)
        forms = {n: k for n, k in whole.forms.items() if n != name}
        if rest not in self.fits or dict(self.fits[rest].forms) != forms:
            less = self.fit(rest, {n: v for n, v in whole.values.items() if not n.startswith(f"{name}.")}, forms)
            known = self.fits.get(rest)
            if known is None or less.criterion < known.criterion:
                self.fits[rest] = less
        while (key := (rest, self.form_of(self.fits[rest]))) not in self._formed:
            self._formed.add(key)
            self.fits[rest] = self.better_form(self.fits[rest]) or self.fits[rest]
        return self.fits[rest]

    def is_possible(self, fitted: EffortFit) -> bool:
        """Return whether every size of a cause is off its bounds, and one that these trials can identify.

        So must be its final shapes: one that every row draws to its bound takes the place of another cause.
        """
        has_shapes = any(self.library[n].free for n in fitted.names)
        if not _is_off_bounds(fitted) or (has_shapes and not _is_off_bounds(self.final(fitted))):
            return False
        effects = [effect_of(fitted.values, self.library[n]) for n in fitted.names]
        each = ((e, n, size) for e in effects for n, size in e.smallest(self.measured).items())
        return not any(0.0 < abs(getattr(e, n)) < size for e, n, size in each)

    @cached_property
    def measured(self) -> dict[str, np.ndarray]:
        """Columns of the trials, end to end, as `identify.problem.measured_columns` has them."""
        records = [t.record for t in self.rows.tracks]
        each = {"time": [r.time for r in records], "position": [r.reading for r in records]}
        return {n: np.concatenate(v) for n, v in {**each, "effort": [r.effort for r in records]}.items()}

    def is_a_model(self, fitted: EffortFit) -> bool:
        """Return whether every nominal parameter is off its bounds, but for a damping of 0."""
        return not any("." not in n and n != HOLD and fitted.values[n] != 0.0 for n in fitted.at_bound)

    def is_certain(self, fitted: EffortFit, name: str) -> bool:
        """Return whether an amplitude of a cause, or its product with a shape, is twice its deviation.

        A spring whose stiffness is confounded with gravity may still have a certain torque at its rest angle's zero.
        """
        honest, info = with_honest_intervals(fitted), effect_named(name).parameters()
        slopes = [{f"{name}.{n}": 1.0} for n in self.library[name].amplitudes]
        products = ((f"{name}.{n}", f"{name}.{one.times}") for n, one in info.items() if one.times)
        slopes += [{a: fitted.values[b], b: fitted.values[a]} for a, b in products if a in fitted.free]
        for slope in slopes:
            at, by = [fitted.place(n) for n in slope], np.array([*slope.values()])
            size = math.prod(fitted.values[n] for n in slope)
            if abs(size) > CONFIDENCE_95 * math.sqrt(max(float(by @ honest.covariance[np.ix_(at, at)] @ by), 0.0)):
                return True
        return False

    def is_distinguished(self, best: EffortFit, without: EffortFit, rival: EffortFit, lead: float) -> bool:
        """See `infer.scatter.least_apart`; the noise of neighbouring rows is alike, as the excess scatter says."""
        excess = self.excess_scatter(best, without)
        return lead / excess >= least_apart(_tempered(best, excess), _tempered(rival, excess))

    def converge_rivals(self, names: Names, name: str) -> None:
        """Fit the nearest sets that have another cause in the place of one in the forms of the best set."""
        whole, rest = self.fits[names], tuple(n for n in names if n != name)
        forms = {n: k for n, k in whole.forms.items() if n in rest}
        rivals = sorted((k for k in self.fits if len(k) == len(names) and {*rest} < {*k} and k != names), key=self._by)
        for rival in rivals[:FITTED]:
            known = self.fits[rival]
            if any(known.forms.get(n, ()) != k for n, k in forms.items()):
                shared = {n: v for n, v in whole.values.items() if n.partition(".")[0] in rest}
                again = self.fit(rival, {**known.values, **shared}, {**known.forms, **forms})
                if again.criterion < known.criterion:
                    self.fits[rival] = again

    def _by(self, names: Names) -> float:
        return self.fits[names].criterion

    def excess_scatter(self, larger: EffortFit, smaller: EffortFit) -> float:
        """See `infer.scatter.excess_scatter`; once every cause was tried, the residual is a noise that may be slow."""
        return excess_scatter(larger, smaller, is_slow=self.takes_forms)

    def extension_p_value(self, fitted: EffortFit) -> float:
        """Return the family-wise p-value of the best score of a further candidate."""
        if not self.has_room(fitted.names):
            return 0.0
        known = self.candidates(fitted)
        single = [float(chi2_tail(c.gain, len(self.library[n].amplitudes))) for n, c in known.items()]
        return self.family.adjusted(min(single, default=1.0))

    def level(self, fitted: EffortFit) -> float:
        """Return the level of a claim where a random torque may act."""
        return DRIVEN_LEVEL

    def leaves_noise(self, fitted: EffortFit) -> bool:
        """Return False: a further cause need not lower an error that is of the fitted rows."""
        return False

    def better_form(self, fitted: EffortFit) -> EffortFit | None:
        """Return the set with a further form of one of its causes that is significant; None before all were tried."""
        if not self.takes_forms:
            return None
        tried = [self._in_form(fitted, n, k, own) for n, k, own in self._further_forms(fitted)]
        better = (f for f in tried if self.is_possible(f) and self.p_value(f, fitted) < self.level(f))
        return min(better, key=lambda f: f.criterion, default=None)

    def _further_forms(self, fitted: EffortFit) -> Iterator[tuple[str, int, tuple[int, ...]]]:
        """Return a cause, a form that it lacks, and all its forms then: with those that it has, and in their place."""
        for name in fitted.names:
            has = fitted.forms.get(name, ())
            for k in range(len(self.library[name].forms)):
                if k not in has:
                    yield name, k, (*has, k)
                    if has:
                        yield name, k, (k,)

    def _in_form(self, fitted: EffortFit, name: str, k: int, own: tuple[int, ...]) -> EffortFit:
        forms = self.library[name].forms
        nulls = {n for j, one in enumerate(forms) if j not in own for n in one}
        start = {n: self.library[name].shapes[0][n] for n in nulls} | {n: x[0] for n, x in forms[k].items()}
        values = {**fitted.values, **{f"{name}.{n}": v for n, v in start.items()}}
        return self.fit(fitted.names, values, {**fitted.forms, name: tuple(sorted(own))})

    def begin_again(self, names: Names) -> bool:
        """Take forms of causes in, and return whether the set has a better one.

        Forms are not tried before further causes were: a flexible friction takes the place of quadratic damping.
        """
        if self.takes_forms:
            return False
        self.takes_forms = True
        better = self.better_form(self.fits[names])
        if better is not None:
            self.fits[names] = better
        return better is not None

    def final(self, fitted: EffortFit, kept: Sequence[np.ndarray] | None = None) -> EffortFit:
        """Return a set by plain least squares, from a fit of it, to all rows or to some."""
        key = id(fitted), HOLD in self.base
        if kept is None and key in self._plain:
            return self._plain[key][1]
        problem = self.problem(fitted.names, fitted.forms, robust=False, kept=kept)
        found = fit_of(problem, fitted.values, fitted.forms)
        if kept is None:
            self._plain[key] = fitted, found  # held as long as it is known, so that no other has its id
        return found


def _tempered(fitted: EffortFit, excess: float) -> EffortFit:
    """Return a fit with its log-likelihood divided by an excess of scatter."""
    parts = [replace(p, residual=p.residual / math.sqrt(excess)) for p in fitted.parts]
    return replace(fitted, parts=parts, sse=fitted.sse / excess)


def _score(projection: Projection, columns: np.ndarray) -> tuple[float, list[float]]:
    """Return the gain of the score of columns, and the sizes of a step; no gain where they are confounded."""
    left = projection(columns)
    gram, slope = left.T @ left, left.T @ projection.residual
    if not np.trace(gram) > CONFOUNDED * float(np.sum(columns**2)):
        return 0.0, [0.0] * columns.shape[1]
    sizes = np.linalg.lstsq(gram, slope, rcond=1e-9)[0]
    return float(slope @ sizes), [float(x) for x in sizes]
