"""When a set of causes earns its place, and when it leaves only noise."""

from __future__ import annotations

from fes_pin.diagnosis.remainder.open_set import smooth_remainder
from fes_pin.diagnosis.search.cause_sets import Names
from fes_pin.diagnosis.search.score import Scores
from fes_pin.diagnosis.search.simulation_fits import SimulationFits
from fes_pin.diagnosis.search.starts import forms_beside
from fes_pin.identify.fit import Fit, go_on, noise_of, rough_noise
from fes_pin.identify.problem import Problem
from fes_pin.infer.distributions import chi2_tail
from fes_pin.infer.family import coherence_p_value
from fes_pin.infer.levels import CERTAIN_GAIN, CLAIM_LEVEL, SMALL_SHARE, UNUSUAL_LEVEL
from fes_pin.models.model import Model
from fes_pin.workers import in_parallel

FORM_SHARE = 0.0625
"""A further cause must explain at least this share of what all causes do: a real cause differs from its equation, and
an error of a quarter in its form leaves a sixteenth of its likelihood to whatever else comes near."""


class Claims:
    """Judges sets of causes of a search, each fit once.

    Parameters
    ----------
    sets
        The fits.
    scores
        Of the nominal model: the family of tests.
    seed
        Of simulated critical values.
    """

    def __init__(self, sets: SimulationFits, scores: Scores, seed: int) -> None:
        self.sets, self.family, self.seed = sets, scores.family(seed), seed
        self._complete: dict[int, tuple[Fit, bool]] = {}
        self._p_values: dict[tuple[int, int], tuple[Fit, Fit, float]] = {}

    def complete(self, names: Names) -> bool:
        """True if a set leaves only noise: no further cause has a score, and neither do smooth features.

        The score is judged by the present noise; noise learned from the set itself can swallow a slow cause.
        """
        fitted = self.sets.fits[names]
        if id(fitted) not in self._complete:
            self._complete[id(fitted)] = (fitted, self._leaves_noise(fitted))
        return self._complete[id(fitted)][1]

    def _leaves_noise(self, fitted: Fit) -> bool:
        if slow_misfit(fitted):
            return False
        score = max(s.gain for s in self.sets.scores(fitted).scored)
        if score > max(CERTAIN_GAIN, FORM_SHARE * (self.sets.fits[()].sse - fitted.sse)):
            return False
        return not smooth_remainder(_again(fitted, fitted), self.seed).unexplained

    def worth_extending(self, size: int, left: float) -> bool:
        """True unless both the score of a further cause and the smooth features call the best smaller set complete."""
        best, none = self.sets.fits[self.sets.ranked(size - 1)[0]], self.sets.fits[()]
        gain = best.sse - left
        if gain > 0.5 * FORM_SHARE * (none.sse - best.sse) and self.family.p_value(gain, 1) < UNUSUAL_LEVEL:
            return True
        return smooth_remainder(best, self.seed).p_value < UNUSUAL_LEVEL

    def better(self, names: Names, best: Names) -> bool:
        """True if a larger set can be, and earns its place beside the best smaller one."""
        if self.sets.is_absurd(self.sets.fits[names]) or self.share(names, best) < FORM_SHARE:
            return False
        return self.p_value(self.sets.fits[names], self.sets.fits[best]) < CLAIM_LEVEL

    def earns(self, larger: Fit, smaller: Fit, gain: float, explained: float) -> bool:
        """The same of a gain in likelihood alone, of what all causes explain."""
        degrees = max(larger.degrees - smaller.degrees, 1)
        return gain >= FORM_SHARE * explained and self.family.p_value(gain, degrees) < CLAIM_LEVEL

    def share(self, names: Names, best: Names) -> float:
        """Share of what a larger set explains that a smaller one does not, of the likelihood or of the plain errors.

        An error of form leaves little of either; but under slow noise a fast cause has nearly all the likelihood, and
        beside a slow cause nearly none of the errors.
        """
        larger, smaller, none = (self.sets.fits[n] for n in (names, best, ()))
        explained = [none.sse - larger.sse, none.plain - larger.plain]
        added = [smaller.sse - larger.sse, smaller.plain - larger.plain]
        return max((a / e for a, e in zip(added, explained, strict=True) if e > 0.0), default=0.0)

    def p_value(self, larger: Fit, smaller: Fit) -> float:
        """Family-wise p-value of what a larger model adds.

        It must be significant under the present noise, and either under the noise that the smaller model leaves (which
        can swallow a slow cause) or against the spread between trials (which no noise model enters).
        """
        key = (id(larger), id(smaller))
        if key not in self._p_values:
            self._p_values[key] = (larger, smaller, self._p_value(larger, smaller))
        return self._p_values[key][2]

    def _p_value(self, larger: Fit, smaller: Fit) -> float:
        degrees = max(larger.degrees - smaller.degrees, 1)
        gain = smaller.sse - larger.sse
        p_value = self.family.p_value(gain, degrees)
        few, many = ([p.residual for p in one.parts] for one in (smaller, larger))
        coherent = self.family.adjusted(coherence_p_value(few, many, gain, degrees))
        if coherent < p_value or p_value >= CLAIM_LEVEL:
            return p_value
        less, more = in_parallel(lambda one: _again(one, smaller), (smaller, larger))
        return max(p_value, min(coherent, self.family.p_value(less.sse - more.sse, degrees)))

    def demanded(self, refined: Fit, base: Fit) -> bool:
        """True if the data demand a refinement of an effect's form."""
        degrees = max(refined.degrees - base.degrees, 1)
        p_value = float(chi2_tail(base.sse - refined.sse, degrees))
        return p_value * forms_beside(base.model, base.model.effects) < CLAIM_LEVEL


def slow_misfit(fitted: Fit) -> bool:
    """True if the noise from sample to sample is so small beside a residual that this cannot be told from misfit.

    First-order autoregressive noise is 3.8 times its sample-to-sample part at a coefficient of 0.9, 5.5 at 0.95, 12 at
    0.99; 270 studies without a cause, of three rigs in three kinds of noise, have 8.3 at most:
    `scripts/benchmarks/adequate.py --count 30`.
    """
    return SMALL_SHARE * slowness(fitted) > 1.0


def slowness(fitted: Fit) -> float:
    """Largest ratio of a channel's residual to the noise from sample to sample of its reading."""
    rough, own = rough_noise(Model(fitted.model.rig), fitted.trials), noise_of(fitted)
    return max((own[n].std / rough[n].std for n in own), default=0.0)


def _again(fitted: Fit, noise_from: Fit) -> Fit:
    """The same model fitted under the noise that another leaves."""
    return go_on(Problem(fitted.model, fitted.trials, noise_of(noise_from)), fitted)
