"""Stretches in which a reading is that of a stuck sensor, not of the rig: nothing was measured there.

A reading of one value for a while is the sensor's own, and not a rig's that stands still,

- where it stops at once or goes on with a leap: a rig has inertia and comes to rest first, a sensor holds its value in
  full motion; or
- where its noise stops: white noise above the step of its digits is in a reading whether the rig moves or stands.

What is coarse, or comes to rest as a rig does, stays as it was measured.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from fes_pin.data.trial import Trial, derived_trial

RUN = 20
"""Equal samples in a row that noise does not make: with a deviation of one digit the chance of two is 0.3."""
AT_ONCE = 3.0
"""Times that a reading's step, or change of step, must exceed what it is elsewhere but for one sample in a hundred."""
WHITE = -0.5
"""Correlation of neighbouring fourth differences below which they are noise's: of white noise it is -0.8, of a motion
that sampling follows about 1."""
FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
SHORTEST = 0.25
"""Share of a trial's longest piece that another must have to be worth a start of its own."""
FEW = 16
"""Samples below which a piece shows no motion."""
BY_CHANCE = 1e-3
"""Probability that noise makes a run of equal samples as long as the longest elsewhere; below it the reading is coarse
there, and rests."""


def stuck(values: np.ndarray) -> list[slice]:
    """Stretches in which a reading, shape (n,), is its sensor's own; see the module."""
    ends = np.r_[0, np.flatnonzero(np.diff(values)) + 1, len(values)]
    runs = np.diff(ends)
    long = [slice(int(a), int(b)) for a, b in itertools.pairwise(ends) if b - a >= RUN]
    if not long or len(long) == len(runs):
        return []
    moving = _stretches(len(values), long)
    noisy = _come_by_chance(runs[runs < RUN]) and _is_noisy(values, moving)
    usual = [_usual(values, moving, order) for order in (1, 2)]
    return [s for s in long if noisy or _at_once(values, s, *usual)]


def _usual(values: np.ndarray, moving: Sequence[slice], order: int) -> float:
    """What differences of an order are at most, but for one in a hundred."""
    found = np.abs(np.concatenate([np.diff(values[s], order) for s in moving]))
    return float(np.quantile(found, 0.99)) if len(found) else np.inf


def _at_once(values: np.ndarray, stretch: slice, steps: float, turns: float) -> bool:
    """Return whether a reading stops in full motion, or goes on with a leap."""
    into = abs(values[stretch.start] - values[stretch.start - 1]) if stretch.start else 0.0
    leap = abs(values[stretch.stop] - values[stretch.stop - 1]) if stretch.stop < len(values) else 0.0
    return bool(into > AT_ONCE * turns or leap > AT_ONCE * steps)


def _stretches(count: int, without: Sequence[slice]) -> list[slice]:
    """What lies between some stretches of so many samples."""
    begins = [0, *(s.stop for s in without)]
    ends = [*(s.start for s in without), count]
    return [slice(a, b) for a, b in zip(begins, ends, strict=True) if b > a]


def _come_by_chance(runs: np.ndarray) -> bool:
    """Return whether the longest of some runs is as long as noise makes one, by the share of equal neighbours."""
    equal = 1.0 - len(runs) / runs.sum()
    return bool(runs.sum() * equal ** (runs.max() - 1) > BY_CHANCE)


def _is_noisy(values: np.ndarray, moving: Sequence[slice]) -> bool:
    """Return whether white noise above the step of its digits is in a reading wherever it moves."""
    fourth = [np.convolve(values[s], FOURTH, "valid") for s in moving if s.stop - s.start > FEW]
    if not fourth:
        return False
    scale = float(np.median(np.abs(np.concatenate(fourth)))) / 0.6745
    steps = np.abs(np.diff(values))
    digit = float(np.quantile(steps[steps > 0.0], 0.05))  # a few samples are resampled, and lie between two digits
    if not scale / np.linalg.norm(FOURTH) > digit:
        return False
    cut = [np.clip(f, -3.0 * scale, 3.0 * scale) for f in fourth]
    lagged, power = (sum(float(f[k:] @ f[: len(f) - k]) for f in cut) for k in (1, 0))
    return lagged < WHITE * power


def without_stuck(trial: Trial, columns: Sequence[str], starts_anywhere: bool) -> tuple[list[Trial], list[str]]:
    """The pieces of a trial in which every reading was the rig's, and what is to be said.

    Parameters
    ----------
    trial
        As measured.
    columns
        Readings; what the trial has not is not asked for.
    starts_anywhere
        True if a model of the trial begins at a state that is its own: then what comes after a stretch counts as well.
        Else only what comes before the first does, and a stretch at the very beginning is the rig at rest.

    Returns
    -------
    list of Trial
        The trial itself where nothing is stuck; none where nothing else is left.
    list of str
    """
    found = {n: stretches for n in columns if n in trial and (stretches := stuck(trial[n]))}
    if not starts_anywhere:
        found = {n: kept for n, many in found.items() if (kept := [s for s in many if s.start > 0])}
    if not found:
        return [trial], []
    held = np.zeros(len(trial), dtype=bool)
    for stretch in (s for many in found.values() for s in many):
        held[stretch] = True
    edges = np.flatnonzero(np.diff(np.r_[True, held, True]))
    pieces = [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    if not starts_anywhere:
        pieces = [p for p in pieces if p.start == 0]
    longest = max((p.stop - p.start for p in pieces), default=0)
    pieces = [p for p in pieces if p.stop - p.start >= max(FEW, SHORTEST * longest)]
    return [piece(trial, p, k) for k, p in enumerate(pieces)], [_said(trial, n, many) for n, many in found.items()]


def piece(trial: Trial, rows: slice, number: int) -> Trial:
    """Some rows of a trial as a trial, the first of its pieces under its own name; what is stated of its start is lost.

    Parameters
    ----------
    trial
        As measured.
    rows
        Of its samples.
    number
        Of the piece, from 0.
    """
    name = f"{trial.name}_part{number + 1}" if number else trial.name
    return derived_trial(trial.part(rows), name=name)


def _said(trial: Trial, name: str, stretches: Sequence[slice]) -> str:
    first = stretches[0]
    count = sum(s.stop - s.start for s in stretches)
    more = f", and {len(stretches) - 1} times more" if len(stretches) > 1 else ""
    held = f"{name} stays at {trial[name][first.start]:.4g} from {trial.time[first.start]:.4g} s on"
    return f"{held}{more} in trial {trial.name}, as a stuck sensor does: {count} samples are left out"
