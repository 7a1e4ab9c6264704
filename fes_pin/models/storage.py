"""What was done to readings before they were stored is done to simulated ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fes_pin.data.trial import Trial

FEWEST_PERIODS = 2.0
"""Periods of a low pass that a record holds at least for it to be filtered: the start of a trial is not."""


def pass_as_stored(trials: Sequence[Trial], results: Sequence[np.ndarray]) -> None:
    """Low-pass what was simulated of trials, in place, where their readings were; see `Trial.low_pass_hz`.

    Trials as long as each other are filtered at once.

    Parameters
    ----------
    trials
        By lane.
    results
        Readings and their sensitivities, shape (n, ..., lanes) each; zero behind the end of a shorter trial. What did
        not stay finite is left as it is.
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
