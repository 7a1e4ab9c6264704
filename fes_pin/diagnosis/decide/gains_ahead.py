"""What causes gain of errors above the noise: over a horizon, or of free simulations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import squared_errors
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.held_out import Errors, held_out_gain
from fes_pin.infer.result import Gain


@dataclass(frozen=True)
class Fold:
    """Fits without some trials, and those trials."""

    nominal: LikelihoodFit
    best: LikelihoodFit
    without: dict[str, LikelihoodFit]
    test: tuple[Trial, ...]
    within: bool = True
    """False if the trials were held out by the study itself, and are in no fit."""
    chosen: LikelihoodFit | None = None
    """What is chosen anew without the trials, fitted to the others; None where `best` is not to be doubted."""


def gains_of(
    folds: Sequence[Fold], without: Mapping[str, LikelihoodFit], horizon_s: float | None, seed: int
) -> dict[str, Gain]:
    """What each cause gains over the horizon, or of the errors of free simulations.

    Where it is nothing over the horizon, over as long as the random effort lasts that is mistaken for the cause in the
    fit without it: a filter follows what is slow, as a spring's torque, and predicts it for so long.

    Parameters
    ----------
    folds
        Trials, and fits that they are foretold by.
    without
        By cause, the fit to all trials without it.
    horizon_s, seed
        How far ahead errors look, s, None for free simulations; of the bootstrap of their intervals.
    """
    found_over = _gains_over(folds, tuple(without), horizon_s, seed)
    if horizon_s is None:
        return found_over
    shortest = min(t.duration for f in folds for t in f.test)
    for name, gain in found_over.items():
        lasts = min(max(without[name].noise.time.values(), default=0.0), shortest)
        if not gain.is_material and lasts > horizon_s:
            longer = _gains_over(folds, (name,), lasts, seed)[name]
            found_over[name] = replace(longer, ahead_s=lasts) if longer.is_material else gain
    return found_over


def _gains_over(folds: Sequence[Fold], names: Sequence[str], horizon_s: float | None, seed: int) -> dict[str, Gain]:
    """What causes gain on the trials of the folds, so far ahead."""

    def errors(fits: Sequence[LikelihoodFit]) -> Errors:
        pairs = zip(fits, folds, strict=True)
        return squared_errors([(one, fold.best, fold.test) for one, fold in pairs], horizon_s)

    if not names:
        return {}
    nominal, best = errors([f.nominal for f in folds]), errors([f.best for f in folds])
    return {n: held_out_gain(nominal, errors([f.without[n] for f in folds]), best, seed) for n in names}
