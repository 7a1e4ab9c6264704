"""One-step predictions of one trial: innovations, their variances, and their cost."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fes_pin.models.autoregression import beginning, innovations_of


class PredictedOutput(NamedTuple):
    """Prediction of an output, measured or not, and the variance of its error by noise alone; shape (n,) each."""

    values: np.ndarray
    variances: np.ndarray


@dataclass(frozen=True)
class Readings:
    """The readings of one trial that enter the likelihood.

    Attributes
    ----------
    outputs
        The measured columns, in the order of the arrays.
    seen
        Shape (n, outputs): True where a measurement enters the likelihood. A reading that hunts between two counts does
        not: the filter follows it only, see `fes_pin.data.counts.hunts`.
    repeats
        Shape (n, outputs): number of equal counts in a row, n, which together are one reading. It is 1 for outputs that
        are not read in counts: a value that a log holds or interpolates is constant for other reasons.
    """

    outputs: tuple[str, ...]
    seen: np.ndarray
    repeats: np.ndarray

    @cached_property
    def all_seen(self) -> bool:
        """Whether every sample of every output enters the likelihood."""
        return bool(self.seen.all())

    @cached_property
    def places(self) -> slice | np.ndarray:
        """Where the seen entries lie among all, sample by sample: a slice where they follow each other."""
        at = np.flatnonzero(self.seen)
        return slice(at[0], at[-1] + 1) if len(at) and at[-1] - at[0] == len(at) - 1 else at

    @cached_property
    def again(self) -> np.ndarray:
        """Share of each seen reading's noise that repeats an earlier one, 1 - 1 / n, shape (m,)."""
        return np.asarray(1.0 - 1.0 / self.of_seen(self.repeats))

    @cached_property
    def repeated(self) -> np.ndarray:
        """Places, among the seen readings, of those whose noise repeats an earlier one."""
        return np.flatnonzero(self.again)

    def of_seen(self, array: np.ndarray) -> np.ndarray:
        """Return the seen entries of an array (n, outputs, ...), sample by sample; a view where `places` is a slice."""
        return np.asarray(array.reshape(self.seen.size, *array.shape[2:])[self.places])


@dataclass(frozen=True)
class PredictedTrial:
    """One-step predictions of one trial, sample by sample.

    Attributes
    ----------
    readings
        The readings that enter the likelihood.
    values
        Shape (n, outputs): innovations, measurements minus their one-step predictions; 0 where there is no reading.
    variances
        Shape (n, outputs): variances of the innovations.
    sensitivities
        Shape (n, outputs, columns): derivatives of the predictions, minus those of `values`, at constant filter gains.
    white
        Standard deviation of the measurement noise of each output.
    ar
        Autoregression of each output's standardised `values`; all are white if there is none.
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
        """Shape (n, outputs): True where a measurement enters the likelihood."""
        return self.readings.seen

    @property
    def repeated_noise(self) -> np.ndarray:
        """Variances of repeated noise, as they are in `variances`, by reading: the variance of one reading times n."""
        at = self.readings.repeated
        return np.asarray(self.of_seen(self.readings.repeats * np.square(self.white))[at]) if len(at) else np.zeros(0)

    def of_seen(self, array: np.ndarray) -> np.ndarray:
        """See `Readings.of_seen`."""
        return self.readings.of_seen(array)

    @cached_property
    def seen_variances(self) -> np.ndarray:
        """Variances of the seen readings, shape (m,)."""
        return np.ascontiguousarray(self.of_seen(self.variances))

    def cost(self) -> float:
        """Return twice the negative log-likelihood without n log(2 pi); infinite where the prediction diverges."""
        with np.errstate(all="ignore"):
            total = float(np.sum(self.costs()))
        return total if math.isfinite(total) and bool((self.seen_variances > 0).all()) else math.inf

    def costs(self) -> np.ndarray:
        """Return the cost of every seen reading, shape (m,)."""
        return np.asarray(self.whitened**2 + self.logarithms)

    @cached_property
    def whitened(self) -> np.ndarray:
        """Standardised innovations of the seen readings, shape (m,)."""
        return self.over_deviations(self.values)

    @cached_property
    def logarithms(self) -> np.ndarray:
        """Logarithms of the variances of the seen readings, shape (m,).

        n equal readings have one error, and the determinant has its logarithm n times: the repeated ones are
        subtracted.
        """
        logs = np.log(self.seen_variances)
        if any(self.ar):
            logs += self.of_seen(self._growth())
        at = self.readings.repeated
        logs[at] -= self.readings.again[at] * np.log(self.repeated_noise)
        return logs

    def _growth(self) -> np.ndarray:
        """Return logarithms of variances of the first innovations, predicted from fewer samples: (n, outputs)."""
        out = np.zeros(self.variances.shape)
        for k, ar in enumerate(self.ar):
            first = np.log(beginning(ar)[1])[: len(out)]
            out[: len(first), k] = first
        return out

    def over_deviations(self, array: np.ndarray) -> np.ndarray:
        """Return the seen entries of an array (n, outputs, ...), standardised and whitened by autoregressive noise."""
        out = self.standardised(array)
        for k, ar in enumerate(self.ar):
            if ar:
                out[:, k] = innovations_of(out[:, k], ar)
        return self.of_seen(out)

    def standardised(self, array: np.ndarray) -> np.ndarray:
        """Return an array (n, outputs, ...) in units of the deviations of the innovations; 0 where none is seen."""
        return np.asarray(array * self._scale.reshape(*self.seen.shape, *[1] * (array.ndim - 2)))

    @cached_property
    def _scale(self) -> np.ndarray:
        scale = 1.0 / np.sqrt(self.variances)
        return scale if self.readings.all_seen else np.where(self.seen, scale, 0.0)
