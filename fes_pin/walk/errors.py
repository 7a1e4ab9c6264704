"""Errors of sets of causes in held-out strides: in newtons, and as evidence in units of the noise."""

from functools import cache, partial

import numpy as np

from fes_pin.infer.held_out import Errors, added_likelihood, held_out_gain
from fes_pin.infer.result import Evidence, Gain
from fes_pin.walk.designs import Designs
from fes_pin.walk.likelihood import fit_many
from fes_pin.walk.models import WalkFit, WalkModels

ARM = 0.1
"""Arm by which moments are divided to count as forces, in standing heights (or 0.18 m): over half a foot's length."""


class StrideErrors:
    """Errors of sets of causes in every stride.

    Parameters
    ----------
    models
        The sets.
    """

    def __init__(self, models: WalkModels) -> None:
        self.models = models
        designs = models.designs
        height = designs.as_read.trials[0].motion.body.height_m or 1.8
        self._scale = np.r_[np.ones(3), np.full(3, 1.0 / (ARM * height))][:, None]
        self._residual = cache(partial(_residual_by_stride, designs))
        measured = designs.strides.coefficients([s.measured for s in designs.as_read.trials])
        about_mean = measured * (designs.strides.harmonics > 0)
        self._spread = np.sum((self._scale * about_mean) ** 2, axis=(1, 2))
        y, _ = designs.by_stride(())
        self._differs = np.sum((self._scale * (y - y.mean(axis=0))) ** 2, axis=0) / max(len(y) - 1, 1)

    def errors(self, one: WalkFit, held_out: bool) -> Errors:
        """Return squared errors of a set by stride, N^2, moments by `ARM`; noise is the variance between strides."""
        squares = np.sum((self._scale * self._residual(one, held_out)) ** 2, axis=(1, 2))
        alike = np.ones_like(squares)
        noise, scatter = float(np.sum(self._differs)), 2.0 * float(np.sum(self._differs**2))
        return Errors(squares, self._spread, noise * alike, scatter * alike)

    def error_percent(self, one: WalkFit) -> tuple[float, float | None]:
        """Return E on all strides, and on held-out strides; None for one stride."""
        held_out = self.errors(one, True).error_percent() if self.models.designs.strides.count > 1 else None
        return self.errors(one, False).error_percent(), held_out

    def gain(self, without: WalkFit, best: WalkFit, held_out: bool) -> Gain:
        """Return the share of the nominal error above the noise that a set removes, against a smaller set."""
        sets = (self.models.nominal(), without, best)
        nominal, before, after = (self.errors(one, held_out) for one in sets)
        return held_out_gain(nominal, before, after, self.models.designs.seed)

    def evidence(self, without: WalkFit, best: WalkFit) -> Evidence:
        """Return the evidence for a set in held-out strides, against a smaller set, with the set's noise.

        Ordinary errors of landmarks and plates in a session are nuisance parameters. The evidence is the mean over
        strides: soft tissue moves alike in each, so that more strides are no more evidence.
        """
        whitened, variance = self.models.designs.whitened, best.fitted.variance
        before, after = (whitened(self._residual(one, True), variance) for one in (without, best))
        every = [added_likelihood(*pair) for pair in zip(before, after, strict=True)]
        return Evidence(*np.mean([(e.added, e.squares) for e in every], axis=0).tolist())


def _residual_by_stride(designs: Designs, one: WalkFit, held_out: bool) -> np.ndarray:
    """Return the residual of a set in every stride, its sizes fitted to all strides or to the others: (n, 6, k)."""
    y, x = designs.by_stride(one.names)
    if not (one.names and held_out):
        return y - x @ one.fitted.values
    rest_y, rest_x = (designs.noise.rotated((v.sum(axis=0) - v) / (len(v) - 1))[:, None] for v in (y, x))
    fits = fit_many(rest_y, rest_x, np.tile(designs.plausible(one.names), (len(y), 1)), designs.noise)
    return y - np.array([columns @ fitted.values for columns, fitted in zip(x, fits, strict=True)])
