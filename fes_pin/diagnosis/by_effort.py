"""Inverse dynamics as a second estimator of a joint whose effort was recorded.

It searches, and the likelihood fits its set, the sets one cause away, and its own best first causes. Where the two name
different sets, that which predicts better answers: in the low-passed effort, and in motion over the horizon.
"""

from collections.abc import Sequence

from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.estimators import RigEstimator
from fes_pin.diagnosis.likelihood_models import Found, LikelihoodModels, LikelihoodSearch
from fes_pin.diagnosis.verdict import RigState, RigVerdict
from fes_pin.effort.search import has_efforts, searched
from fes_pin.infer.search import FITTED, Policy
from fes_pin.infer.verdict import State
from fes_pin.models.rigs.joint import Joint


def begun_by_effort(models: LikelihoodModels, trials: Sequence[Trial]) -> Policy:
    """Search by inverse dynamics where it applies, and return the options of a search that begins there.

    Sets of one cause are then fitted by their scores alone.
    """
    rig = models.model.rig
    if models.model.effects or not isinstance(rig, Joint) or not has_efforts(rig, trials):
        return Policy()
    try:
        models.by_effort = searched(rig, trials, models.seed)
    except InputError:  # the motion is not above the noise of its reading
        return Policy()
    models.proposed = models.by_effort.model()
    return Policy(fitted_first=FITTED)


class InverseDynamics(RigEstimator):
    """Least squares of the low-passed effort, for a joint whose effort was recorded."""

    prefers_smaller = True

    def state(self, first: RigState) -> RigState | None:
        """Return the state of its set, fitted by the likelihood; None where the first state has the same."""
        models, search = first.search.models, first.search
        by_effort = models.by_effort
        if by_effort is None or search.was_stopped or {*by_effort.names} == first.names:
            return None
        fitted = models.fits.get(by_effort.names)
        if fitted is None or not models.is_possible(fitted):
            return None
        verdict = RigVerdict(search, self.test)
        found = search.result(by_effort.names)
        return State(verdict, found, verdict.weigh(found), {}, frozenset(by_effort.names), replaced=first)

    def searched(self, first: RigState) -> tuple[LikelihoodSearch, Found] | None:
        """Return None: its search has run before that of the likelihood."""
        return None
