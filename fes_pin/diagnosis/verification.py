"""Verification of a saved model: its errors on the trials of a study, and whether it leaves more than its noise."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.read_only import ReadOnly
from fes_pin.data.show import table_text
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import squared_errors
from fes_pin.identify.ahead import default_horizon
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, fit_of
from fes_pin.identify.stored import load_log, load_random, load_range
from fes_pin.infer.optimum import minimise
from fes_pin.infer.result import Remainder, p_shown, shown
from fes_pin.infer.text import percent, probability
from fes_pin.models.catalogue import Source
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.store import load_model
from fes_pin.prepare.measured import at_noise_rate, measured_study
from fes_pin.remainder.lack_of_fit import lack_of_fit
from fes_pin.workers import one_thread_each

BEYOND = 0.05
"""Share of the width of a range by which noise alone may exceed it."""


@dataclass(frozen=True)
class Verified:
    """Errors of a model on one trial.

    Attributes
    ----------
    free, ahead
        E of the free simulation, and over the horizon, percent.
    left
        The test that the trial leaves no more than noise.
    outside
        Columns with values beyond the range of the trials that the model was fitted to; None where it is not known.
    """

    name: str
    free: float
    ahead: float
    left: Remainder
    outside: tuple[str, ...] | None


@dataclass(frozen=True, repr=False, eq=False)
class Verification(ReadOnly):
    """A saved model on the trials of a study.

    Attributes
    ----------
    trials
        Errors of each trial.
    horizon_s
        Horizon of errors, s.
    remainder
        Lack of fit at the values and the noise of the model: the smallest p-value times the number of trials.
    """

    study: Study
    model: Model
    trials: tuple[Verified, ...]
    horizon_s: float
    remainder: Remainder

    def as_dict(self) -> dict[str, Any]:
        """Return the verification for JSON."""
        rows = {
            t.name: {
                "error_percent": {"free": shown(t.free), "horizon": shown(t.ahead)},
                "p_value": p_shown(t.left.p_value),
                "outside": None if t.outside is None else list(t.outside),
            }
            for t in self.trials
        }
        found = {"study": self.study.name, "model": list(self.model.structure()), "horizon_s": shown(self.horizon_s)}
        return {**found, "trials": rows, "remainder": self.remainder.record()}

    def __str__(self) -> str:
        left = self.remainder
        word = "leaves more than its noise" if left.unexplained else "explains the trials within its noise"
        on = f", most by {left.where}" if left.where else ""
        head = "trial", "E, free", f"E, {self.horizon_s:.3g} s ahead", "lack of fit", "outside the fitted range"
        rows = [
            (t.name, percent(t.free), percent(t.ahead), probability(t.left.p_value), _outside(t)) for t in self.trials
        ]
        title = f"{self.study.name}: the model {' + '.join(self.model.structure())} {word} ({left.tested()}{on})."
        return table_text(title, head, rows)


def _outside(one: Verified) -> str:
    return "not known" if one.outside is None else ", ".join(one.outside) or "-"


def verify(
    study: Study, path: str | Path, *, horizon_s: float | None = None, library: Source | None = None
) -> Verification:
    """Compare the trials of a study with a saved model, none of whose values is fitted again.

    Each trial is tested by itself, at the values and the noise of the model, which are taken as exact; its initial
    state is estimated. A trial that was recorded otherwise is found among many that were not.

    Parameters
    ----------
    study
        Measured trials, all of them.
    path
        The `model.toml` of a diagnosis, with its noise.
    horizon_s
        Horizon of errors, s; by default that of a diagnosis.
    library
        Where causes come from that are not written here.

    Raises
    ------
    InputError
        For a study of another rig, or a model without noise.
    """
    model, noise, ranges, log = load_model(path, library=library), load_random(path), load_range(path), load_log(path)
    if study.rig != model.rig.name:
        raise InputError(f"expected a study of the rig {model.rig.name}, found {study.rig}", file=study.folder)
    if not isinstance(noise, StateSpaceNoise):
        raise InputError("expected a table [random], as diagnose writes it: residuals are compared with it", file=path)
    measured = [log.applied(t) for t in measured_study(study).study.trials]
    horizon = horizon_s or study.horizon_s or default_horizon(measured)
    with one_thread_each():
        fits = [_with_own_start(model, t, noise) for t in at_noise_rate(measured, study.schema)]
        rows = [_verified(one, t, horizon, ranges) for one, t in zip(fits, measured, strict=True)]
    worst = min((one.left for one in rows), key=lambda left: left.p_value)
    p, level = min(1.0, len(rows) * worst.p_value), worst.level
    left = Remainder(p < level, p, worst.where if p < level else None, level)
    return Verification(study, model, tuple(rows), horizon, left)


def _with_own_start(model: Model, trial: Trial, noise: StateSpaceNoise) -> LikelihoodFit:
    """Return the fit of the initial state of one trial, at the values and the noise of the model."""
    problem = LikelihoodProblem(model, [trial], noise, ())
    return fit_of(problem, minimise(problem, model.parameters()))


def _verified(one: LikelihoodFit, trial: Trial, horizon_s: float, ranges: dict[str, tuple[float, float]]) -> Verified:
    """Return the errors of one trial and its test."""
    free, ahead = (squared_errors([(one, one, [trial])], span).error_percent() for span in (None, horizon_s))
    beyond = tuple(n for n, ends in ranges.items() if n in trial and _is_beyond(trial[n], *ends))
    return Verified(trial.name, free, ahead, lack_of_fit(one), beyond if ranges else None)


def _is_beyond(values: np.ndarray, low: float, high: float) -> bool:
    """Return whether values are beyond a range by more than a share of its width."""
    margin = BEYOND * (high - low)
    return bool(np.nanmin(values) < low - margin or np.nanmax(values) > high + margin)
