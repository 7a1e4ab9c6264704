"""Projection of fitted parameters off columns, and the inner products of score tests.

C. R. Rao, Math. Proc. Camb. Phil. Soc. 44:50 (1948).
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.infer.problem import Linearized
from fes_pin.workers import in_parallel

LARGEST = float(np.finfo(float).max) ** 0.25
"""Largest entry of a column, so that products of inner products stay finite; a column that diverges has no score."""

DEPENDENT = 1e-10
"""Relative eigenvalue of the Gram matrix of scaled columns below which these are linearly dependent."""


@dataclass(frozen=True)
class Products:
    """Inner products of columns with the fitted parameters projected off.

    Attributes
    ----------
    gram
        Shape (k, k).
    along
        Shape (k,): inner products with the residual.
    before
        Shape (k,): squared norms of the columns before projection.
    by_trial
        Columns of each trial with its own unknowns projected off.
    """

    gram: np.ndarray
    along: np.ndarray
    before: np.ndarray
    by_trial: list[np.ndarray]


class Projection:
    """Projection of a fit's parameters and its trials' unknowns off columns.

    Parameters
    ----------
    parts
        The linearized trials of the fit.

    Attributes
    ----------
    residual
        Residual of the fit, all trials end to end, shape (m,).
    trials
        Rows of each trial.
    shared
        Orthonormal basis of the sensitivities to the parameters, shape (m, rank).
    """

    def __init__(self, parts: Sequence[Linearized]) -> None:
        self.trials = slices(len(p.residual) for p in parts)
        self._own = [local_basis(p) for p in parts]
        self.shared = _basis(self._without_locals(np.concatenate([p.jacobian for p in parts])))
        self.residual = self(np.concatenate([p.residual for p in parts])[:, None])[:, 0]

    def _without_locals(self, columns: np.ndarray) -> np.ndarray:
        out = np.array(columns, dtype=float)
        for own, rows in zip(self._own, self.trials, strict=True):
            out[rows] -= own @ (own.T @ out[rows])
        return out

    def __call__(self, columns: np.ndarray) -> np.ndarray:
        """Return columns of shape (m, k) with the fitted parameters projected off."""
        partly = self._without_locals(columns)
        return np.asarray(partly - self.shared @ (self.shared.T @ partly))

    def within(self, k: int, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return columns that are zero outside trial k, of shape (m_k, any), with the trial's unknowns projected off.

        The second array holds their inner products with the basis that all trials share, shape (rank, any).
        """
        own = self._own[k]
        left = columns - own @ (own.T @ columns)
        return left, self.shared[self.trials[k]].T @ left

    def taken(self, rows: np.ndarray) -> list[np.ndarray]:
        """Return the orthonormal vectors, cut to rows of one trial, that are projected off columns of that trial."""
        own = [
            basis[rows - where.start]
            for basis, where in zip(self._own, self.trials, strict=True)
            if where.start <= rows[0] < where.stop
        ]
        return [*own, self.shared[rows]]

    def products(self, columns: Sequence[np.ndarray]) -> Products:
        """Return inner products of columns, each of shape (m, any), computed trial by trial."""
        begun = in_parallel(lambda k: self._partly(columns, k), range(len(self.trials)))
        before, shared = (np.sum([b[j] for b in begun], axis=0) for j in (1, 2))
        left = in_parallel(lambda k: self._left(begun[k][0], shared, k), range(len(self.trials)))
        gram, along = (np.sum([one[j] for one in left], axis=0) for j in (0, 1))
        return Products(gram, along, before, [b[0] for b in begun])

    def _partly(self, columns: Sequence[np.ndarray], k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return one trial's part of all columns with its own unknowns projected off, its squared norm before, and its
        part of the inner products with the basis that all trials share."""
        joined = np.concatenate([c[self.trials[k]] for c in columns], axis=1)
        joined[~(np.abs(joined) < LARGEST)] = 0.0
        left, shared = self.within(k, joined)
        return left, np.einsum("mi,mi->i", joined, joined), shared

    def _left(self, partly: np.ndarray, shared: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Return one trial's part of the Gram matrix of projected columns, and of their products with the residual."""
        left = partly - self.shared[self.trials[k]] @ shared
        return left.T @ left, left.T @ self.residual[self.trials[k]]


def slices(lengths: Iterable[int]) -> list[slice]:
    """Return where pieces of these lengths lie, end to end."""
    return [slice(a, b) for a, b in itertools.pairwise(itertools.accumulate(lengths, initial=0))]


def local_basis(part: Linearized) -> np.ndarray:
    """Return an orthonormal basis of the sensitivities to a trial's own unknowns, shape (m, rank)."""
    return np.linalg.qr(_scaled(part.local[:, part.local.any(axis=0)]))[0]


def without_locals(part: Linearized, columns: np.ndarray) -> np.ndarray:
    """Return columns of a trial, shape (m, ...), with its own unknowns projected off."""
    own = local_basis(part)
    return np.asarray(columns - own @ (own.T @ columns))


def _scaled(columns: np.ndarray) -> np.ndarray:
    norms = np.linalg.norm(columns, axis=0)
    return np.asarray(columns / np.where(norms > 0, norms, 1.0))


def _basis(columns: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the span of columns, shape (m, rank)."""
    if not columns.shape[1]:
        return columns
    scaled = _scaled(columns)
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    good = values > DEPENDENT * max(values[-1], 1e-300)
    rough = (scaled @ vectors[:, good]) / np.sqrt(values[good])
    return np.asarray(np.linalg.qr(rough)[0]) if good.any() else columns[:, :0]
