"""Sets of forms for the search of `infer`: fitted many at once, judged by evidence and by a simulated null."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from fes_pin.infer.family import SimulatedFamily
from fes_pin.infer.fits import Candidate, FittedSets, Names
from fes_pin.infer.levels import CERTAIN_LEVEL, CONFIDENCE_95, POSSIBLE_SIZES, STRONG_EVIDENCE, WALK_LEVEL
from fes_pin.infer.search import Policy, Search, SearchResult
from fes_pin.walk.designs import Designs
from fes_pin.walk.effect import Segment, changed_segment, is_of_a_body
from fes_pin.walk.likelihood import Fitted, fit_many
from fes_pin.workers import Progress, check_limit

SIMULATED = 100
"""Number of simulated residuals that give the distribution of the largest gain."""
SIMULATED_ROUNDS = 4
"""Alternations of weights and sizes in a fit of a simulated residual."""
FLOOR_SHARE = 0.3
"""Share of the fitted noise, in amplitude, that is simulated in addition to soft tissue."""


def simulated_nulls(designs: Designs, variance: np.ndarray) -> tuple[SimulatedFamily, dict[str, np.ndarray]]:
    """Return results of the library on residuals without a cause, in noise of this variance, (1, 6, k).

    Returns
    -------
    family : SimulatedFamily
        Family of the gains in evidence of all forms.
    spread : dict of ndarray
        For each form, (p,) root mean square of value over standard deviation: 1 if the intervals are right.
    """
    drawn = _without_a_cause(designs, variance)
    told = np.random.default_rng(designs.seed + 1).normal(size=(SIMULATED, designs.stated.air_n.size))

    def fits(names: Names, x: np.ndarray) -> list[Fitted]:
        read = told, designs.readings([names])[1]
        return fit_many(drawn, x[None], designs.plausible(names)[None], designs.noise, SIMULATED_ROUNDS, read)

    alone = [f.deviance for f in fits((), np.zeros((*variance.shape, 0)))]
    best, spread = np.full(SIMULATED, -np.inf), {}
    for name in designs.forms:
        fitted = fits((name,), designs.noise.rotated(designs.as_read.x[name]))
        best = np.maximum(best, np.subtract(alone, [f.deviance for f in fitted]))
        z = [f.values / np.sqrt(np.diag(f.covariance)) for f in fitted]
        spread[name] = np.sqrt(np.mean(np.square(z), axis=0))
    return SimulatedFamily(best), spread


def _without_a_cause(designs: Designs, variance: np.ndarray) -> np.ndarray:
    """Return simulated residuals in rotated channels: (draws, 1, 6, k).

    They are the sum of soft tissue, as errors in the coordinates, scaled in each wave to the estimated noise, of a
    share of the fitted noise, and of the ordinary errors of every session.
    """
    random = np.random.default_rng(designs.seed)
    drawn = random.normal(size=(SIMULATED, *variance.shape)) * np.sqrt(variance)
    ordinary = designs.noise.rotated(designs.in_every_session)
    always = random.normal(size=(SIMULATED, ordinary.shape[3])) @ ordinary.reshape(variance.size, -1).T
    mixed = random.normal(size=(SIMULATED, len(designs.tissue))) / np.sqrt(len(designs.tissue))
    shared = designs.noise.rotated(np.einsum("sd,djk->sjk", mixed, designs.tissue))
    waves = designs.noise.harmonics > 0
    power = np.mean(shared[..., waves] ** 2, axis=0)
    h = designs.noise.harmonics[waves]
    size = np.array([np.sqrt(variance[0][:, waves][:, h == w].sum() / power[:, h == w].sum()) for w in h])
    drawn[:, 0][..., waves] = size * shared[..., waves] + FLOOR_SHARE * drawn[:, 0][..., waves]
    return drawn + always.reshape(drawn.shape)


POLICY = Policy(beam=4, fitted=None, rivals=None)
"""Every form is fitted, so that no score test is needed."""
MOST_FOR_NOISE = 2
"""Most causes in the set from whose residual the noise is estimated."""


@dataclass(frozen=True, eq=False)
class WalkFit:
    """A set of forms with its fit.

    Attributes
    ----------
    names
        Names of the forms.
    fitted
        Their values, and the noise.
    criterion
        The deviance, infinite where a size is impossible. It includes the penalty of each parameter, as sizes are
        integrated over their priors.
    """

    names: Names
    fitted: Fitted = field(repr=False)
    criterion: float

    @property
    def sse(self) -> float:
        """The same: evidence includes the penalty."""
        return self.criterion

    @property
    def degrees(self) -> int:
        """Number of parameters."""
        return len(self.fitted.values)


class WalkModels(FittedSets[WalkFit, None]):
    """The sets of forms of one study of walking.

    Parameters
    ----------
    designs
        Design matrices of the recordings.

    Attributes
    ----------
    null
        Family of gains without a cause. None before the noise is known: the evidence alone decides then.
    spread
        Scatter of the values of forms without a cause; see `simulated_nulls`.
    limits
        For each form, the limits of its parameters: sizes that are physically possible.
    """

    acts_at_all = False  # an error of one plate or segment says nothing of another

    def __init__(self, designs: Designs) -> None:
        super().__init__()
        self.designs = designs
        self.null: SimulatedFamily | None = None
        self.spread: dict[str, np.ndarray] = {}
        self.most_candidates = MOST_FOR_NOISE
        self.limits = dict(_limits(designs))

    def with_noise_of(self, best: WalkFit) -> WalkModels:
        """Return the same sets with channels rotated for the residual of one set, and the null in its noise."""
        other = WalkModels(self.designs.turned(self.designs.residual(best.names, best.fitted.values)))
        other.null, other.spread = simulated_nulls(other.designs, other.fit(best.names).fitted.variance)
        other.most_candidates = FittedSets.most_candidates
        return other

    def nominal(self) -> WalkFit:
        """Return the fit without a form."""
        return self.fit(())

    def candidates(self, base: WalkFit) -> dict[str, Candidate[None]]:
        """Return forms of causes and sites that a set does not have: no two forms of one cause at one site."""
        forms = self.designs.forms
        taken = {forms[n].place for n in base.names}
        return {n: Candidate(0.0, None) for n, form in forms.items() if form.place not in taken}

    def begin(self, base: WalkFit, starts: Mapping[Names, None]) -> dict[Names, WalkFit]:
        """Fit sets within the limit of time, those with the same number of parameters and clock together."""

        def kind(names: Names) -> tuple[int, bool]:
            return len(self.designs.plausible(names)), self.designs.shift in names

        out: dict[Names, WalkFit] = {}
        for _, group in groupby(sorted(starts, key=kind), key=kind):
            check_limit()
            out |= {one.names: one for one in self._fit_alike(list(group))}
        return out

    def fit(self, names: Names) -> WalkFit:
        """Return the fit of a set, which is cached."""
        if names not in self.fits:
            (self.fits[names],) = self._fit_alike([names])
        return self.fits[names]

    def without(self, names: Names, name: str) -> WalkFit:
        """Return the fit of a set without one form."""
        return self.fit(tuple(n for n in names if n != name))

    def is_possible(self, fitted: WalkFit) -> bool:
        """Return whether every size of a fit is possible, and every segment that of a body."""
        return math.isfinite(fitted.criterion) and all(map(is_of_a_body, self.segments(fitted).values()))

    def segments(self, fitted: WalkFit) -> dict[str, Segment]:
        """Return the segments whose mass, centre or inertia the forms of a fit change."""
        believed = self.designs.as_read.trials[0].motion.parameters
        changed: dict[str, np.ndarray] = {}
        for name, sizes in self.sizes(fitted).items():
            if (change := self.designs.forms[name].segments) is not None:
                for segment, columns in change(believed).items():
                    changed[segment] = changed.get(segment, np.zeros(10)) + columns @ sizes
        return {n: changed_segment(believed[n], one) for n, one in changed.items()}

    def noise_p_value(self, gain: float, degrees: int) -> float:
        """Return the p-value of a gain over all forms by the simulated null; 0 before the noise is known."""
        return float(gain <= 0.0) if self.null is None else self.null.p_value(gain)

    def level(self, fitted: WalkFit) -> float:
        """Return `WALK_LEVEL`; of a single stride, which nothing held out confirms, `CERTAIN_LEVEL`."""
        return WALK_LEVEL if self.designs.strides.count > 1 else CERTAIN_LEVEL

    def is_certain(self, fitted: WalkFit, name: str) -> bool:
        """Return whether a size of a form is twice its deviation."""
        sizes, deviations = self.sizes(fitted)[name], self.deviations(fitted)[name]
        return bool(np.any(np.abs(sizes) > CONFIDENCE_95 * deviations))

    def is_distinguished(self, best: WalkFit, without: WalkFit, rival: WalkFit, lead: float) -> bool:
        """Return whether there is strong evidence against a rival."""
        return lead >= STRONG_EVIDENCE

    def near_rivals(self, found: SearchResult[WalkFit], name: str) -> list[WalkFit]:
        """Return sets with another form in the place of one that are not excluded, best first."""
        return self.equivalents(found.best, found.without[name], found.rivals[name])

    def sizes(self, one: WalkFit) -> dict[str, np.ndarray]:
        """Return values of a set's parameters by form; a shift is relative to the clock as read."""
        forms, later_s = self.designs.forms, self.designs.shifted.later_s
        return {n: v + later_s * forms[n].shifts for n, v in self._by_form(one, one.fitted.values)}

    def deviations(self, one: WalkFit) -> dict[str, np.ndarray]:
        """Return their standard deviations, widened where values scatter more in simulations of soft tissue."""
        stds = np.sqrt(np.diag(one.fitted.covariance))
        return {n: v * np.maximum(self.spread.get(n, 1.0), 1.0) for n, v in self._by_form(one, stds)}

    def _by_form(self, one: WalkFit, values: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
        ends = np.cumsum([len(self.designs.forms[n].parameters) for n in one.names])
        return zip(one.names, np.split(values, ends), strict=False)

    def _fit_alike(self, group: Sequence[Names]) -> list[WalkFit]:
        """Return fits of sets with the same number of parameters and the same clock."""
        noise, forms = self.designs.noise, self.designs.forms
        y = noise.rotated(self.designs.design(group[0]).y)
        x = np.stack([noise.rotated(self.designs.columns(names)) for names in group])
        prior = np.array([self.designs.plausible(names) for names in group]).reshape(len(group), -1)
        found = fit_many(np.broadcast_to(y, (len(group), *y.shape)), x, prior, noise, read=self.designs.readings(group))
        out = []
        for names, fitted in zip(group, found, strict=True):
            low, high = np.array([self.limits[n] for n in names for _ in forms[n].parameters]).reshape(-1, 2).T
            possible = ((low <= fitted.believed) & (fitted.believed <= high)).all()
            out.append(WalkFit(names, fitted, fitted.deviance if possible else math.inf))
        return out


WalkSearch = Search[WalkFit, WalkModels]
"""A search over sets of forms of one study."""


def searched(models: WalkModels, tell: Progress) -> tuple[WalkSearch, SearchResult[WalkFit]]:
    """Search by evidence alone, and again with the noise estimated from the residual of the best set."""
    first = WalkSearch(models, lambda share, words: tell(0.3 + 0.2 * share, words), POLICY).run()
    tell(0.5, "critical values")
    models = models.with_noise_of(first.best)
    search = WalkSearch(models, lambda share, words: tell(0.55 + 0.3 * share, words), POLICY)
    found = search.run()
    if search.was_stopped and not found.best.names:
        found = search.result(first.best.names)
    return search, found


def _limits(designs: Designs) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield forms with the limits of their parameters; a parameter that is read in the air may have any size."""
    for name, form in designs.forms.items():
        high = math.inf if form.reads else POSSIBLE_SIZES * form.plausible
        yield name, (0.0 if form.positive else -high, high)
