"""What is said of a set of causes: whether it serves the other leg, its lack of fit, what could not be shown, errors.

Errors in held-out strides are in newtons, and as evidence in units of the noise.
"""

from functools import cache, partial

import numpy as np

from fes_pin.infer.distributions import f_tail
from fes_pin.infer.held_out import Errors, added_likelihood, held_out_gain
from fes_pin.infer.levels import CLAIM_LEVEL, SEEN_DEVIATIONS
from fes_pin.infer.result import Evidence, Gain, Remainder
from fes_pin.walk.designs import Designs
from fes_pin.walk.likelihood import FLOOR_N, by_frequency, fit_many
from fes_pin.walk.models import WalkFit, WalkModels

WAVES = ("mean", "once a stride", "twice a stride")
CHANNELS = ("forward force", "leftward force", "vertical force", "moment about forward", "moment about left",
            "moment about vertical")  # fmt: skip


def other_leg(designs: Designs, one: WalkFit) -> float | None:
    """Return the gain in percent on one leg's single supports of sizes fitted to the other's; None without these.

    Channels are in units of the set's residual in them.
    """
    trials = designs.design(one.names).trials
    along = [np.dstack([trial.residual, designs.signals(one.names, trial)]) for trial in trials]
    left = np.concatenate(along) @ np.r_[1.0, -one.fitted.values]
    scale = 1.0 / np.maximum(np.sqrt(np.mean(left**2, axis=0)), FLOOR_N)
    legs: dict[str, list[np.ndarray]] = {"left": [], "right": []}
    for trial, both in zip(trials, along, strict=True):
        for side, rows in trial.plates.single_supports():
            legs[side].append((scale[:, None] * both[rows]).reshape(-1, both.shape[2]))
    if not all(legs.values()):
        return None
    one_leg, other = (np.concatenate(parts) for parts in legs.values())
    prior = designs.plausible(one.names)
    before, after = 0.0, 0.0
    for fitted, tested in ((one_leg, other), (other, one_leg)):
        values = prior * np.linalg.lstsq(fitted[:, 1:] * prior, fitted[:, 0], rcond=None)[0]
        before += float(np.sum(tested[:, 0] ** 2))
        after += float(np.sum((tested[:, 0] - tested[:, 1:] @ values) ** 2))
    return 100.0 * (before - after) / before


def lack_of_fit(designs: Designs, one: WalkFit) -> Remainder:
    """Test whether the residual of a set repeats in every stride, and find the channel and wave where it is largest.

    A single stride is compared with the residual of 1 mm of marker noise and of the plates.
    """
    y, x = designs.by_stride(one.names)
    read, _ = designs.by_stride(())
    n, waves = len(y), designs.strides.harmonics
    mean = (y - x @ one.fitted.values).mean(axis=0)
    apart = np.sum((read - read.mean(axis=0)) ** 2, axis=0) / max(n - 1, 1) / n
    spread = apart if n > 1 else by_frequency(np.mean(designs.shaken**2, axis=0), waves)
    near = np.abs(waves[:, None] - waves) <= 1
    ratio = mean**2 / (spread @ (near / near.sum(axis=0)) + FLOOR_N**2)
    free = ratio.size - one.degrees
    p_value = f_tail(float(ratio.sum()) / free, free, ratio.size * max(n - 1, 1))
    by_wave = np.array([ratio[:, waves == h].sum(axis=1) for h in np.unique(waves)]).T
    channel, wave = np.unravel_index(int(np.argmax(by_wave)), by_wave.shape)
    word = WAVES[wave] if wave < len(WAVES) else f"{wave} times a stride"
    left = p_value < CLAIM_LEVEL
    return Remainder(left, p_value, f"{CHANNELS[channel]}, {word}" if left else None, CLAIM_LEVEL)


def not_testable(designs: Designs, one: WalkFit) -> list[str]:
    """Return causes whose every form, at its plausible size, is significant by less than `SEEN_DEVIATIONS`."""

    def white(columns: np.ndarray) -> np.ndarray:
        return designs.whitened(np.moveaxis(columns[0], 2, 0), one.fitted.variance)

    basis, _ = np.linalg.qr(white(designs.columns(one.names)).T)
    best: dict[str, float] = {}
    for name, form in designs.forms.items():
        x = form.plausible * white(designs.as_read.x[name])
        size = float(np.linalg.norm(x - (x @ basis) @ basis.T, axis=1).max())
        best[form.cause] = max(best.get(form.cause, 0.0), size)
    found = {designs.forms[n].cause for n in one.names}
    if designs.strides.count > 1:  # differences between strides show noise
        found.add("marker_noise")
    return sorted(name for name, size in best.items() if size < SEEN_DEVIATIONS and name not in found)


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

    def likelihood(self, without: WalkFit, best: WalkFit) -> Evidence:
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
