"""Forms of the causes of a fitted set: one refinement more, one fewer, or all refinements of a cause restarted."""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from fes_pin.diagnosis.decide.significance import level_of
from fes_pin.diagnosis.search.likelihood_maxima import LikelihoodMaxima
from fes_pin.diagnosis.search.refined_forms import is_identified
from fes_pin.diagnosis.search.starts import STARTS, number_of_forms, refinements
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.distributions import chi2_quantile, chi2_tail
from fes_pin.infer.fits import more_degrees
from fes_pin.infer.search import Fitted
from fes_pin.workers import in_parallel

F = TypeVar("F", bound=Fitted)


class LikelihoodForms:
    """Fits of a set in other forms.

    Parameters
    ----------
    maxima
        Fits of single models.
    measured
        Columns by name, of all trials end to end.
    """

    def __init__(self, maxima: LikelihoodMaxima, measured: Mapping[str, np.ndarray]) -> None:
        self._maxima, self._measured = maxima, measured

    def refined(self, base: LikelihoodFit) -> LikelihoodFit | None:
        """Return the best fit of a set with one more refinement; None where none is significant."""
        models = [refinements(base.model, effect, self._measured) for effect in base.model.effects]
        looks = in_parallel(lambda s: self._maxima.look(s, base), [s for many in models for s in many])
        level = level_of(base) / number_of_forms(base.model, base.model.effects)

        def finished(worth: Sequence[LikelihoodFit]) -> list[LikelihoodFit]:
            return [f for f in in_parallel(self._maxima.go_on, worth) if is_identified(f, base)]

        return demanded_form(base, looks, level, finished)

    def simplified(self, base: LikelihoodFit) -> LikelihoodFit | None:
        """Return the best fit of a set with one refinement fewer; None where no criterion is lower.

        A refinement that was adopted with fewer causes may have been mistaken for a cause that was found later.
        """
        both = ((e, n) for e in base.model.effects for n, *_ in e.refinements() if n in e.refined())
        starts = in_parallel(lambda one: self._maxima.less(base, one[1:], one[0]), list(both))
        return self._maxima.better(starts, base)


def demanded_form(
    base: F, looks: Sequence[F], level: float, finished: Callable[[Sequence[F]], Sequence[F]]
) -> F | None:
    """Return the best fit of a set in another form that is significant; None where none is.

    A form is fitted further only if its first fit, at the noise of the base, gains half of what is required.

    Parameters
    ----------
    looks
        First fits of the set in other forms.
    level
        Level of the test of each form.
    finished
        Returns converged fits, without those that are physically impossible.
    """
    looks = sorted(looks, key=lambda f: f.criterion)
    demanded = chi2_quantile(1.0 - level, 1)
    worth = [f for f in looks[:STARTS] if base.sse - f.sse > 0.5 * max(demanded, base.sse - looks[0].sse)]
    best = min(finished(worth), key=lambda f: f.criterion, default=None)
    if best is None or not chi2_tail(max(base.sse - best.sse, 0.0), more_degrees(best, base)) < level:
        return None
    return best
