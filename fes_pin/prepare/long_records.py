"""Trials before they are searched: the part of long records that a search takes, and few trials cut into parts.

Parts of a trial can be held out, and are then predicted by fits to the others.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from fes_pin.data.schema import RigSchema
from fes_pin.data.stuck import piece
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.infer.levels import HORIZON_S
from fes_pin.infer.noise import noise_step, thin, thinning
from fes_pin.models.compile.layout import WIDTH
from fes_pin.models.rigs.base import Rig

MOST_SAMPLES = 120_000
"""Samples of all trials together that a search takes. Sensitivities to every cause of the library take about 10 kB a
sample, and 4 GB of memory must suffice. This is ten minutes of motion at 200 Hz, or four trials of 30 s at 1 kHz."""
MOST_DRIVEN = 60_000
"""The same for a rig in closed loop, before samples are averaged. A search by the likelihood predicts them some
thousand times, and a step of 4 ms estimates what one of 1 ms does in a quarter of the time: dry friction of 20 N as
20.09 N or 20.06 N, an offset of -3 N as -3.24 N or -3.34 N (`scripts/benchmark slide`)."""

SHORTEST_S = 10.0 * HORIZON_S
"""Least length of a part, s: an error over the horizon is judged on as much."""


def searched_part(
    trials: Sequence[Trial], schema: RigSchema, driven: bool = False, groups: int = 1
) -> tuple[list[Trial], list[Trial], list[str]]:
    """Return the trials, or the part of them, that a search takes; trials that are kept for judging; and warnings.

    Samples are first averaged to the step that noise is modelled at. Then whole trials are left out, evenly spread over
    the session. A single record that is still too long is cut at its end, as a simulation begins at its beginning.

    Parameters
    ----------
    driven
        Whether the rig is in closed loop.
    groups
        Number of groups of trials that are searched together, this one among them; then none are kept for judging.
    """
    room = MOST_SAMPLES // groups
    if _size(trials) <= (min(room, MOST_DRIVEN // groups) if driven else room):
        return list(trials), [], []
    said, short = [], [thinned(t, schema, driven) for t in trials]
    if _size(short) < _size(trials):
        done = "thinned" if driven else "averaged"
        said.append(f"{_size(trials)} samples are more than a search needs: they were {done} to {_size(short)}")
    left: list[Trial] = []
    if _size(short) > room and len(short) > 1:
        short, left = _spread(short, max(1, min(len(short) - 1, room // max(map(len, short)))))
        left = left if groups == 1 else []
        judged = f", and {len(left)} others judged it" if left else ""
        said.append(f"{len(short)} of {len(trials)} trials were searched, evenly spread{judged}")
    most = room // len(short)
    cut = [t for t in short if len(t) > most]
    if cut:
        seconds = sum(t.duration for t in cut) / len(cut)
        said.append(f"only the first {most * cut[0].dt:.4g} s of {seconds:.4g} s were searched of trial {cut[0].name}")
    return [t.first(most) for t in short], [t.first(most) for t in left], said


def _spread(trials: Sequence[Trial], count: int) -> tuple[list[Trial], list[Trial]]:
    """Return `count` trials, evenly spread, and as many of the others."""
    chosen = {round(k) for k in np.linspace(0, len(trials) - 1, count)}
    others = [t for k, t in enumerate(trials) if k not in chosen]
    left = [others[round(k)] for k in np.linspace(0, len(others) - 1, min(count, len(others)))]
    return [t for k, t in enumerate(trials) if k in chosen], left


def thinned(trial: Trial, schema: RigSchema, driven: bool = False) -> Trial:
    """Return the trial at the time step that noise is modelled at.

    Inputs that are held between samples are averaged over the new step. Readings are averaged about its beginning:
    averaged about its middle, a rig would seem to respond half a step before it is driven. In closed loop only the
    readings at the new steps are kept, since noise enters the effort, and a mean of an encoder's counts is no count.
    """
    count = thinning(trial.dt, noise_step([trial.dt]))
    held = [n for n in schema.inputs if n in trial.columns and n != schema.outputs[trial.kind]]
    if not held or count == 1:
        columns = {n: thin(values, count) for n, values in trial.columns.items()}
        return derived_trial(trial, columns=columns, time=thin(trial.time, count))
    side = 0 if driven else (count - 1) // 2
    columns = {n: thin(v, count) if n in held else _about(v, count, side) for n, v in trial.columns.items()}
    return derived_trial(trial, columns=columns, time=trial.time[: len(trial) // count * count : count])


def _about(values: np.ndarray, count: int, side: int) -> np.ndarray:
    """Return means of `side` samples to either side of every `count`-th sample, mirrored at the ends."""
    before, after = 2.0 * values[0] - values[side:0:-1], 2.0 * values[-1] - values[-2 : -2 - side : -1]
    whole = np.convolve(np.concatenate([before, values, after]), np.full(2 * side + 1, 1.0 / (2 * side + 1)), "valid")
    return whole[: len(values) // count * count : count]


def _size(trials: Sequence[Trial]) -> int:
    return sum(map(len, trials))


def in_parts(rig: Rig, trials: Sequence[Trial], answered: bool = True) -> list[Trial]:
    """Return the trials, cut into parts of equal length if there are fewer than half as many as run in one batch.

    Each part begins at a state of its own, which is estimated from its first samples. Trials of a rig that begins at
    rest, or that no controller answers, are not cut: a free simulation does not know what a part inherits, as the
    stretch of a tendon that relaxes.
    """
    most = WIDTH // max(len(trials), 1)
    return [part for trial in trials for part in _cut(trial, most if answered and rig.unknowns(trial.kind) else 1)]


def _cut(trial: Trial, most: int) -> list[Trial]:
    count = min(most, int(trial.duration / SHORTEST_S))
    if count < 2:
        return [trial]
    ends = np.linspace(0, len(trial), count + 1).round().astype(int)
    return [piece(trial, slice(int(a), int(b)), k) for k, (a, b) in enumerate(pairwise(ends))]
