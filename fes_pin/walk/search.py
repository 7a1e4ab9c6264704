"""The search for sets of causes: every form beside every other, by one likelihood with a price for each parameter."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fes_pin.body.build import GRAVITY
from fes_pin.walk.disturb import compressed, disturbed_waves, misplaced, tissue, white
from fes_pin.walk.effect import Form
from fes_pin.walk.effects import EFFECTS
from fes_pin.walk.likelihood import (
    MEAN_ARM_M,
    MEAN_FORCE,
    MEAN_TWIST_NM,
    Fitted,
    WalkNoise,
    fit_many,
    fit_walk,
    fitted_of,
    rotation,
)
from fes_pin.walk.nulls import Nulls
from fes_pin.walk.recording import WalkRecording
from fes_pin.walk.scene import Scene, scene_of
from fes_pin.walk.strides import Strides, strides_of
from fes_pin.workers import OutOfTime, check_limit

BEAM = 4
"""Sets of one size that are carried on."""
MOST = 3
"""Causes in a set, at most."""
SIMULATED = 100
"""Residuals without a cause that the critical value is taken from."""
LEVEL = 1e-4
"""Chance that anything is named where nothing is wrong, over the whole library, in soft tissue as it is simulated. That
is one law among many, and the channels' rotation has seen the data: what is counted in walks made otherwise is more."""
SEPARABLE = 6.0
"""Twice the log-likelihood by which a rival must fall short: odds of 20 to 1."""
SIMULATED_ROUNDS = 4
TOGETHER = 64
"""Fits that are made at once: as many as a processor's cache holds."""
TISSUE_DRAWS, WHITE_DRAWS = 40, 64
FLOOR_SHARE = 0.3
"""Of the fitted noise beside soft tissue's, as amplitudes."""
TAKEN = 0.3
"""Share of a wave of the required reaction that errors in the motion may make, as a standard deviation: soft tissue
moves by 10 mm and more where a trunk moves by 20 to 40 (A. Leardini et al., Gait Posture 21:212, 2005)."""
POSSIBLE = 3.0
"""Sizes beyond this many times the plausible one are no explanation."""
SHIFT_ROUNDS = 4
"""Of following a shift of the clock."""

Chosen = tuple[int, ...]


@dataclass(frozen=True)
class Bank:
    """Residual and columns of every form, (1, 6, k, ...) in the mean stride, for plates read `later_s` late."""

    scenes: list[Scene] = field(repr=False)
    y: np.ndarray = field(repr=False)
    x: list[np.ndarray] = field(repr=False)
    later_s: float = 0.0


@dataclass(frozen=True)
class Set:
    """A set of forms with its fit; its price is its deviance: sizes are integrated over their priors."""

    forms: Chosen
    fitted: Fitted = field(repr=False)
    price: float


def walk_library() -> tuple[Form, ...]:
    """Every form of every cause."""
    return tuple(form for effect in EFFECTS for form in effect.forms())


class WalkSearch:
    """One diagnosis's fits."""

    def __init__(self, recordings: Sequence[WalkRecording], cutoff_hz: float, seed: int = 0) -> None:
        self.recordings, self.cutoff_hz, self.seed = list(recordings), cutoff_hz, seed
        self.forms = walk_library()
        scenes = [scene_of(r, cutoff_hz) for r in self.recordings]
        self.strides: Strides = strides_of(scenes, cutoff_hz)
        self.banks = {False: self._bank(scenes, 0.0)}
        first = self.recordings[self.strides.windows[0][0]]
        self.landmarks = misplaced(first, self.strides)
        self._turn(self.banks[False].y)
        self.readings = dict(self._read_off(scenes))
        self.shift = next(i for i, f in enumerate(self.forms) if f.shifts)
        self.banks[True] = self._shifted()
        self.fits: dict[Chosen, Set] = {}
        self.kept: list[Set] = []
        self.was_stopped = False

    def _bank(self, scenes: list[Scene], later_s: float) -> Bank:
        y = self.strides.mean([s.residual[:, :, None] for s in scenes])[..., 0]
        x = [self.strides.mean([form.columns(s) for s in scenes]) for form in self.forms]
        return Bank(scenes, y, x, later_s)

    def _read_off(self, scenes: list[Scene]) -> Iterator[tuple[int, tuple[float, float]]]:
        """Forms whose parameter a trial shows directly: the mean over trials, and its standard deviation."""
        for i, form in enumerate(self.forms):
            found = [form.reading(scene) for scene in scenes] if form.reading else []
            known = [one for one in found if one is not None]
            if known:
                yield i, (float(np.mean([value for value, _ in known])), known[0][1])

    @cached_property
    def tissue(self) -> np.ndarray:
        """Residuals that soft tissue leaves: (draws, 6, k)."""
        first = self.recordings[self.strides.windows[0][0]]
        return disturbed_waves(first, self.strides, tissue, TISSUE_DRAWS, self.seed)

    @cached_property
    def shaken(self) -> np.ndarray:
        """Residuals that white noise of one unit leaves in a stride: (draws, 6, k)."""
        first = self.recordings[self.strides.windows[0][0]]
        return disturbed_waves(first, self.strides, white, WHITE_DRAWS, self.seed)

    def _turn(self, left: np.ndarray) -> None:
        turn = rotation(left, self.strides.harmonics)
        scene = self.banks[False].scenes[0]
        weight = GRAVITY * sum(p[0] for p in scene.parameters.values())
        means = np.r_[np.full(3, MEAN_FORCE * weight), np.full(2, MEAN_ARM_M * weight), MEAN_TWIST_NM] ** 2
        if not self.strides.whole:  # soft tissue does not come back to what it was
            means = means + np.mean(self.tissue[..., 0] ** 2, axis=0)
        bare = WalkNoise(self.strides.harmonics, turn, means, self._none())
        self.ordinary = bare.rotated(compressed(self._in_every_session()))
        self.noise = replace(bare, nuisance=np.concatenate([bare.rotated(self._nuisance()), self.ordinary], axis=3))
        self.fits = {}

    def _in_every_session(self) -> np.ndarray:
        """What ordinary errors of landmarks and plates leave, in units of their standard deviations: (1, 6, k, m)."""
        forms = [(self.banks[False].x[i], f.ordinary) for i, f in enumerate(self.forms) if f.ordinary > 0.0]
        landmarks = np.moveaxis(self.landmarks, 0, 2)[None]
        return np.concatenate([landmarks, *(size * columns for columns, size in forms)], axis=3)

    def _nuisance(self) -> np.ndarray:
        """What errors in the motion take from every wave of the required reaction, in units of `TAKEN`: (n, 6, k, 7).

        A share of each channel, and one that grows with the square of the frequency, as of accelerations.
        """
        h = self.strides.harmonics
        needed = self.strides.mean([s.needed[:, :, None] for s in self.banks[False].scenes])[..., 0]
        waves = needed * (h > 0)
        out = np.zeros((*waves.shape, 7))
        for channel in range(6):
            out[:, channel, :, channel] = TAKEN * waves[:, channel]
        out[..., 6] = TAKEN * waves * (h / 4.0) ** 2
        return out

    def _shifted(self) -> Bank:
        """The plates read as late as fits best, followed beyond the linear."""
        later, bank = 0.0, self.banks[False]
        for _ in range(SHIFT_ROUNDS):
            prior = np.array(self.forms[self.shift].plausible)
            found = fit_walk(self.noise.rotated(bank.y), self.noise.rotated(bank.x[self.shift]), prior, self.noise)
            step = float(np.clip(found.values[0], -0.05, 0.05))
            later = float(np.clip(later + step, -0.2, 0.2))
            scenes = [scene_of(r, self.cutoff_hz, later) for r in self.recordings]
            y = self.strides.mean([s.residual[:, :, None] for s in scenes])[..., 0]
            rate = self.strides.mean([self.forms[self.shift].columns(s) for s in scenes])
            x = list(bank.x)
            x[self.shift] = rate
            bank = Bank(scenes, y, x, later)
            if abs(step) < 5e-4:
                break
        return self._bank(bank.scenes, later)

    def bank(self, chosen: Chosen) -> Bank:
        """The bank in which a set is fitted: with the clock moved if it holds a shift."""
        return self.banks[self.shift in chosen]

    def columns(self, chosen: Chosen) -> np.ndarray:
        """Rotated columns of a set, one form after the other: (n, 6, k, p)."""
        bank = self.bank(chosen)
        return self.noise.rotated(np.concatenate([bank.x[i] for i in chosen], axis=3)) if chosen else self._none()

    def _none(self) -> np.ndarray:
        return np.zeros((*self.banks[False].y.shape, 0))

    def fit(self, chosen: Chosen) -> Set:
        """A set's fit; kept."""
        return self.fit_all([chosen])[0]

    def fit_all(self, wanted: Iterable[Chosen]) -> list[Set]:
        """Fits of many sets, those of as many parameters and one clock together; kept."""
        sets = [tuple(sorted(chosen)) for chosen in wanted]
        groups: dict[tuple[int, bool], list[Chosen]] = {}
        for chosen in dict.fromkeys(sets):
            if chosen not in self.fits:
                count = sum(len(self.forms[i].parameters) for i in chosen)
                groups.setdefault((count, self.shift in chosen), []).append(chosen)
        for (count, _), group in groups.items():
            for at in range(0, len(group), TOGETHER):
                if self.kept:
                    check_limit()
                self._fit_alike(group[at : at + TOGETHER], count)
        return [self.fits[chosen] for chosen in sets]

    def _fit_alike(self, group: list[Chosen], count: int) -> None:
        y = self.noise.rotated(self.bank(group[0]).y)
        x = np.stack([self.columns(chosen) for chosen in group])
        prior = np.array([[size for i in chosen for size in self.forms[i].plausible] for chosen in group])
        prior = prior.reshape(len(group), count)
        found = fit_many(np.broadcast_to(y, (len(group), *y.shape)), x, prior, self.noise)
        for k, chosen in enumerate(group):
            fitted = fitted_of(found, k)
            possible = bool((np.abs(fitted.believed) <= POSSIBLE * prior[k]).all())
            possible &= all(self._may_be(i, v) for i, v in self._named(chosen, fitted.believed))
            self.fits[chosen] = Set(chosen, fitted, fitted.deviance if possible else np.inf)

    def _may_be(self, form: int, value: float) -> bool:
        """Whether a value has a meaning, and is what can be read off where it can."""
        if self.forms[form].positive and value < 0.0:
            return False
        known = self.readings.get(form)
        return known is None or abs(value - known[0]) <= POSSIBLE * known[1]

    def _named(self, chosen: Chosen, values: np.ndarray) -> Iterator[tuple[int, float]]:
        """Form and value of every parameter of a set."""
        owners = [i for i in chosen for _ in self.forms[i].parameters]
        return zip(owners, values.tolist(), strict=False)

    def sizes(self, one: Set) -> dict[int, np.ndarray]:
        """Values of a set's parameters by form; a shift counts from the clock as it was read."""
        out: dict[int, list[float]] = {i: [] for i in one.forms}
        for i, value in self._named(one.forms, one.fitted.values):
            out[i].append(value + (self.banks[True].later_s if self.forms[i].shifts else 0.0))
        return {i: np.array(values) for i, values in out.items()}

    def causes(self, chosen: Chosen) -> list[str]:
        """Names of a set's causes."""
        return [self.forms[i].cause for i in chosen]

    def extensions(self, chosen: Chosen) -> Iterator[Chosen]:
        """The set with one more form, of a site that it has not: no two forms of one cause at one site."""
        taken = {_place(self.forms[i]) for i in chosen}
        for i, form in enumerate(self.forms):
            if _place(form) not in taken:
                yield tuple(sorted((*chosen, i)))

    def run(self) -> list[Set]:
        """The best set of every size, from none on; the channels are rotated anew for what the best one leaves.

        Past the limit of time: of the sizes that were searched to their end.
        """
        try:
            return self._run()
        except OutOfTime:
            self.was_stopped = True
            kept, self.kept = [one.forms for one in self.kept], []
            return self.fit_all(kept)

    def _run(self) -> list[Set]:
        best = self._beam(2)[-1]
        residual = self.bank(best.forms).y
        if best.forms:
            found = np.concatenate([self.bank(best.forms).x[i] for i in best.forms], axis=3)
            residual = residual - found @ best.fitted.values[: found.shape[3]]
        self._turn(residual)
        return self._beam(MOST)

    def _beam(self, most: int) -> list[Set]:
        self.kept = sizes = [self.fit(())]
        front = [sizes[0]]
        for _ in range(most):
            seen = {chosen for one in front for chosen in self.extensions(one.forms)}
            ranked = sorted(self.fit_all(seen), key=lambda s: (s.price, s.forms))
            front = self._diverse(ranked)
            sizes.append(self._swapped(ranked[0]))
            if sizes[-1].price > sizes[-2].price:
                break
        return sizes

    def _diverse(self, ranked: list[Set]) -> list[Set]:
        """The best sets, at most two of the same causes."""
        kept: list[Set] = []
        for one in ranked:
            names = sorted(self.causes(one.forms))
            if sum(sorted(self.causes(k.forms)) == names for k in kept) < 2:
                kept.append(one)
            if len(kept) == BEAM:
                break
        return kept

    def _swapped(self, one: Set) -> Set:
        """The set after every single swap that makes it better."""
        while len(one.forms) > 1:
            better = min((s for _, s in self.swaps(one)), key=lambda s: (s.price, s.forms))
            if better.price >= one.price - 1e-6:
                return one
            one = better
        return one

    def swaps(self, one: Set) -> Iterator[tuple[int, Set]]:
        """Every set in which one form stands in another's place: the form that went, and the set."""
        for gone in one.forms:
            rest = tuple(i for i in one.forms if i != gone)
            others = [chosen for chosen in self.extensions(rest) if chosen != one.forms]
            yield from ((gone, other) for other in self.fit_all(others))

    def nulls(self, noise_of: Set, seed: int) -> Nulls:
        """What the library makes of residuals where there is no cause.

        Noise is soft tissue's, errors in the coordinates carried through the body, in each wave as large as what was
        found there, some of the fitted noise, and what is in every session.
        """
        variance = noise_of.fitted.variance
        random = np.random.default_rng(seed)
        drawn = random.normal(size=(SIMULATED, *variance.shape)) * np.sqrt(variance)
        always = random.normal(size=(SIMULATED, self.ordinary.shape[3])) @ self.ordinary.reshape(variance.size, -1).T
        mixed = random.normal(size=(SIMULATED, len(self.tissue))) / np.sqrt(len(self.tissue))
        shared = np.einsum("sd,djk->sjk", mixed, self.tissue)
        shared = self.noise.rotated(shared)
        waves = self.noise.harmonics > 0
        power = np.mean(shared[..., waves] ** 2, axis=0)
        h = self.noise.harmonics[waves]
        size = np.array([np.sqrt(variance[0][:, waves][:, h == w].sum() / power[:, h == w].sum()) for w in h])
        drawn[:, 0][..., waves] = size * shared[..., waves] + FLOOR_SHARE * drawn[:, 0][..., waves]
        drawn += always.reshape(drawn.shape)
        none = np.zeros((*variance.shape, 0))
        alone = fit_many(drawn, none, np.zeros(0), self.noise, SIMULATED_ROUNDS)[2]
        best, spread = np.full(SIMULATED, -np.inf), []
        for i, form in enumerate(self.forms):
            x = self.noise.rotated(self.banks[False].x[i])
            values, covariance, deviance, *_ = fit_many(
                drawn, x, np.array(form.plausible), self.noise, SIMULATED_ROUNDS
            )
            best = np.maximum(best, alone - deviance)
            stds = np.sqrt(np.einsum("bpp->bp", covariance))
            spread.append(np.sqrt(np.mean((values / stds) ** 2, axis=0)))
        return Nulls(best, tuple(spread))


def _place(form: Form) -> tuple[str, str]:
    return form.cause, form.site.split(",")[0]
