"""Efforts of all groups that were written down after they acted: a fault of the log that they share, and no change."""

from __future__ import annotations

import numpy as np

from fes_pin.contrasts.conditions import ContrastSearched
from fes_pin.contrasts.fits import Fits
from fes_pin.contrasts.grouped import Grouped
from fes_pin.identify.lateness import lateness_of
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximise
from fes_pin.models.predictor import Doubt
from fes_pin.workers import in_parallel


def late_in_groups(searched: ContrastSearched) -> float | None:
    """How late the efforts of a driven rig were written down, s, in the mean over groups; None where one is in time.

    What was found in all groups may stand for it: then the nominal model is asked.
    """
    fits, found = searched.fits, searched.found
    every = [t for many in fits.trials.values() for t in many]
    if not fits.driven or not all("effort" in fits.nominal.rig.input_columns(t) for t in every):
        return None
    asked = [found.best, found.nominal] if len(found.best.items) > len(found.best.changes) else [found.best]
    return next((late for one in asked if (late := _late_beside(fits, one)) is not None), None)


def _late_beside(fits: Fits, one: Grouped) -> float | None:
    """How late efforts are beside a set; None where those of a group are in time."""
    try:
        late = in_parallel(lambda group: _late_in(fits, one, group), list(fits.trials))
    except (ArithmeticError, np.linalg.LinAlgError):
        return None
    known = [s for s in late if s is not None]
    return float(np.mean(known)) if len(known) == len(late) else None


def _late_in(fits: Fits, best: Grouped, group: str) -> float | None:
    """How late the efforts of one group are beside what was found, with nominal values of its own."""
    part = fits.part(best, group)
    if not isinstance(part, LikelihoodFit):
        return None
    own = maximise(LikelihoodProblem(part.model, part.trials, part.noise), part.values, part.unknowns)
    late = lateness_of(own, min(t.dt for t in part.trials))
    return late.log.effort_late_s if late is not None else None


def is_cheaper(timed: ContrastSearched, recorded: ContrastSearched) -> bool:
    """True if efforts in time explain the same readings at a lower price."""
    one, other = timed.found.best, recorded.found.best
    return _lasting(one) == _lasting(other) and one.price < other.price


def _lasting(one: Grouped) -> set[float]:
    return {w.lasts_s for w in one.weights.values() if isinstance(w, Doubt)}
