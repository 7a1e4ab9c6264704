"""Test for feedback: whether the input of a rig follows its reading."""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from fes_pin.data.answered import without_jumps
from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.infer.distributions import chi2_tail, f_tail
from fes_pin.infer.levels import ANSWERED, CERTAIN_LEVEL
from fes_pin.models.rigs.base import Rig

SHORTEST = 20
"""Least number of samples for each lag; shorter trials are not tested."""
LAGS = 4
"""Lags of the regression, in samples: a controller acts in the sample in which it reads, or a few later."""
OF_EFFORT = 4
"""Order of the differences of an effort and of the reading at its samples. A motion of frequency w leaves (w dt)^order
of itself in them, and noise grows. Second differences of a chirp leave enough that ten of 44 free joints seemed to be
in closed loop (`tests/identify/test_feedback.py`)."""
OF_STIMULUS = 2
"""The same of a stimulus, which has few pulses (`tests/driven/test_stimulated.py`)."""


def is_answered(rig: Rig, trials: Sequence[Trial]) -> bool:
    """Return whether a rig is driven in closed loop: noise comes back as an input."""
    return is_fed_back(rig, trials) or is_stimulus_fed_back(rig, trials)


def is_fed_back(rig: Rig, trials: Sequence[Trial]) -> bool:
    """Return whether the effort of a rig follows its reading, by Granger's test of causality.

    The test asks whether the last readings improve the prediction of the effort from the last efforts. It uses
    differences U of the effort and Y of the reading, which are mostly noise:

        U_t = a_1 U_(t-1) + ... + b_0 Y_t + b_1 Y_(t-1) + ...

    An effort that was chosen beforehand does not depend on the noise. Trials are combined by Fisher's method.

    Source: Granger, Investigating causal relations by econometric models and cross-spectral methods, Econometrica 37
    (1969); Fisher, Statistical Methods for Research Workers, 1932, section 21.1.
    """
    return _certainly(p for p, _ in _answers(rig, [t for t in trials if rig.is_driven([t])], OF_EFFORT))


def is_stimulus_fed_back(rig: Rig, trials: Sequence[Trial]) -> bool:
    """Return whether the stimulus of a rig follows its reading, by the same test.

    Readings predict a little even of a stimulus that was chosen beforehand, as motion follows it, and more of that of a
    controller.
    """
    free = [t for t in trials if t.kind != IMPOSED and not rig.is_driven([t])]
    return _certainly(p if share > ANSWERED else 1.0 for p, share in _answers(rig, free, OF_STIMULUS))


def _certainly(p_values: Iterable[float]) -> bool:
    logs = [math.log(max(p, 1e-300)) for p in p_values]
    return bool(logs) and float(chi2_tail(-2.0 * sum(logs), 2 * len(logs))) < CERTAIN_LEVEL


def _answers(rig: Rig, trials: Sequence[Trial], order: int) -> Iterator[tuple[float, float]]:
    for trial in trials:
        output = rig.output(trial.kind)
        if output in trial.columns:
            yield from (_granger(*_when_given(trial[n], trial[output]), order) for n in rig.input_columns(trial))


def _when_given(drive: np.ndarray, reading: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return input and reading at the samples in which the input may change: pulse widths are held between pulses."""
    changes = np.flatnonzero(np.diff(drive) != 0.0) + 1
    step = int(np.gcd.reduce(np.diff(changes))) if len(changes) > 1 else 1
    begin = int(changes[0]) % step if len(changes) else 0
    return drive[begin::step], reading[begin::step]


def _granger(effort: np.ndarray, reading: np.ndarray, order: int) -> tuple[float, float]:
    """Return the p-value of the readings as predictors of the effort, and their share of its unpredicted variance.

    Pulses that last one sample are not differenced: the differences of each would be as regular as no noise is.
    """
    is_held = np.any((effort[1:] != 0.0) & (effort[:-1] != 0.0))
    u = without_jumps(np.diff(effort, order) if is_held else effort[order:])
    y = without_jumps(np.diff(reading, order))
    n = len(u) - LAGS
    if n < SHORTEST * LAGS or not u.any() or not y.any():
        return 1.0, 0.0
    past = np.stack([u[LAGS - k : LAGS - k + n] for k in range(1, LAGS + 1)], axis=1) / u.std()
    read = np.stack([y[LAGS - k : LAGS - k + n] for k in range(LAGS + 1)], axis=1) / y.std()
    target = u[LAGS:] / u.std()
    few, many = (_left(columns, target) for columns in (past, np.concatenate([past, read], axis=1)))
    free = n - past.shape[1] - read.shape[1]
    gain = (few - many) / read.shape[1]
    return float(f_tail(gain / max(many / free, 1e-30), read.shape[1], free)), 1.0 - many / max(few, 1e-30)


def _left(columns: np.ndarray, target: np.ndarray) -> float:
    missed = target - columns @ np.linalg.lstsq(columns, target, rcond=1e-10)[0]
    return float(missed @ missed)
