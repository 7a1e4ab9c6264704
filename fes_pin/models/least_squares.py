"""Linear least squares that does not fail for columns of extreme sizes."""

import numpy as np


def least_squares(columns: np.ndarray, wanted: np.ndarray, rcond: float = 1e-9) -> np.ndarray:
    """Return the shortest x, in units of the columns' sizes, that minimises |`columns @ x - wanted`|.

    Columns are first scaled to a largest entry of 1: squares of huge sensitivities, as of a joint that falls, would
    overflow, and the singular value decomposition would fail.

    Parameters
    ----------
    columns
        Shape (m, k).
    wanted
        Shape (m,).
    rcond
        Singular values below this share of the largest count as zero.

    Returns
    -------
    ndarray
        Shape (k,); zero for a column that is zero or not finite, and all zero where `wanted` is not finite.
    """
    out = np.zeros(columns.shape[1])
    size = np.abs(columns).max(axis=0, initial=0.0)
    good = np.isfinite(size) & (size > 0.0)
    most = float(np.abs(wanted).max(initial=0.0))
    if not good.any() or not np.isfinite(most) or not most > 0.0:
        return out
    solved = np.linalg.lstsq(columns[:, good] / size[good], wanted / most, rcond=rcond)[0]
    with np.errstate(over="ignore"):
        step = solved * (most / size[good])
    out[good] = np.where(np.isfinite(step), step, 0.0)
    return out
