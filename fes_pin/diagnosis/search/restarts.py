"""Fits of sets from afar: from the rig as it was believed, whatever the fit without a cause has made of it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from fes_pin.diagnosis.search.cause_sets import Names
from fes_pin.diagnosis.search.simulation_fits import SimulationFits
from fes_pin.diagnosis.search.starts import near_null
from fes_pin.identify.fit import GROSS, Fit, rough_noise
from fes_pin.infer.noise import NoiseModel, as_white
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel


def restart(sets: SimulationFits, names: Sequence[Names]) -> None:
    """Fit sets from afar, too: a strong cause has dragged the fit without it away from its nominal values."""
    white = as_white(sets.fitter.noise)
    _restart(sets, [(n, Model(sets.model.rig, sets.fits[n].model.effects)) for n in names], white)


def restart_every(sets: SimulationFits) -> None:
    """Fit every single cause from afar, with all its discrete choices: where the nominal model says nothing.

    Neither does the noise that it leaves; the errors count in the noise from sample to sample.
    """
    white = rough_noise(sets.model, sets.trials)
    _restart(sets, [(n, one) for n in sets.ranked(1) for one in _every_choice(sets, n)], white)


def restart_beside(sets: SimulationFits, names: Names) -> None:
    """Fit the single causes that leave a gross misfit from the nominal values of one, if that leaves none."""
    if sets.fits[names].reduced > GROSS:
        return
    rig, far = sets.fits[names].model.rig, [n for n in sets.ranked(1) if sets.fits[n].reduced > GROSS]
    starts = [(n, Model(rig, one.effects)) for n in far for one in _every_choice(sets, n)]
    _restart(sets, starts, as_white(sets.fitter.noise))


def at_null(sets: SimulationFits) -> list[Names]:
    """Single causes whose fit ended where they are absent, at a bound: another amplitude has not been seen."""
    return [n for n in sets.ranked(1) if _is_absent(sets.fits[n], sets.fits[n].model.effects[-1])]


def _restart(sets: SimulationFits, starts: Sequence[tuple[Names, Model]], white: NoiseModel) -> None:
    """Fit sets from models; of the fits of a set the cheapest stays."""
    for (n, _), found in zip(starts, in_parallel(lambda s: sets.fitter.multistart(s[1], white), starts), strict=True):
        if found.price < sets.fits[n].price:
            sets.fits[n] = found


def _every_choice(sets: SimulationFits, names: Names) -> list[Model]:
    """The model of a single cause with every discrete choice that it has, next to its null."""
    (one,) = sets.fits[names].model.effects
    info, grids = one.parameters(), one.grids(sets.library.measured)
    chosen = [n for n in one.shapes() if not info[n].fitted]
    start: dict[str, Any] = {} if one.each_trial else {n: near_null(type(one), n) for n in one.amplitudes()}
    values = itertools.product(*(grids[n] for n in chosen))
    return [sets.model + replace(one, **{**start, **dict(zip(chosen, v, strict=True))}) for v in values]


def _is_absent(fitted: Fit, effect: Effect) -> bool:
    """True if a parameter of the effect stands at a bound that is its null."""
    info = effect.parameters()
    return any(f"{effect.name}.{n}" in fitted.at_bound and getattr(effect, n) == one.null for n, one in info.items())
