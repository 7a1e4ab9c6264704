"""What speaks against a verdict that tests alone would give: an error that is no noise, names that rest on little."""

from __future__ import annotations

from dataclasses import replace

from fes_pin.diagnosis.decide.claims import slow_misfit, slowness
from fes_pin.diagnosis.decide.held_out import errors_of
from fes_pin.diagnosis.search.simulation_search import Searched
from fes_pin.identify.fit import rough_noise
from fes_pin.infer.held_out import FOLDS
from fes_pin.infer.levels import SMALL_PERCENT
from fes_pin.infer.result import Remainder
from fes_pin.models.model import Model


def with_error(left: Remainder, searched: Searched) -> tuple[Remainder, str | None]:
    """A remainder also where no test finds one, but the error is far above what the reading scatters by, and why.

    An autoregression of a long order takes any slow error for noise; a missing input then ends as noise, too.
    """
    best = searched.best
    floor = rough_noise(Model(best.model.rig), best.trials)
    percent = errors_of(best.model, best.trials, floor).error_percent()
    if left.unexplained or not slow_misfit(searched.judged) or percent <= SMALL_PERCENT:
        return left, None
    ratio = slowness(searched.judged)
    why = f"an error of {percent:.3g} %, {ratio:.3g} times the scatter from sample to sample, is no noise of a reading"
    return replace(left, unexplained=True, where="time"), why


def doubts(searched: Searched, named: int) -> list[str]:
    """What a reader must know of so many names, if they rest on little; one line each."""
    wrong = "no set of causes leaves only noise: those named predict best, and may change with other trials"
    return [wrong] if named and not searched.complete else []


def few_trials(count: int) -> list[str]:
    """What a reader must know of names that rest on so many trials; nothing if they are many."""
    few = f"the names rest on {count} trial{'s' if count > 1 else ''}, fewer than {FOLDS}: more may change them"
    return [few] * (count < FOLDS)
