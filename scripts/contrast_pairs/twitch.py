"""Twitches of a muscle before and after its strength changed; errors of form are common to both groups.

Forces are those of SciPy's `solve_ivp` between the ends of the pulses.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial

FORMS = ("both", "none", "delay", "second order", "two kinds")
"""Errors of form: "both" are delay and second order; "two kinds" of fibres are a form that the library lacks."""
STRONGER = (1.67, 1.0, 1.3, 1.1)
"""Strength of the second group, as a multiple of that of the first, in turn."""
NOISE = (0.002, 0.01, 0.0005)
"""Standard deviation of a reading, as a share of the first group's peak, in turn."""
SCATTER = 0.01
"""Strength scatters between trials by this share."""
REPEATS = 3
"""Trials of each group."""
STEP_S, LONG_S = 1e-3, 0.4


def twitch_pair(form: str, stronger: float, noise: float, seed: int, folder: Path) -> Study:
    """Return a study of repeats of one stimulus, of which the second group is stronger.

    Parameters
    ----------
    form
        One of `FORMS`.
    stronger, noise
        See `STRONGER` and `NOISE`.
    """
    rng = np.random.default_rng([seed, 78])
    time = np.arange(round(LONG_S / STEP_S)) * STEP_S
    at = 0.05 + 0.03 * np.arange(int(rng.choice([1, 1, 2, 4])))
    tau = float(rng.uniform(0.015, 0.045))
    unit = twitch(time, at, tau, form, rng)
    unit /= unit.max()
    peak, stim = float(np.exp(rng.uniform(-2.0, 3.0))), np.zeros(len(time))
    stim[np.round(at / STEP_S).astype(int)] = 1.0
    trials = []
    for group, strength in (("before", peak), ("after", stronger * peak)):
        for k in range(REPEATS):
            own = strength * float(1.0 + SCATTER * rng.standard_normal())
            force = own * unit + noise * peak * rng.standard_normal(len(time))
            columns = {"stim": stim, "force_n": np.round(force, 4 - round(np.log10(peak)))}
            trials.append(Trial(f"{group}{k}", "isometric", columns, time, group=group))
    return Study("twitches", "muscle", {}, {"gain": 30.0, "time_constant_s": 0.05}, tuple(trials), folder)


def twitch(time: np.ndarray, at: np.ndarray, tau: float, form: str, rng: np.random.Generator) -> np.ndarray:
    """Return the force after pulses of one sample, of arbitrary strength, shape (n,).

    Parameters
    ----------
    time
        Shape (n,), s.
    at
        Times of the pulses, shape (pulses,), s.
    tau
        Time constant of the activation, s.
    """
    delay = float(rng.uniform(0.003, 0.012)) if form in ("both", "delay") else 0.0
    second = float(rng.uniform(0.25, 0.6)) * tau if form in ("both", "second order") else 0.0
    slow = (0.4, 4.0 * tau) if form == "two kinds" else (0.0, tau)
    ends = sorted({0.0, float(time[-1]) + STEP_S, *(at + delay), *(at + delay + STEP_S)})
    state, out = np.zeros(3), np.zeros(len(time))

    def rates(t: float, x: np.ndarray, on: float) -> list[float]:
        fast, late, lagged = x
        given = (1.0 - slow[0]) * fast + slow[0] * late
        return [(on - fast) / tau, (on - late) / slow[1], (given - lagged) / second if second else 0.0]

    for low, high in itertools.pairwise(ends):
        on = float(any(a + delay - 1e-9 < low < a + delay + STEP_S - 1e-9 for a in at)) / STEP_S
        inside = np.flatnonzero((time >= low - 1e-12) & (time < high - 1e-12))
        wanted = np.append(np.maximum(time[inside], low), high)
        run = solve_ivp(rates, (low, high), state, "Radau", wanted, args=(on,), rtol=1e-8, atol=1e-10)
        fast, late, lagged = run.y[:, :-1]
        out[inside] = lagged if second else (1.0 - slow[0]) * fast + slow[0] * late
        state = run.y[:, -1]
    return out
