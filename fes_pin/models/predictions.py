"""One-step predictions of one trial: innovations, their variances, and their cost."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fes_pin.models.autoregression import beginning, innovations_of


class PredictedOutput(NamedTuple):
    """Prediction of an output, measured or not, and the variance of its error if the model is right.

    Both have shape (n,).
    """

    values: np.ndarray
    variances: np.ndarray


@dataclass(frozen=True)
class Readings:
    """The readings of one trial, whatever their prediction.

    Attributes
    ----------
    outputs
        The measured columns, in the order of the arrays.
    seen
        Shape (n, outputs): True where something was measured that is judged: a reading that hunts between two counts is
        only followed, see `fes_pin.data.counts.hunts`.
    repeats
        Shape (n, outputs): how often the same count was read in a row, n; together they are one reading. 1 for outputs
        that are not read in counts: a value that a log holds or interpolates is constant for other reasons.
    """

    outputs: tuple[str, ...]
    seen: np.ndarray
    repeats: np.ndarray

    @cached_property
    def all_seen(self) -> bool:
        """Whether every sample of every output is judged."""
        return bool(self.seen.all())

    @cached_property
    def again(self) -> np.ndarray:
        """Share of each reading's noise that repeats an earlier one, 1 - 1 / n, shape (m,) of what is seen."""
        return np.asarray(1.0 - 1.0 / self.of_seen(self.repeats))

    @cached_property
    def repeated(self) -> np.ndarray:
        """Places, among what is seen, of readings whose noise repeats an earlier one."""
        return np.flatnonzero(self.again)

    def of_seen(self, array: np.ndarray) -> np.ndarray:
        """What is seen of an array of shape (n, outputs, ...), sample by sample; a view of it where that is all."""
        return array.reshape(self.seen.size, *array.shape[2:]) if self.all_seen else array[self.seen]


@dataclass(frozen=True)
class PredictedTrial:
    """One-step predictions of one trial, sample by sample.

    Attributes
    ----------
    readings
        What was measured.
    values
        Shape (n, outputs): measurements minus their one-step predictions; 0 where that is not judged.
    variances
        Shape (n, outputs).
    sensitivities
        Shape (n, outputs, columns): derivatives of `values`, for gains as they are.
    white
        Deviation of the reading noise of each output.
    ar
        Autoregression of each output's `values` over their deviations; all are white if there is none.
    """

    readings: Readings
    values: np.ndarray
    variances: np.ndarray
    sensitivities: np.ndarray
    white: tuple[float, ...]
    ar: tuple[tuple[float, ...], ...] = ()

    @property
    def outputs(self) -> tuple[str, ...]:
        """The measured columns, in the order of the arrays."""
        return self.readings.outputs

    @property
    def seen(self) -> np.ndarray:
        """Shape (n, outputs): True where something was measured that is judged."""
        return self.readings.seen

    @property
    def repeated_noise(self) -> np.ndarray:
        """Variances of repeated noise as `variances` holds them, by reading: the variance of one reading times n."""
        at = self.readings.repeated
        return np.asarray(self.of_seen(self.readings.repeats * np.square(self.white))[at]) if len(at) else np.zeros(0)

    def of_seen(self, array: np.ndarray) -> np.ndarray:
        """See `Readings.of_seen`."""
        return self.readings.of_seen(array)

    @cached_property
    def seen_variances(self) -> np.ndarray:
        """Variances of what was seen, shape (m,)."""
        return np.ascontiguousarray(self.of_seen(self.variances))

    def cost(self) -> float:
        """Twice the negative log-likelihood, but for n log(2 pi); infinite where the prediction runs away."""
        with np.errstate(all="ignore"):
            total = float(np.sum(self.costs()))
        return total if math.isfinite(total) and bool((self.seen_variances > 0).all()) else math.inf

    def costs(self) -> np.ndarray:
        """The cost of every reading that was seen, shape (m,)."""
        residual, logs = self.whitened
        return np.asarray(residual**2 + logs)

    @cached_property
    def whitened(self) -> tuple[np.ndarray, np.ndarray]:
        """Residuals over deviations and logarithms of variances; of what was seen.

        n equal readings have one error, and the determinant holds its logarithm n times: the repeated ones are taken
        off.
        """
        logs = np.log(self.seen_variances)
        if any(self.ar):
            logs += self.of_seen(self._growth())
        at = self.readings.repeated
        logs[at] -= self.readings.again[at] * np.log(self.repeated_noise)
        return self.over_deviations(self.values), logs

    def _growth(self) -> np.ndarray:
        """Logarithms of variances of the first innovations, which have fewer samples before them: (n, outputs)."""
        out = np.zeros(self.variances.shape)
        for k, ar in enumerate(self.ar):
            first = np.log(beginning(ar)[1])[: len(out)]
            out[: len(first), k] = first
        return out

    def over_deviations(self, array: np.ndarray) -> np.ndarray:
        """What is seen of an array (n, outputs, ...) over deviations, less its prediction by autoregressive noise."""
        if not any(self.ar):
            deviations = self._deviations.reshape(-1, *[1] * (array.ndim - 2))
            return np.asarray(self.of_seen(array) / deviations)
        scale = np.where(self.seen, 1.0 / np.sqrt(self.variances), 0.0)
        out = array * scale.reshape(*scale.shape, *[1] * (array.ndim - 2))
        for k, ar in enumerate(self.ar):
            if ar:
                out[:, k] = innovations_of(out[:, k], ar)
        return self.of_seen(out)

    @cached_property
    def _deviations(self) -> np.ndarray:
        return np.sqrt(self.seen_variances)
