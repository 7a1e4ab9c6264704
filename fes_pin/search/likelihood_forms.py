"""Forms of the causes of a fitted set: one refinement more or one fewer, and whether refinements are identified."""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from fes_pin.identify.fit import Fit
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximum_from
from fes_pin.infer.distributions import chi2_quantile, chi2_tail
from fes_pin.infer.fits import more_degrees
from fes_pin.infer.levels import CONFIDENCE_95, PARAMETER_PENALTY
from fes_pin.infer.scatter import excess_scatter
from fes_pin.search.likelihood_maxima import less, look
from fes_pin.search.starts import STARTED, STARTS, number_of_forms, refinements
from fes_pin.workers import in_parallel

FormFit = TypeVar("FormFit", bound=Fit)


def refined_form(base: LikelihoodFit, measured: Mapping[str, np.ndarray]) -> LikelihoodFit | None:
    """Return the best fit of a set with one more refinement; None where none is significant.

    Parameters
    ----------
    measured
        Columns by name, of all trials end to end.
    """
    models = [refinements(base.model, effect, measured) for effect in base.model.effects]
    looks = in_parallel(lambda s: look(s, base), [s for many in models for s in many])
    level = base.level / number_of_forms(base.model, base.model.effects)

    def finished(worth: Sequence[LikelihoodFit]) -> list[LikelihoodFit]:
        return [f for f in in_parallel(lambda f: maximum_from(f, f.trials), worth) if is_identified(f, base)]

    return demanded_form(base, looks, level, finished)


def simplified_form(base: LikelihoodFit) -> LikelihoodFit | None:
    """Return the best fit of a set with one refinement fewer; None where no criterion is lower.

    A refinement that was adopted with fewer causes may have been mistaken for a cause that was found later. The best
    first fits are fitted further if their criterion, at the noise of the base, exceeds that of the base by less than
    the penalty of a parameter.
    """
    both = [(e, n) for e in base.model.effects for n, *_ in e.refinements() if n in e.refined()]
    looks = in_parallel(lambda one: look(less(base, one[1:], one[0]), base), both)
    near = [f for f in looks if f.criterion < base.criterion + PARAMETER_PENALTY]
    worth = sorted(near, key=lambda f: f.criterion)[:STARTS]
    fits = in_parallel(lambda f: maximum_from(f, f.trials), worth)
    return min((f for f in fits if f.criterion < base.criterion), key=lambda f: f.criterion, default=None)


def demanded_form(
    base: FormFit, looks: Sequence[FormFit], level: float, finished: Callable[[Sequence[FormFit]], Sequence[FormFit]]
) -> FormFit | None:
    """Return the best fit of a set in another form that is significant; None where none is.

    Its gain is corrected for scatter between pieces of the data, as that of a cause is. A form is fitted further only
    if its first fit, at the noise of the base, gains half of what is required.

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
    worth = [f for f in looks[:STARTS] if base.sse - f.sse > STARTED * max(demanded, base.sse - looks[0].sse)]
    best = min(finished(worth), key=lambda f: f.criterion, default=None)
    if best is None:
        return None
    gain = max(base.sse - best.sse, 0.0) / excess_scatter(best, base)
    return best if chi2_tail(gain, more_degrees(best, base)) < level else None


def is_identified(fitted: Fit, before: Fit | None = None) -> bool:
    """Return whether every parameter of all refined effects differs significantly from its null, within its bounds.

    A parameter at a bound has no standard deviation.

    Parameters
    ----------
    before
        The fit that was refined: a parameter that was at its bound there is no objection to another form.
    """
    there = before.at_bound if before is not None else ()
    for one in (e for e in fitted.model.effects if e.refined()):
        for n, info in one.parameters().items():
            name = f"{one.name}.{n}"
            if name in fitted.free and name not in there:
                std, away = fitted.std(name), getattr(one, n) - info.null if info.null is not None else np.inf
                if not np.isfinite(std) or abs(away) < CONFIDENCE_95 * std:
                    return False
    return True
