"""Joint scores of two causes: two that oppose each other explain together what neither explains alone.

The gain of two blocks of columns C_i and C_j in a linear regression of a residual r, all parameters of the fit
projected off, is that of C_i and that of C_j with C_i projected off as well. With G = C'C and b = C'r for the columns
of all causes, no pair needs a fit.

Source: Miller, Subset Selection in Regression, 2nd ed., 2002, section 3.7: exhaustive searches of small subsets.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np

CONFOUNDED = 1e-6
"""Share of the squares of a block below which others take its place, as in the score of a single cause."""


class Pair(NamedTuple):
    """Two blocks of columns, by their numbers, their joint gain in twice the log-likelihood, and the sizes of each."""

    one: int
    other: int
    gain: float
    sizes: tuple[np.ndarray, np.ndarray]


def joint_scores(residual: np.ndarray, blocks: Sequence[np.ndarray], squares: Sequence[float]) -> Iterator[Pair]:
    """Yield the joint score of each two blocks that are not confounded.

    Parameters
    ----------
    residual
        Of the fit, shape (m,).
    blocks
        Columns with the fitted parameters projected off, shape (m, amplitudes) each.
    squares
        Sum of squares of each block before that.
    """
    ends = [0, *accumulate(one.shape[1] for one in blocks)]
    at, columns = [slice(*two) for two in pairwise(ends)], np.concatenate(blocks, axis=1)
    gram, slope = columns.T @ columns, columns.T @ residual

    def is_seen(k: int, inner: np.ndarray) -> bool:
        return bool(np.trace(inner) > CONFOUNDED * squares[k])

    for i, own in enumerate(at):
        if not is_seen(i, gram[own, own]):
            continue
        inverse = np.linalg.pinv(gram[own, own], rcond=1e-9, hermitian=True)
        left, rest = gram - gram[:, own] @ inverse @ gram[own], slope - gram[:, own] @ inverse @ slope[own]
        alone = float(slope[own] @ inverse @ slope[own])
        for j in range(i + 1, len(at)):
            other = at[j]
            if not is_seen(j, left[other, other]):
                continue
            size = np.linalg.pinv(left[other, other], rcond=1e-9, hermitian=True) @ rest[other]
            first = inverse @ (slope[own] - gram[own, other] @ size)
            yield Pair(i, j, alone + float(rest[other] @ size), (first, size))
