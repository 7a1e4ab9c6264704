"""Projection of fitted parameters off columns, and the inner products of score tests.

C. R. Rao, Math. Proc. Camb. Phil. Soc. 44:50 (1948).
"""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from fes_pin.infer.problem import Linearized
from fes_pin.workers import in_parallel

LARGEST = float(np.finfo(float).max) ** 0.25
"""Largest entry of a column, so that products of inner products stay finite; a column that diverges has no score."""

B = TypeVar("B", bound=Hashable)

DEPENDENT = 1e-10
"""Relative eigenvalue of the Gram matrix of scaled columns below which these are linearly dependent."""


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


class BlockColumns(Generic[B]):
    """Columns that are each zero outside one block of trials, with the fitted parameters projected off.

    With c such a column, the unknowns of its trials projected off, and B the basis that all trials share, the projected
    column is c - B B'c. Two of them have the inner product c'd - (B'c)' (B'd), where c'd is 0 between blocks.
    A sum of columns of several blocks is given as the place in each block: block -> slice. All columns are added before
    products are asked for.

    Parameters
    ----------
    projection
        Of the fit.
    rows
        Rows of each block, by name: whole trials.
    """

    def __init__(self, projection: Projection, rows: Mapping[B, slice]) -> None:
        self._projection, self._rows = projection, rows
        self._pieces: dict[B, dict[int, tuple[slice, np.ndarray]]] = {name: {} for name in rows}

    def added(self, block: B, columns: np.ndarray) -> slice:
        """Return the place of columns of a block, shape (m of the block, any); an array is added once."""
        known = self._pieces[block]
        if id(columns) not in known:
            end = max((at.stop for at, _ in known.values()), default=0)
            known[id(columns)] = slice(end, end + columns.shape[1]), columns
        return known[id(columns)][0]

    @cached_property
    def _blocks(self) -> dict[B, _Block]:
        """The columns of each block that has some, with their inner products."""
        pieces = [(b, [columns for _, columns in known.values()]) for b, known in self._pieces.items() if known]
        made = in_parallel(lambda one: self._block(self._rows[one[0]], np.concatenate(one[1], axis=1)), pieces)
        return dict(zip((b for b, _ in pieces), made, strict=True))

    def _block(self, rows: slice, columns: np.ndarray) -> _Block:
        columns[~(np.abs(columns) < LARGEST)] = 0.0
        norms = np.linalg.norm(columns, axis=0)
        shared = np.zeros((self._projection.shared.shape[1], columns.shape[1]))
        for k, trial in enumerate(self._projection.trials):
            if rows.start <= trial.start < rows.stop:
                own = slice(trial.start - rows.start, trial.stop - rows.start)
                columns[own], part = self._projection.within(k, columns[own])
                shared += part
        return _Block(columns, columns.T @ columns, columns.T @ self._projection.residual[rows], norms, shared)

    def products(self, place: Mapping[B, slice]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return products of k sums of columns, shape (k, k), those with the residual, (k,), and norms before, (k,)."""
        each = [(self._blocks[b], at) for b, at in place.items()]
        shared = self._shared(place)
        gram = np.sum([one.gram[at, at] for one, at in each], axis=0) - shared.T @ shared
        along = np.sum([one.along[at] for one, at in each], axis=0)
        return gram, along, np.sqrt(np.sum([one.norms[at] ** 2 for one, at in each], axis=0))

    def _shared(self, place: Mapping[B, slice]) -> np.ndarray:
        """Return products of k sums of columns with the basis that all trials share, shape (rank, k)."""
        return np.asarray(np.sum([self._blocks[b].shared[:, at] for b, at in place.items()], axis=0))

    def gram(self, places: Sequence[Mapping[B, slice]]) -> tuple[np.ndarray, list[slice]]:
        """Return the Gram matrix of sums of columns, and the rows of each of the places."""
        shared = [self._shared(place) for place in places]
        joined = np.concatenate([np.zeros((self._projection.shared.shape[1], 0)), *shared], axis=1)
        blocks, out = slices(one.shape[1] for one in shared), -joined.T @ joined
        for name, block in self._blocks.items():
            own = [(rows, place[name]) for rows, place in zip(blocks, places, strict=True) if name in place]
            if own:
                here, there = (
                    np.concatenate([np.arange(s.start, s.stop) for s in many]) for many in zip(*own, strict=True)
                )
                out[np.ix_(here, here)] += block.gram[np.ix_(there, there)]
        return out, blocks

    def by_unit(self, places: Sequence[Mapping[B, slice]], units: Sequence[slice]) -> tuple[np.ndarray, np.ndarray]:
        """Return squares of the first projected column of each place, and products with the residual, by unit of rows.

        Returns
        -------
        two of ndarray, shape (units, places)
        """
        firsts = [{b: at.start for b, at in place.items()} for place in places]
        shared = np.stack([sum(self._blocks[b].shared[:, k] for b, k in one.items()) for one in firsts], axis=1)
        own = {b: np.array([(i, one[b]) for i, one in enumerate(firsts) if b in one]).T for b in self._blocks}
        sizes, along = np.zeros((2, len(units), len(places)))
        for u, cut in enumerate(units):
            moved = -self._projection.shared[cut] @ shared
            for b, (here, there) in own.items():
                begins = self._rows[b].start
                if begins <= cut.start < self._rows[b].stop:
                    moved[:, here] += self._blocks[b].columns[cut.start - begins : cut.stop - begins, there]
            sizes[u], along[u] = np.einsum("mi,mi->i", moved, moved), self._projection.residual[cut] @ moved
        return sizes, along


@dataclass(frozen=True)
class _Block:
    """Columns of a block with its trials' unknowns projected off, shape (m, k), and their inner products.

    Attributes
    ----------
    gram, along
        Shape (k, k) and (k,): with each other, and with the residual.
    norms
        Shape (k,): before the unknowns were projected off.
    shared
        Shape (rank, k): with the basis that all trials share.
    """

    columns: np.ndarray
    gram: np.ndarray
    along: np.ndarray
    norms: np.ndarray
    shared: np.ndarray


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
