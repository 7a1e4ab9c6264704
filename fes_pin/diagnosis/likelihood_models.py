"""Sets of causes of one study for the search of `infer`: fits by the likelihood, and the rules that judge them."""

import math
from functools import cached_property

from fes_pin.diagnosis.errors_ahead import are_large, random_parts
from fes_pin.diagnosis.held_out import Again, Fold, Found, as_random_as_in_all, gains_of
from fes_pin.effort.search import FoundByEffort
from fes_pin.identify.afar import is_rounding
from fes_pin.identify.likelihood import is_simulated
from fes_pin.identify.likelihood_fit import LikelihoodFit, refit
from fes_pin.infer.distributions import chi2_tail
from fes_pin.infer.fits import Names
from fes_pin.infer.levels import FORM_GAIN, NOTHING_PERCENT
from fes_pin.infer.scatter import as_wide_as_estimates_differ, excess_scatter, least_apart
from fes_pin.infer.search import Search
from fes_pin.remainder.lack_of_fit import lack_of_fit
from fes_pin.search.likelihood_fits import MEASUREMENT, PROCESS, WHITE, LikelihoodFits
from fes_pin.search.likelihood_forms import refined_form, simplified_form
from fes_pin.search.score import Scored


class NominalFitError(ArithmeticError):
    """Error for a study to which not even the nominal model can be fitted, with the reason in one line."""


class LikelihoodModels(LikelihoodFits):
    """Fits of sets of causes to one set of trials, and the rules by which a search judges them.

    Attributes
    ----------
    by_effort
        What inverse dynamics found in the same trials; None where it does not apply.
    refusal
        Why inverse dynamics gives no answer though efforts were recorded, in words; "" where it gives one.
    """

    by_effort: FoundByEffort | None = None
    refusal = ""

    @cached_property
    def refitted(self) -> Again:
        """Fits to other trials, with the noise of these."""
        return Again(refit)

    @cached_property
    def as_random(self) -> Again:
        """Fits to other trials, with the noise of all."""
        return Again(as_random_as_in_all)

    def as_wide_as_efforts(self, fitted: LikelihoodFit) -> LikelihoodFit:
        """Return a fit with intervals that include the estimates of inverse dynamics that differ significantly."""
        by_effort = self.by_effort
        if by_effort is None or not by_effort.knows(fitted.names):
            return fitted
        other = by_effort.near(fitted)
        return as_wide_as_estimates_differ(fitted, other, by_effort.of_other_forms(fitted.free, other))

    def nominal(self) -> LikelihoodFit:
        """Fit the nominal model, and simulate the family of score tests of all causes in it.

        Raises
        ------
        NominalFitError
            If its likelihood is not finite.
        """
        fitted = super().nominal()
        if not math.isfinite(fitted.sse):
            free = "the simulation of the nominal model is not finite at its start values"
            filtered = "the one-step predictions of the nominal model are not finite at its start values"
            raise NominalFitError(free if is_simulated(fitted.noise, fitted.trials) else filtered)
        self.family = self.library.scores(fitted).family(self.seed)
        return fitted

    def extension_p_value(self, fitted: LikelihoodFit) -> float:
        """Return the family-wise p-value of the largest score of a further cause."""
        scored = [s for s in self.library.scores(fitted).scored if s.gain > 0.0]
        single = min((float(chi2_tail(s.gain, max(len(s.amplitudes), 1))) for s in scored), default=1.0)
        return self.family.adjusted(single)

    def scored(self, found: Found) -> list[Scored]:
        """Return the score of every cause in the nominal model, and in the best set of those that it lacks."""
        more = self.library.scores(found.best).scored if found.best.model.effects else []
        return self.library.scores(self.scored_in(found.nominal)).scored + more

    def excess_scatter(self, larger: LikelihoodFit, smaller: LikelihoodFit) -> float:
        """See `infer.scatter.excess_scatter`; infinite where the smaller set leaves nothing but errors of rounding."""
        if self.misfit(smaller) < NOTHING_PERCENT and is_rounding(smaller):
            return math.inf
        return excess_scatter(larger, smaller)

    def is_distinguished(self, best: LikelihoodFit, without: LikelihoodFit, rival: LikelihoodFit, lead: float) -> bool:
        """See `infer.scatter.least_apart`; none that predicts the readings to their rounding is distinguished."""
        return lead >= least_apart(best, rival) and not is_rounding(rival)

    def alike(self, found: Found, name: str) -> tuple[str, ...]:
        """Return a cause and its equivalents."""
        near = self.equivalents(found.best, found.without[name], found.rivals[name])
        return name, *sorted({n for f in near for n in f.names} - set(found.best.names))

    def level(self, fitted: LikelihoodFit) -> float:
        """See `LikelihoodFit.level`."""
        return fitted.level

    def is_error_of_form(self, larger: LikelihoodFit, gain: float, explained: float) -> bool:
        """Return whether a gain is no more than an error of form may leave, and no process noise takes that up."""
        return not larger.noise.acting and gain < FORM_GAIN * explained

    def predicts_better(self, larger: LikelihoodFit, smaller: LikelihoodFit) -> bool:
        """Return whether a larger set has the smaller error by which it is judged, on the trials it was fitted to."""
        fold = Fold(self.fits[()], larger, {"": smaller}, self.trials)
        return gains_of([fold], fold.without, self.judged_s, self.seed)[""].is_material

    def leaves_noise(self, fitted: LikelihoodFit) -> bool:
        """Return whether a fit has no lack of fit, and little process noise."""
        return not (are_large(random_parts(fitted)) or lack_of_fit(fitted).unexplained)

    def better_form(self, fitted: LikelihoodFit) -> LikelihoodFit | None:
        """Return a set with one refinement fewer, or one more, where that is better; else None.

        It is None by least squares: where a model is wrong every further parameter is significant.
        """
        if self.noise == WHITE or any(fitted is one for one in self.in_best_form):
            return None
        better = simplified_form(fitted) or refined_form(fitted, self.library.measured)
        self.in_best_form += [fitted] * (better is None)
        return better

    def begin_again(self, names: Names) -> bool:
        """Fit a set and the nominal model with process noise where that improves the set's penalised likelihood.

        Without process noise every prediction is a free simulation, which takes a third of the time. Errors of rounding
        are no process noise.
        """
        calm = self.fits[names]
        if self.noise != MEASUREMENT or is_rounding(calm):
            return False
        acting = self.with_process_noise(calm)
        if not acting.criterion < calm.criterion:
            return False
        further = {names: acting} if names else {}
        self.calm, self.noise, self.fits = {**self.fits, **further}, PROCESS, {}
        self._converged, self._begun, self._compared, self._calm = set(), set(), {}, None
        self.nominal()
        self.fits |= further
        return True


LikelihoodSearch = Search[LikelihoodFit, LikelihoodModels]
"""A search over sets of causes of one study by the likelihood."""

__all__ = ["Found", "LikelihoodModels", "LikelihoodSearch", "NominalFitError"]
