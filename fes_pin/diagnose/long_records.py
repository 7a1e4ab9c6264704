"""Records longer than a search can hold: what part of them is searched, and in what words that is told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.noise import noise_step, thin, thinning

MOST_SAMPLES = 120_000
"""Samples of all trials together that a search takes: sensitivities to every cause of the library take about 10 kB a
sample, and a computer of 4 GB must do. Ten minutes of motion at 200 Hz, or four trials of 30 s at 1 kHz."""


def searched_part(trials: Sequence[Trial]) -> tuple[list[Trial], list[Trial], list[str]]:
    """The trials, or the part of them, that a search takes; trials left for judging it; and what is to be said.

    First samples are averaged to the step that noise is modelled at; then whole trials are left out, evenly spread over
    the session; a single record that is too long even so is cut at its end, as a simulation begins at its beginning.
    """
    if _size(trials) <= MOST_SAMPLES:
        return list(trials), [], []
    said, short = [], [thinned(t) for t in trials]
    if _size(short) < _size(trials):
        said.append(f"{_size(trials)} samples are too many for one search: they were averaged to {_size(short)}")
    left: list[Trial] = []
    if _size(short) > MOST_SAMPLES and len(short) > 1:
        longest = max(map(len, short))
        count = max(1, min(len(short) - 1, MOST_SAMPLES // longest))
        chosen = {round(k) for k in np.linspace(0, len(short) - 1, count)}
        others = [t for k, t in enumerate(short) if k not in chosen]
        left = [others[round(k)] for k in np.linspace(0, len(others) - 1, min(count, len(others)))]
        short = [t for k, t in enumerate(short) if k in chosen]
        said.append(
            f"{len(short)} of {len(trials)} trials were searched, evenly spread, and {len(left)} others judged it"
        )
    most = MOST_SAMPLES // len(short)
    cut = [t for t in short if len(t) > most]
    if cut:
        seconds = sum(t.duration for t in cut) / len(cut)
        said.append(f"only the first {most * cut[0].dt:.4g} s of {seconds:.4g} s were searched of trial {cut[0].name}")
    return [t.first(most) for t in short], [t.first(most) for t in left], said


def thinned(trial: Trial) -> Trial:
    """Means of samples in a row, at the time step that noise is modelled at."""
    count = thinning(trial.dt, noise_step([trial.dt]))
    columns = {n: thin(values, count) for n, values in trial.columns.items()}
    return replace(trial, columns=columns, time=thin(trial.time, count))


def _size(trials: Sequence[Trial]) -> int:
    return sum(map(len, trials))
