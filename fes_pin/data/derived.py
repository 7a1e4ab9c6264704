"""Test whether a velocity was computed from positions, or measured by a sensor of its own."""

from collections.abc import Sequence

import numpy as np

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial

TAPS = 20
"""Samples on both sides from which a velocity is predicted: as long as the filters of drives."""
OWN = 0.5
"""Share of a velocity's noise that is not that of positions, above which it is a measurement. For logged differences of
positions, filtered or not, it is below 0.05, for a sensor above 0.8 (`tests/data/test_derived.py`)."""


def without_derived(trials: Sequence[Trial], position: str, velocity: str) -> tuple[list[Trial], list[str]]:
    """Return trials without a velocity that was computed from positions, and a warning about it.

    Its noise is that of the positions: as a reading of its own it would count their information twice.

    Parameters
    ----------
    position, velocity
        Columns.
    """
    both = [t for t in trials if position in t and velocity in t and t.kind != IMPOSED]
    shares = [s for t in both if (s := own_share(t[position], t[velocity])) is not None]
    if not shares or float(np.median(shares)) >= OWN:
        return list(trials), []
    said = f"{velocity} was computed from {position} before it was stored: it is no reading of its own, and left out"
    return [t.without(velocity) if any(t is one for one in both) else t for t in trials], [said]


def own_share(position: np.ndarray, velocity: np.ndarray) -> float | None:
    """Return the share of a velocity's second differences, mostly noise, that no filter of positions explains.

    v''_t = sum_k b_k q''_(t + k),  k = -TAPS ... TAPS; None for a record that is too short to decide.

    Parameters
    ----------
    position, velocity
        Shape (n,), in equal steps of time.
    """
    q, v = np.diff(position, 2), np.diff(velocity, 2)
    n = len(q) - 2 * TAPS
    if n < 4 * TAPS or not q.any() or not v.any() or not np.isfinite(q + v).all():
        return None
    columns = np.lib.stride_tricks.sliding_window_view(q, 2 * TAPS + 1) / q.std()
    target = v[TAPS : TAPS + n]
    left = target - columns @ np.linalg.lstsq(columns, target, rcond=1e-12)[0]
    return float(left @ left) / max(float(target @ target), 1e-300)
