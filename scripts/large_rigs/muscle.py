"""Muscles held at one length, on a resting force; and twitches before and after a change of strength."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from large_rigs.recorded import HOLD, Drawn, Take, changes, held, log_uniform, simulated

CAUSES = (
    ("sensor_offset",),
    ("sensor_offset", "electromechanical_delay"),
    ("sensor_offset", "second_order_activation"),
    ("sensor_offset", "electromechanical_delay", "second_order_activation"),
)
RESTING = (0.1, 1.0)
"""Force before a pulse, as a share of a twitch's."""
STRONGER = (1.3, 1.67)
"""Strength after a change, as a multiple of that before."""
REPEATS = 3
"""Trials of each group."""
THRESHOLD_US, SATURATION_US = 180.0, 1000.0


class Muscle(NamedTuple):
    """A muscle as it is: force N, times s."""

    gain: float
    time_constant_s: float
    second_s: float = 0.0
    delay_s: float = 0.0

    def run(self, time: np.ndarray, drive: np.ndarray, dt: float) -> np.ndarray:
        """Force at the samples, N, shape (n,).

        Parameters
        ----------
        drive
            Recruitment, held for samples of `dt`; 1 where a train of pulses is on.
        """
        coarse = np.arange(len(drive)) * dt
        breaks, values = changes(drive, coarse)
        if self.delay_s:
            breaks, values = np.append(0.0, breaks + self.delay_s), np.append(0.0, values)
        lags = [self.time_constant_s, *([self.second_s] if self.second_s else [])]

        def rates(t: float, x: np.ndarray, r: float) -> list[float]:
            return [(before - now) / lag for before, now, lag in zip((r, *x), x, lags, strict=False)]

        return self.gain * simulated(rates, [0.0] * len(lags), time, breaks, values)[:, -1]


def draw(family: str, hidden: tuple[str, ...], trials: int, faster: int, rng: np.random.Generator) -> Drawn:
    """A muscle of a family, "muscle" or "twitches", with these causes hidden or this change between its groups."""
    dt, tau = float(rng.choice([0.001, 0.002])), log_uniform(rng, 0.02, 0.06)
    lagged, late = rng.uniform(0.15, 0.6) * tau, rng.uniform(0.003, 0.015)
    twitches = family == "twitches"
    second = lagged if twitches or "second_order_activation" in hidden else 0.0
    delay = late if twitches or "electromechanical_delay" in hidden else 0.0
    pulsed = twitches or rng.random() < 0.6
    stimuli = [_pulses(dt, twitches, rng) if pulsed else _widths(rng) for _ in range(trials + 1)]
    dt = dt if pulsed else 0.005
    period = _period(stimuli, dt) if pulsed else dt
    gain = log_uniform(rng, 0.2, 50.0) * (tau / period if pulsed else 1.0)
    muscle = Muscle(gain, tau, second, delay)
    start = {"gain": gain * log_uniform(rng, 0.5, 2.0), "time_constant_s": tau * log_uniform(rng, 0.5, 2.0)}
    start = {n: float(f"{v:.4g}") for n, v in start.items()}
    if twitches:
        stronger = float(rng.choice(STRONGER)) if "gain" in hidden else 1.0
        strengths = np.repeat([1.0, stronger], REPEATS)
        takes = [
            _take(muscle._replace(gain=gain * k), stimuli[0], dt, period, faster, ("before", "after")[n >= REPEATS])
            for n, k in enumerate(strengths)
        ]
        return Drawn("muscle", {}, start, {}, takes, None, _range(takes))
    takes = [_take(muscle, one, dt, period if pulsed else None, faster) for one in stimuli]
    rest = rng.uniform(*RESTING) * min(_range([t]) for t in takes) if "sensor_offset" in hidden else 0.0
    takes = [replace(t, values=t.values + rest) for t in takes]
    truth = {"gain": gain, "time_constant_s": tau, "sensor_offset.offset": rest}
    truth |= {"second_order_activation.second_s": second, "electromechanical_delay.delay_s": delay}
    known = {} if pulsed else {"threshold_us": THRESHOLD_US, "saturation_us": SATURATION_US}
    return Drawn("muscle", known, start, {n: v for n, v in truth.items() if v}, takes[:-1], takes[-1], _range(takes))


def _range(takes: list[Take]) -> float:
    return max(float(np.ptp(t.values)) for t in takes)


def _pulses(dt: float, single: bool, rng: np.random.Generator) -> np.ndarray:
    """A twitch, or up to four pulses, or a train, 1 in the sample of each pulse; shape (n,)."""
    count = HOLD * round(rng.uniform(0.4, 0.7) / (HOLD * dt)) if single else HOLD * round(1.5 / (HOLD * dt))
    out, at = np.zeros(count), HOLD * int(rng.integers(4, 16))
    pulses = 1 if single else int(rng.choice([1, 2, 4, 12]))
    between = HOLD * round(rng.uniform(0.03, 0.09) / (HOLD * dt))
    out[at : at + pulses * between : between] = 1.0
    return out


def _widths(rng: np.random.Generator) -> np.ndarray:
    """Pulse widths in steps, with pauses, us; shape (n,)."""
    levels = np.zeros(100)
    at = int(rng.integers(5, 15))
    while at < 90:
        lasts = int(rng.integers(3, 20))
        levels[at : at + lasts] = np.round(rng.uniform(250.0, 950.0))
        at += lasts + int(rng.integers(0, 15))
    return held(levels, HOLD, HOLD * len(levels))


def _period(stimuli: list[np.ndarray], dt: float) -> float:
    """The usual time between two pulses of what is shown, s; a sample where there are no two."""
    between = np.concatenate([np.diff(np.flatnonzero(one)) for one in stimuli[:-1]])
    return float(np.median(between)) * dt if len(between) else dt


def _take(
    muscle: Muscle, stimulus: np.ndarray, dt: float, period: float | None, faster: int, group: str | None = None
) -> Take:
    """A trial, of pulses where there is a period; each is as long as a sample of the plain rate."""
    time = np.arange(len(stimulus) * faster) * (dt / faster)
    if period is None:
        drive = np.clip((stimulus - THRESHOLD_US) / (SATURATION_US - THRESHOLD_US), 0.0, 1.0)
        column = {"pulse_width_us": np.repeat(stimulus, faster)}
    else:
        drive, pulses = stimulus * period / dt, np.zeros(len(time))
        pulses[::faster] = stimulus
        column = {"stim": pulses}
    return Take(dt / faster, "force_n", muscle.run(time, drive, dt), column, "isometric", group=group)
