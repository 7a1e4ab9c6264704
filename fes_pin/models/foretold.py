"""One trial as it was foretold, sample by sample: innovations, their variances, and what they cost."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fes_pin.models.autoregression import beginning, unforetold


class ForetoldOutput(NamedTuple):
    """What is foretold of an output, measured or not, and the variance of what it is off by if the model is right.

    Both have shape (n,).
    """

    values: np.ndarray
    variances: np.ndarray


@dataclass(frozen=True)
class ForetoldTrial:
    """One trial as it was foretold, sample by sample.

    Attributes
    ----------
    outputs
        The measured columns, in the order of the arrays.
    values
        Shape (n, outputs): measured minus foretold one sample ahead; 0 where that is not judged.
    variances
        Shape (n, outputs).
    seen
        Shape (n, outputs): True where something was measured that is judged: a reading that hunts between two counts is
        only followed, see `fes_pin.data.counts.hunts`.
    sensitivities
        Shape (n, outputs, columns): derivatives of `values`, for gains as they are.
    repeats
        Shape (n, outputs): how often the same count was read in a row, n; together they are one reading. 1 of what is
        not read in counts: what a log holds or interpolates stands for other reasons.
    noise
        Shape (n, outputs): variance of the noise of each in counts as it stands in `variances`, that of one times n.
    ar
        Autoregression of each output's `values` over their deviations; all are white if there is none.
    """

    outputs: tuple[str, ...]
    values: np.ndarray
    variances: np.ndarray
    seen: np.ndarray
    sensitivities: np.ndarray
    repeats: np.ndarray
    noise: np.ndarray
    ar: tuple[tuple[float, ...], ...] = ()

    def of_seen(self, array: np.ndarray) -> np.ndarray:
        """What is seen of an array of shape (n, outputs, ...), sample by sample; a view of it where that is all."""
        return array.reshape(-1, *array.shape[2:]) if self.seen.all() else array[self.seen]

    def cost(self) -> float:
        """Twice the negative log-likelihood, but for n log(2 pi); infinite where the prediction runs away."""
        with np.errstate(all="ignore"):
            total = float(np.sum(self.costs()))
        return total if math.isfinite(total) and bool((self.of_seen(self.variances) > 0).all()) else math.inf

    def costs(self) -> np.ndarray:
        """The cost of every reading that was seen, shape (m,)."""
        residual, logs = self.whitened()
        return np.asarray(residual**2 + logs)

    def _told_again(self) -> np.ndarray:
        """What the determinant holds of noise that was told before: n equal readings have n logarithms of one error."""
        again = 1.0 - 1.0 / self.of_seen(self.repeats)
        return np.asarray(again * np.log(self.of_seen(self.noise)) if again.any() else again)

    def whitened(self) -> tuple[np.ndarray, np.ndarray]:
        """Residuals over deviations and logarithms of variances; of what was seen."""
        logs = np.log(self.variances)
        for k, ar in enumerate(self.ar):
            first = np.log(beginning(ar)[1])[: len(logs)]
            logs[: len(first), k] += first
        return self.white(self.values), self.of_seen(logs) - self._told_again()

    def white(self, array: np.ndarray) -> np.ndarray:
        """What is seen of an array of shape (n, outputs, ...) over deviations, less what noise foretells of itself."""
        if not any(self.ar):
            out = self.of_seen(array) / np.sqrt(self.of_seen(self.variances)).reshape(-1, *[1] * (array.ndim - 2))
            return np.asarray(out)
        scale = np.where(self.seen, 1.0 / np.sqrt(self.variances), 0.0)
        out = array * scale.reshape(*scale.shape, *[1] * (array.ndim - 2))
        for k, ar in enumerate(self.ar):
            if ar:
                out[:, k] = unforetold(out[:, k], ar)
        return self.of_seen(out)
