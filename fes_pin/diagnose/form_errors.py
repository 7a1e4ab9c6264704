"""A search again where errors of form passed for a random effort that lasts; see `identify.fresh_efforts`."""

from __future__ import annotations

import numpy as np

from fes_pin.data.schema import IMPOSED
from fes_pin.diagnose.decide.held_out import held_out_gain
from fes_pin.diagnose.errors_ahead import errors_over_horizon
from fes_pin.diagnose.search.cause_sets import names_of
from fes_pin.diagnose.search.likelihood_search import Found, LikelihoodSearch
from fes_pin.diagnose.search.simulation_search import NominalFitError
from fes_pin.identify.fit import Fit
from fes_pin.identify.fresh_efforts import beside_fresh_efforts, step_s
from fes_pin.workers import OutOfTime, in_parallel, time_limit

FRESH = "what acts at random was taken for new in every sample: beside what lasts, the model foretold less"
"""What is told of such a search."""


def searched_again(search: LikelihoodSearch, found: Found) -> tuple[LikelihoodSearch, Found] | None:
    """Another search beside random efforts that are new in every sample; None where what was found gains nothing there.

    It gains where its errors over the horizon are less, by a thousandth of what the nominal model gets wrong, as those
    of a cause must be: a random effort that lasts is foretold as far as it does, and what takes its place gains less.
    """
    if search.was_stopped or not _may_last(found.best):
        return None
    try:
        with time_limit(search.seconds_left):
            fresh = beside_fresh_efforts(found.best)
            again = _begun_again(search, found, fresh) if _foretells_more(fresh, search, found) else None
    except (ArithmeticError, np.linalg.LinAlgError, OutOfTime):
        return None
    if again is None:
        return None
    try:
        with time_limit(search.seconds_left):
            other = again.run()
    except NominalFitError:
        return None
    return None if again.was_stopped else (again, other)


def _foretells_more(fresh: Fit, search: LikelihoodSearch, found: Found) -> bool:
    """Whether errors over the horizon are materially less beside efforts that are new."""
    many = [[(f, found.best, f.trials)] for f in (found.nominal, found.best, fresh)]
    nominal, lasting, new = (errors_over_horizon(one, search.horizon_s) for one in many)
    return held_out_gain(nominal, lasting, new, search.seed).is_material


def _begun_again(search: LikelihoodSearch, found: Found, fresh: Fit) -> LikelihoodSearch:
    """The search that begins with what was found, and with its parts, beside efforts that are new."""
    parts = {names_of(f): f for f in (*found.without.values(), found.nominal)}
    parts.pop(names_of(fresh), None)
    return search.begun_with([fresh, *in_parallel(beside_fresh_efforts, list(parts.values()))])


def _may_last(fitted: Fit) -> bool:
    """Whether something acts at random on a rig whose starts are unknown, and lasts longer than a reading.

    Where the motion is imposed effort itself is read, and a reading of it lasts as it does; where a rig begins at rest
    noise that foretells itself is told from a random effort (`LikelihoodFits.nominal`).
    """
    assert fitted.doubt is not None
    lasts = any(fitted.doubt.time[n] > step_s(fitted.doubt, fitted.trials) for n in fitted.doubt.acting)
    return lasts and all(t.kind != IMPOSED and fitted.model.rig.unknowns(t.kind) for t in fitted.trials)


__all__ = ["FRESH", "searched_again"]
