"""What else is said of a set of causes: whether it serves the other leg, its lack of fit, what could not be shown."""

import numpy as np

from fes_pin.infer.distributions import f_tail
from fes_pin.infer.levels import CLAIM_LEVEL, SEEN_DEVIATIONS
from fes_pin.infer.result import Remainder
from fes_pin.walk.designs import Designs
from fes_pin.walk.likelihood import FLOOR_N, by_frequency
from fes_pin.walk.models import WalkFit

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
    return Remainder(left, p_value, f"{CHANNELS[channel]}, {word}" if left else None)


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
