"""How torques are shared out without a program, and how far the torque that comes of it points another way."""

from __future__ import annotations

import numpy as np


def clipped(matrix: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Rule of thumb: least-squares recruitment without limits, then cut to 0 and 1."""
    return np.clip(np.linalg.lstsq(matrix, torque, rcond=None)[0], 0.0, 1.0)


def rescaled(matrix: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Rule of thumb: the same, negatives to 0, then all divided by the largest if that exceeds 1."""
    r = np.maximum(np.linalg.lstsq(matrix, torque, rcond=None)[0], 0.0)
    return r / max(1.0, r.max(initial=0.0))


def direction_error(wanted: np.ndarray, achieved: np.ndarray) -> np.ndarray:
    """Angle between wanted and achieved torque, rad, over the last axis; a quarter turn where nothing is achieved."""
    product = (wanted * achieved).sum(-1)
    size = np.linalg.norm(wanted, axis=-1) * np.linalg.norm(achieved, axis=-1)
    return np.arccos(np.clip(np.where(size > 0.0, product / np.where(size > 0.0, size, 1.0), 0.0), -1.0, 1.0))
