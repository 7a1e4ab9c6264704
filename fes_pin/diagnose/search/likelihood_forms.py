"""Forms of the causes of a set that is fitted: one refinement more, one fewer, all of one begun anew."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fes_pin.diagnose.search.likelihood_maxima import LikelihoodMaxima
from fes_pin.diagnose.search.refined_forms import is_identified
from fes_pin.diagnose.search.starts import STARTS, begun_anew, refinements
from fes_pin.identify.fit import Fit
from fes_pin.identify.scoring import WORTH
from fes_pin.workers import in_parallel


class LikelihoodForms:
    """Fits of a set in other forms than it has.

    Parameters
    ----------
    maxima
        Fits of single models.
    measured
        Columns by name, of all trials end to end.
    """

    def __init__(self, maxima: LikelihoodMaxima, measured: Mapping[str, np.ndarray]) -> None:
        self._maxima, self._measured = maxima, measured

    def refined(self, base: Fit, demanded: float) -> Fit | None:
        """The best fit of a set with the form of one of its effects refined; None where no form is, or none is told.

        Parameters
        ----------
        demanded
            Fall of twice the negative log-likelihood below which no refinement is adopted. What is not half way there
            once its parameters were fitted, beside randomness as it was, is not gone on with.
        """
        starts = [s for effect in base.model.effects for s in refinements(base.model, effect, self._measured)]
        looks = sorted(in_parallel(lambda s: self._maxima.look(s, base), starts), key=lambda f: f.price)
        worth = [f for f in looks[:STARTS] if base.sse - f.sse > 0.5 * max(demanded, base.sse - looks[0].sse)]
        found = [f for f in in_parallel(self._maxima.go_on, worth) if is_identified(f, base)]
        return min(found, key=lambda f: f.price, default=None)

    def simplified(self, base: Fit) -> Fit | None:
        """The best fit of a set with one refinement of a form fewer; None where none is cheaper.

        A form that was demanded beside fewer causes may have stood for one that has been found since.
        """
        both = ((e, n) for e in base.model.effects for n, *_ in e.refinements() if n in e.refined())
        starts = in_parallel(lambda one: self._maxima.less(base, one[1:], one[0]), list(both))
        return self._maxima.cheaper(starts, base, base.price)

    def reformed(self, base: Fit) -> Fit | None:
        """A set with several refinements of a form, all begun anew at once; None where that is no better.

        They were adopted one after another, and the first may have bent to what a later one says.
        """
        starts = [s for effect in base.model.effects for s in begun_anew(base.model, effect, self._measured)]
        return self._maxima.cheaper(starts, base, base.price - WORTH)
