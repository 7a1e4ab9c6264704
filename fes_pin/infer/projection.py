"""Projection of columns off a fit, and the inner products that score tests are made of.

C. R. Rao, Math. Proc. Camb. Phil. Soc. 44:50 (1948).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.infer.problem import Linearized
from fes_pin.workers import in_parallel

LARGEST = float(np.finfo(float).max) ** 0.25
"""Largest entry of a column: products of inner products stay floating-point numbers. What runs away says nothing."""

DEPENDENT = 1e-10
"""Eigenvalue of the Gram matrix of scaled columns, relative to the largest, below which one depends on the others."""


@dataclass(frozen=True)
class Products:
    """Inner products of columns without the part that a fit takes up.

    Attributes
    ----------
    gram
        Shape (k, k).
    along
        Shape (k,): with the residual.
    before
        Shape (k,): squared norms of the whole columns.
    by_trial
        Columns of each trial without what its own unknowns take up.
    """

    gram: np.ndarray
    along: np.ndarray
    before: np.ndarray
    by_trial: list[np.ndarray]


class Projection:
    """Columns without the part that a fit's parameters and its trials' unknowns take up.

    Parameters
    ----------
    parts
        Of the fit.

    Attributes
    ----------
    residual
        What the fit leaves, all trials end to end, shape (m,).
    trials
        Rows of each trial.
    shared
        Orthonormal basis of what the parameters take up, shape (m, rank).
    """

    def __init__(self, parts: Sequence[Linearized]) -> None:
        ends = np.cumsum([0, *(len(p.residual) for p in parts)])
        self.trials = [slice(a, b) for a, b in itertools.pairwise(ends)]
        self._own = [local_basis(p) for p in parts]
        self.shared = _basis(self._without_locals(np.concatenate([p.jacobian for p in parts])))
        self.residual = self(np.concatenate([p.residual for p in parts])[:, None])[:, 0]

    def _without_locals(self, columns: np.ndarray) -> np.ndarray:
        out = np.array(columns, dtype=float)
        for own, rows in zip(self._own, self.trials, strict=True):
            out[rows] -= own @ (own.T @ out[rows])
        return out

    def __call__(self, columns: np.ndarray) -> np.ndarray:
        """Columns of shape (m, k) without the part that the fit could take up."""
        partly = self._without_locals(columns)
        return np.asarray(partly - self.shared @ (self.shared.T @ partly))

    def taken(self, rows: slice) -> list[np.ndarray]:
        """Orthonormal vectors, cut to rows of one trial, that are taken from columns which are zero elsewhere."""
        own = [
            basis[rows.start - where.start : rows.stop - where.start]
            for basis, where in zip(self._own, self.trials, strict=True)
            if where.start <= rows.start and rows.stop <= where.stop
        ]
        return [*own, self.shared[rows]]

    def products(self, columns: Sequence[np.ndarray]) -> Products:
        """Inner products of columns, each of shape (m, any), trial by trial."""
        begun = in_parallel(lambda k: self._partly(columns, k), range(len(self.trials)))
        before, shared = (np.sum([b[j] for b in begun], axis=0) for j in (1, 2))
        left = in_parallel(lambda k: self._left(begun[k][0], shared, k), range(len(self.trials)))
        gram, along = (np.sum([one[j] for one in left], axis=0) for j in (0, 1))
        return Products(gram, along, before, [b[0] for b in begun])

    def _partly(self, columns: Sequence[np.ndarray], k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """One trial's part of all columns without what its own unknowns take up; what it was, squared; its share in
        the inner products with the basis of what all trials share."""
        rows, own = self.trials[k], self._own[k]
        joined = np.concatenate([c[rows] for c in columns], axis=1)
        joined[~(np.abs(joined) < LARGEST)] = 0.0
        before = np.einsum("mi,mi->i", joined, joined)
        joined -= own @ (own.T @ joined)
        return joined, before, self.shared[rows].T @ joined

    def _left(self, partly: np.ndarray, shared: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """One trial's part of the Gram matrix of projected columns, and of their products with the residual."""
        left = partly - self.shared[self.trials[k]] @ shared
        return left.T @ left, left.T @ self.residual[self.trials[k]]


def local_basis(part: Linearized) -> np.ndarray:
    """Orthonormal basis of what a trial's own unknowns take up, shape (m, unknowns that are felt)."""
    return np.linalg.qr(_scaled(part.local[:, part.local.any(axis=0)]))[0]


def without_locals(part: Linearized, columns: np.ndarray) -> np.ndarray:
    """Columns of a trial, shape (m, ...), without what its own unknowns take up."""
    own = local_basis(part)
    return np.asarray(columns - own @ (own.T @ columns))


def _scaled(columns: np.ndarray) -> np.ndarray:
    norms = np.linalg.norm(columns, axis=0)
    return np.asarray(columns / np.where(norms > 0, norms, 1.0))


def _basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the span of columns, shape (m, rank)."""
    if not columns.shape[1]:
        return columns
    scaled = _scaled(columns)
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    good = values > DEPENDENT * max(values[-1], 1e-300)
    rough = (scaled @ vectors[:, good]) / np.sqrt(values[good])
    return np.asarray(np.linalg.qr(rough)[0]) if good.any() else columns[:, :0]
