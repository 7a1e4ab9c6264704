"""What is claimed: gains on strides and stances that took no part, what is left, what could not be seen."""

from __future__ import annotations

import numpy as np
from scipy.stats import f as f_distribution

from fes_pin.infer.result import DEVIANCE, Gain
from fes_pin.walk.banks import Banks, Chosen
from fes_pin.walk.fits import Set
from fes_pin.walk.likelihood import FLOOR_N, by_frequency, fit_walk

ARM = 0.1
"""Moments count as forces at this arm, in standing heights (or 0.18 m): about a foot's half length and more."""
BOOTSTRAP = 400
SEEN = 3.0
"""Standard deviations that an effect of plausible size must have beside the nuisance to be testable."""
WAVES = ("mean", "once a stride", "twice a stride")
CHANNELS = ("forward force", "leftward force", "vertical force", "moment about forward", "moment about left",
            "moment about vertical")  # fmt: skip


def weights(banks: Banks) -> np.ndarray:
    """Scale of the six channels for errors: (6,); forces 1 / N, moments by `ARM`."""
    height = banks.recordings[0].motion.body.height_m or 1.8
    return np.r_[np.ones(3), np.full(3, 1.0 / (ARM * height))]


def per_stride(banks: Banks, chosen: Chosen) -> tuple[np.ndarray, np.ndarray]:
    """Residual (n, 6, k) and columns (n, 6, k, p) of a set, stride by stride."""
    bank = banks.bank(chosen)
    y = banks.strides.coefficients([s.residual[:, :, None] for s in bank.scenes])[..., 0]
    if not chosen:
        return y, np.zeros((*y.shape, 0))
    columns = [np.concatenate([banks.forms[i].columns(s) for i in chosen], axis=2) for s in bank.scenes]
    return y, banks.strides.coefficients(columns)


def left_by(banks: Banks, one: Set, held_out: bool) -> np.ndarray:
    """What a set leaves in every stride, its sizes fitted to all strides or to the others: (n, 6, k)."""
    y, x = per_stride(banks, one.forms)
    if not one.forms:
        return y
    if not held_out:
        return y - x @ one.fitted.values
    prior = np.array([size for i in one.forms for size in banks.forms[i].plausible])
    out = []
    for k in range(len(y)):
        others = np.arange(len(y)) != k
        mean_y, mean_x = (banks.noise.rotated(v[others].mean(axis=0, keepdims=True)) for v in (y, x))
        out.append(y[k] - x[k] @ fit_walk(mean_y, mean_x, prior, banks.noise).values)
    return np.array(out)


def walk_gain(banks: Banks, without: Set, with_it: Set, held_out: bool, seed: int) -> Gain:
    """What the second set removes of the first one's squared error, above what differs from stride to stride."""
    scale = weights(banks)[:, None]
    before, after = (np.sum((scale * left_by(banks, s, held_out)) ** 2, axis=1) for s in (without, with_it))
    y = per_stride(banks, ())[0]
    floor = np.zeros_like(before)
    if len(y) > 1:
        floor += np.sum((scale * (y - y.mean(axis=0))) ** 2, axis=(0, 1)) / (len(y) - 1)
    random = np.random.default_rng(seed)
    waves = banks.strides.harmonics
    parts = np.array([[v[:, waves == h].sum(axis=1) for v in (before, after, floor)] for h in np.unique(waves)])
    strides = random.integers(0, len(y), size=(BOOTSTRAP, len(parts), len(y)))  # anew for every wave
    drawn = np.stack([part[:, strides[:, h]].sum(axis=2) for h, part in enumerate(parts)]).sum(axis=0).T
    ratio = lambda s: 100.0 * (s[..., 0] - s[..., 1]) / np.maximum(s[..., 0] - s[..., 2], 0.05 * s[..., 0])  # noqa: E731
    low, high = np.quantile(ratio(drawn), [0.025, 0.975])
    return Gain(float(ratio(parts.sum(axis=(0, 2)))), float(low), float(high))


def walk_evidence(banks: Banks, without: Set, with_it: Set, seed: int) -> Gain:
    """By how much held-out strides are likelier with the second set's sizes than with the first's, in the same noise.

    Twice the log-likelihood a stride: what the nuisance may take, of landmarks and plates, counts for neither. In
    percent of what the first set leaves.
    """
    variance, nuisance = with_it.fitted.variance[0], banks.noise.nuisance[0]
    flat = nuisance.reshape(variance.size, -1) / np.sqrt(variance).reshape(-1, 1)
    inner = np.linalg.inv(np.eye(flat.shape[1]) + flat.T @ flat)

    def misfits(one: Set) -> np.ndarray:
        left = banks.noise.rotated(left_by(banks, one, held_out=True)) / np.sqrt(variance)
        white = left.reshape(len(left), -1)
        taken = white @ flat
        return np.sum(white**2, axis=1) - np.einsum("ni,ij,nj->n", taken, inner, taken)

    before, after = misfits(without), misfits(with_it)
    drawn = np.random.default_rng(seed).integers(0, len(before), size=(BOOTSTRAP, len(before)))
    shares = 100.0 * (before - after)[drawn].sum(axis=1) / before[drawn].sum(axis=1)
    low, high = np.quantile(shares, [0.025, 0.975])
    return Gain(float(100.0 * np.sum(before - after) / np.sum(before)), float(low), float(high), measure=DEVIANCE)


def walk_error_percent(banks: Banks, one: Set, held_out: bool) -> float:
    """E: squared error over the measured reaction's spread about its mean, all channels together."""
    scale = weights(banks)[:, None]
    measured = banks.strides.coefficients([s.measured[:, :, None] for s in banks.as_read.scenes])[..., 0]
    spread = np.sum((scale * measured[:, :, banks.strides.harmonics > 0]) ** 2)
    return float(100.0 * np.sum((scale * left_by(banks, one, held_out)) ** 2) / spread)


def floor_percent(banks: Banks) -> float:
    """E of what differs from stride to stride, which no model of the mean stride takes away; 0 for one stride."""
    y, scale = per_stride(banks, ())[0], weights(banks)[:, None]
    measured = banks.strides.coefficients([s.measured[:, :, None] for s in banks.as_read.scenes])[..., 0]
    spread = np.sum((scale * measured[:, :, banks.strides.harmonics > 0]) ** 2)
    share = len(y) / max(len(y) - 1, 1)
    return float(100.0 * share * np.sum((scale * (y - y.mean(axis=0))) ** 2) / spread)


def other_leg(banks: Banks, one: Set) -> float | None:
    """Gain in percent on one leg's single supports of sizes fitted to the other's; None where a leg has none.

    Channels count in units of what the set leaves in them.
    """
    left = []
    for scene in banks.bank(one.forms).scenes:
        columns = np.concatenate([banks.forms[i].columns(scene) for i in one.forms], axis=2)
        left.append(scene.residual - columns @ one.fitted.values)
    scale = 1.0 / np.maximum(np.sqrt(np.mean(np.concatenate(left) ** 2, axis=0)), FLOOR_N)
    before, after = 0.0, 0.0
    data: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {"left": [], "right": []}
    for scene in banks.bank(one.forms).scenes:
        x = np.concatenate([banks.forms[i].columns(scene) for i in one.forms], axis=2)
        for side, rows in scene.plates.single_supports():
            data[side].append((scene.residual[rows] * scale, x[rows] * scale[:, None]))
    if not all(data.values()):
        return None
    prior = np.array([size for i in one.forms for size in banks.forms[i].plausible])
    for fitted, tested in (("left", "right"), ("right", "left")):
        y, x = (np.concatenate([d[k] for d in data[fitted]]) for k in (0, 1))
        flat = x.reshape(-1, x.shape[2]) * prior
        values = prior * np.linalg.lstsq(flat, y.ravel(), rcond=None)[0]
        y, x = (np.concatenate([d[k] for d in data[tested]]) for k in (0, 1))
        before, after = before + float(np.sum(y**2)), after + float(np.sum((y - x @ values) ** 2))
    return 100.0 * (before - after) / before


def walk_remainder(banks: Banks, one: Set) -> tuple[float, str | None]:
    """Whether what is left comes again in every stride: p-value, and the channel and wave where it is largest.

    For one stride there is nothing to compare with; what a millimetre of marker noise and the plates make is taken.
    """
    left = left_by(banks, one, held_out=False)
    y = per_stride(banks, ())[0]
    n, waves = len(left), banks.strides.harmonics
    mean = left.mean(axis=0)
    apart = np.sum((y - y.mean(axis=0)) ** 2, axis=0) / max(n - 1, 1) / n
    spread = apart if n > 1 else by_frequency(np.mean(banks.shaken**2, axis=0), waves)
    smooth = spread.copy()
    for h in np.unique(waves):
        near = np.abs(waves - h) <= 1
        smooth[:, waves == h] = spread[:, near].mean(axis=1, keepdims=True)
    smooth += 0.3**2
    free = 6 * len(waves) - sum(len(banks.forms[i].parameters) for i in one.forms)
    ratio = mean**2 / smooth
    p_value = float(f_distribution.sf(ratio.sum() / free, free, max(6 * len(waves) * (n - 1), 6 * len(waves))))
    by_wave = np.array([[ratio[c, waves == h].sum() for h in np.unique(waves)] for c in range(6)])
    channel, wave = np.unravel_index(int(np.argmax(by_wave)), by_wave.shape)
    word = WAVES[wave] if wave < len(WAVES) else f"{wave} times a stride"
    return p_value, f"{CHANNELS[channel]}, {word}"


def unseen(banks: Banks, one: Set) -> list[str]:
    """Causes whose every form, at its plausible size, stands out of noise and nuisance by less than `SEEN`."""
    noise, variance = banks.noise, one.fitted.variance
    root = 1.0 / np.sqrt(variance).ravel()
    chosen = banks.columns(one.forms) if one.forms else np.zeros((*variance.shape, 0))
    taken = np.concatenate([noise.nuisance, chosen], axis=3).reshape(variance.size, -1) * root[:, None]
    ridge = np.diag(np.r_[np.ones(noise.nuisance.shape[3]), np.zeros(chosen.shape[3])])
    best: dict[str, float] = {}
    for i, form in enumerate(banks.forms):
        x = banks.noise.rotated(banks.as_read.x[i]).reshape(variance.size, -1) * root[:, None]
        x = x * np.array(form.plausible)
        kept = x - taken @ np.linalg.solve(taken.T @ taken + ridge + 1e-12 * np.eye(len(ridge)), taken.T @ x)
        best[form.cause] = max(best.get(form.cause, 0.0), float(np.sqrt(max(np.sum(kept * x, axis=0).max(), 0.0))))
    found = set(banks.causes(one.forms))
    if banks.strides.count > 1:  # what differs from stride to stride shows noise
        found.add("marker_noise")
    return sorted(name for name, size in best.items() if size < SEEN and name not in found)
