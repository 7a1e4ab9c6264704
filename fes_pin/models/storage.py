"""Low pass of simulated readings, where measured ones were low-passed before they were stored."""

from collections.abc import Sequence

import numpy as np

from fes_pin.data.trial import Trial

FEWEST_PERIODS = 2.0
"""Least length of a record that is filtered, in periods of the low pass; the start of a trial is shorter."""


def pass_as_stored(trials: Sequence[Trial], results: Sequence[np.ndarray]) -> None:
    """Low-pass simulated trials, in place, where their readings were low-passed; see `Trial.low_pass_hz`.

    Trials of equal length are filtered at once.

    Parameters
    ----------
    trials
        Trials by lane.
    results
        Readings and their sensitivities, shape (n, ..., lanes) each. Results that are not finite are not filtered.
    """
    if all(t.low_pass_hz is None for t in trials):
        return
    from fes_pin.data.smooth import low_pass  # noqa: PLC0415 - half a second, for few records

    alike: dict[tuple[int, float, float], list[int]] = {}
    for lane, trial in enumerate(trials):
        hz = trial.low_pass_hz
        if hz is not None and trial.duration * hz > FEWEST_PERIODS:
            alike.setdefault((len(trial), trial.dt, hz), []).append(lane)
    for (n, dt, hz), lanes in alike.items():
        for result in results:
            part = result[:n, ..., lanes]
            if part.size and np.isfinite(part).all():
                result[:n, ..., lanes] = low_pass(part.reshape(n, -1), dt, hz).reshape(part.shape)
