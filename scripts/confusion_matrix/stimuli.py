"""Stimuli and commanded efforts of random trials, sampled at 200 Hz."""

from __future__ import annotations

import math

import numpy as np

DT = 0.005
"""Sample time, s."""
DURATION_S = 8.0
PULSE_SAMPLES = 5
"""Samples between two pulses: 40 Hz; a pulse width holds until the next pulse."""
SHAPES = ("step", "hold", "staircase", "ramp", "sine", "train", "train", "steps")


def times() -> np.ndarray:
    """Sample times of a trial, shape (n,), s."""
    return np.arange(round(DURATION_S / DT)) * DT


def level(rng: np.random.Generator, shape: str) -> np.ndarray:
    """Levels from 0 to 1, zero for the first 0.4 s, held from pulse to pulse.

    Returns
    -------
    ndarray, shape (n,)
    """
    t = times()
    begin = rng.uniform(0.4, 0.9)
    active = np.maximum(t - begin, 0.0) / (t[-1] - begin)
    out = _SHAPES[shape](rng, active, t)
    out = np.where(t < begin, 0.0, np.clip(out, 0.0, 1.0))
    if shape in ("ramp", "sine"):
        return np.repeat(out[::PULSE_SAMPLES], PULSE_SAMPLES)[: len(t)]
    return out


def _step(rng: np.random.Generator, active: np.ndarray, t: np.ndarray) -> np.ndarray:
    return np.where(active < rng.uniform(0.4, 0.6), rng.uniform(0.3, 0.9), 0.0)


def _hold(rng: np.random.Generator, active: np.ndarray, t: np.ndarray) -> np.ndarray:
    return np.where(active < 0.85, rng.uniform(0.6, 0.95), 0.0)


def _staircase(rng: np.random.Generator, active: np.ndarray, t: np.ndarray) -> np.ndarray:
    count = int(rng.integers(3, 6))
    step = np.minimum(np.floor(active * (2 * count - 1)), 2 * count - 2)
    low, high = rng.uniform(0.15, 0.35), rng.uniform(0.75, 0.95)
    return low + (high - low) * (1.0 - np.abs(step - (count - 1)) / (count - 1))


def _ramp(rng: np.random.Generator, active: np.ndarray, t: np.ndarray) -> np.ndarray:
    return rng.uniform(0.7, 1.05) * (1.0 - np.abs(2.0 * active - 1.0))


def _sine(rng: np.random.Generator, active: np.ndarray, t: np.ndarray) -> np.ndarray:
    middle, reach = rng.uniform(0.4, 0.55), rng.uniform(0.25, 0.4)
    return middle - reach * np.cos(2.0 * math.pi * rng.uniform(0.3, 1.2) * t)


def _train(rng: np.random.Generator, active: np.ndarray, t: np.ndarray) -> np.ndarray:
    out, at = np.zeros(len(t)), 0
    while at < len(t):
        end = at + PULSE_SAMPLES * int(rng.integers(8, 32))
        out[at:end] = rng.uniform(0.1, 1.0) if rng.random() < 0.7 else 0.0
        at = end
    return out


def _steps(rng: np.random.Generator, active: np.ndarray, t: np.ndarray) -> np.ndarray:
    count = int(rng.integers(3, 5))
    phase = active * count
    heights = rng.uniform(0.3, 0.95, count + 1)[np.floor(phase).astype(int)]
    return np.where(phase % 1.0 < 0.5, heights, 0.0)


_SHAPES = {
    "step": _step,
    "hold": _hold,
    "staircase": _staircase,
    "ramp": _ramp,
    "sine": _sine,
    "train": _train,
    "steps": _steps,
}


def pulse_widths(rng: np.random.Generator, shape: str, threshold: float, saturation: float) -> np.ndarray:
    """Pulse widths of a trial in us, to 0.1 us, shape (n,)."""
    share = level(rng, shape)
    return np.round(np.where(share > 0.0, threshold + share * (saturation - threshold), 0.0), 1)


def effort(rng: np.random.Generator, shape: str, largest: float) -> np.ndarray:
    """Commanded effort of a trial, shape (n,)."""
    return np.round(rng.choice((-1.0, 1.0)) * largest * level(rng, shape), 5)
