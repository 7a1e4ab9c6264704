"""Noise of the residuals without any part that the causes of a library could explain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from fes_pin.identify.fit import Fit
from fes_pin.identify.problem import Problem
from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.infer.noise import Noise, estimate_noise, thinning


def rich_noise(
    fitted: Fit,
    white: dict[str, Noise],
    columns: Sequence[np.ndarray],
    varying: Sequence[Sequence[np.ndarray]] = (),
) -> dict[str, Noise]:
    """Return autoregressive noise of the residuals without any part that the columns could explain.

    Parameters
    ----------
    fitted
        A fit under any noise.
    white
        White noise by output column, by which the columns are scaled.
    columns
        Sensitivities scaled by `white`, shape (m, k) each, all trials end to end.
    varying
        For each effect that can differ between trials, such columns for each of its shapes. The best shape is projected
        off trial by trial if it improves the penalised likelihood.
    """
    problem = Problem(fitted.model, fitted.trials, white, fitted.free)
    parts = problem.linearize(fitted.values, fitted.unknowns)
    residual = np.concatenate([p.residual for p in parts])
    explain = [np.concatenate([p.jacobian for p in parts]), *columns, block_diag(*(p.local for p in parts))]
    basis = span(np.concatenate([c for c in explain if c.shape[1]], axis=1))
    left = residual - basis @ (basis.T @ residual)
    for shapes in varying:
        left = left - _of_each_trial(left, shapes, [len(p.residual) for p in parts])
    at = 0
    channels: dict[str, list[np.ndarray]] = {}
    for trial in fitted.trials:
        for name in fitted.model.rig.outputs(trial.kind):
            if name in trial.columns and name in white:
                count = len(trial) // thinning(trial.dt, white[name].step_s)
                piece = left[at : at + count] * white[name].innovation_std
                at += count
                channels.setdefault(name, []).append(piece)
    share = {n: basis.shape[1] * sum(map(len, v)) // max(len(left), 1) for n, v in channels.items()}
    return {n: estimate_noise(v, share[n], white[n].std, white[n].step_s) for n, v in channels.items()}


def _of_each_trial(left: np.ndarray, shapes: Sequence[np.ndarray], counts: Sequence[int]) -> np.ndarray:
    """Return the part that the best of several shapes explains with amplitudes of each trial's own, or zeros."""
    best, most = np.zeros_like(left), 0.0
    ends = np.cumsum(counts)
    for columns in shapes:
        explained, rank = np.zeros_like(left), 0
        for end, count in zip(ends, counts, strict=True):
            rows = slice(end - count, end)
            if columns[rows].any():
                basis = span(columns[rows])
                explained[rows] = basis @ (basis.T @ left[rows])
                rank += basis.shape[1]
        worth = float(explained @ explained) - PARAMETER_PENALTY * rank
        if worth > most:
            best, most = explained, worth
    return best


def span(columns: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the span of columns of shape (m, k), shape (m, rank)."""
    norms = np.linalg.norm(columns, axis=0)
    good = (norms > 0) & np.isfinite(norms)
    scaled = columns[:, good] / norms[good]
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    kept = values > 1e-9 * max(values.max(initial=0.0), 1e-300)
    return (scaled @ vectors[:, kept]) / np.sqrt(values[kept])
