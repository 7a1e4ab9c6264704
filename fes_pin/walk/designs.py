"""Design matrices of recorded walks: waves of the mean stride of the residual and of every form, and their noise.

Noise is what errors in the coordinates change: soft tissue, white noise, misplaced landmarks.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from fes_pin.body.build import GRAVITY
from fes_pin.data.motion import TRANSLATIONS
from fes_pin.infer.fits import Names
from fes_pin.walk.effects import walk_library
from fes_pin.walk.likelihood import MEAN_ARM_M, MEAN_FORCE, MEAN_TWIST_NM, Known, WalkNoise, fit_many
from fes_pin.walk.motion import about
from fes_pin.walk.stated import Stated
from fes_pin.walk.strides import Design, Strides, strides_of
from fes_pin.walk.walk_trial import ORDINARY_N, WalkTrial

TISSUE_DRAWS, WHITE_DRAWS = 40, 64
"""Numbers of simulated errors."""
PAD_S = 0.3
"""Time before and after a stride, so that the filter's ends do not matter."""
TISSUE_M, TISSUE_RAD = 0.002, 0.01
"""Soft tissue's share of a coordinate's wave once a stride; it falls as 1 / h (Leardini et al., Gait Posture 21, 2005:
some 10 mm on the thigh, a few degrees in its angles). Only proportions matter."""
TISSUE_WAVES = 8
"""Number of waves of soft tissue: a walk's low pass removes higher ones."""
CLUSTER_M = 0.15
"""Half the length of a cluster of markers, m: noise of markers, in m, over this is noise of angles, in rad."""

LANDMARK_M, LANDMARK_RAD = 0.005, 0.026
"""Ordinary errors of where a coordinate's zero is, as standard deviations: landmarks are found to 6 to 21 mm, and a
segment's frame is the mean of several (U. Della Croce et al., Gait Posture 21:226, 2005)."""

Disturbance = Callable[[np.ndarray, np.ndarray, np.random.Generator], np.ndarray]
"""Function of the phase in the stride, (n,), of whether each coordinate is an angle, (c,), and of a generator: errors
of the coordinates, (draws, c, n)."""


def tissue(phase: np.ndarray, angle: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return errors that repeat in each stride."""
    h = np.arange(1, TISSUE_WAVES + 1)
    sizes = random.normal(size=(TISSUE_DRAWS, len(angle), TISSUE_WAVES, 2)) / h[:, None]
    turn = 2.0 * np.pi * np.outer(h, phase)
    waves = sizes[..., 0] @ np.cos(turn) + sizes[..., 1] @ np.sin(turn)
    return np.where(angle, TISSUE_RAD, TISSUE_M)[:, None] * waves


def white(phase: np.ndarray, angle: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return white noise as of markers with 1 mm."""
    noise = random.normal(size=(WHITE_DRAWS, len(angle), len(phase)))
    return 1e-3 * noise / np.where(angle, CLUSTER_M, 1.0)[:, None]


def misplaced(phase: np.ndarray, angle: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the ordinary error of each coordinate's zero, one coordinate after the other."""
    return np.diag(np.where(angle, LANDMARK_RAD, LANDMARK_M))[:, :, None] * np.ones_like(phase)


def disturbed(trial: WalkTrial, strides: Strides, kind: Disturbance, seed: int) -> np.ndarray:
    """Return changes of the residual's waves in the first stride by errors of the coordinates: (draws, 6, k)."""
    _, rows, phase = strides.windows[0]
    time = trial.motion.time[rows]
    near = (trial.time >= time[0] - PAD_S) & (trial.time <= time[-1] + PAD_S)
    clock = trial.time[near]
    columns = {n: c[near] for n, c in trial.coordinates.items() if n.startswith("q_")}
    turn = (clock - time[0]) / ((time[-1] - time[0]) * len(time) / (len(time) - 1)) + phase[0]
    inside = (clock >= time[0] - 1e-9) & (clock <= time[-1] + 1e-9)
    total = trial.plates.total[rows]

    def residual(errors: np.ndarray | float) -> np.ndarray:
        moved = dict(zip(columns, np.stack(list(columns.values())) + errors, strict=True))
        motion = trial.moved(clock, moved).part(inside)
        return about(total - motion.required, motion.centre)

    angle = np.array([n.removeprefix("q_") not in TRANSLATIONS for n in columns])
    base, draws = residual(0.0), kind(turn, angle, np.random.default_rng(seed))
    return strides.first(np.stack([residual(one) - base for one in draws], axis=2))


TAKEN = 0.3
"""Standard deviation of errors in the motion, as a share of a wave of the required reaction: soft tissue
moves by 10 mm and more where a trunk moves by 20 to 40 (A. Leardini et al., Gait Posture 21:212, 2005)."""
SHIFT_ENDS_S = 5e-4
"""Step at which the estimation of a shift ends, s."""
SMALL_N = 1.0
"""Ordinary errors with a smaller residual in all waves together are left out, N or N m."""
SHIFT_ROUNDS = 4
"""Most steps of the estimation of a shift of the clock."""


class Designs:
    """Design matrices of one diagnosis, on the plates' clock as read and on the clock that fits best, and their noise.

    Attributes
    ----------
    seed
        As given.
    forms
        The library, by names.
    shift
        The name of the form that shifts the plates' clock.
    strides
        The strides into which signals are cut.
    stated
        What the walks state by themselves.
    as_read, shifted
        Design matrices on either clock.
    noise
        Noise of all fits, in rotated channels.
    """

    def __init__(self, trials: Sequence[WalkTrial], seed: int = 0) -> None:
        self.seed = seed
        self.forms = {form.label: form for form in walk_library()}
        self.shift = next(n for n, f in self.forms.items() if f.shifts)
        self.strides = strides_of(trials, trials[0].session.cutoff_hz)
        self.stated = Stated.of(trials, self.strides)
        self._first = trials[self.strides.windows[0][0]]
        self.as_read = self.strides.mean_design(trials, self.forms.values())
        self.noise = self._as_measured.uncorrelated(self.as_read.y)
        self.shifted = self._shifted()

    @cached_property
    def _as_measured(self) -> WalkNoise:
        """The noise in the channels that were measured."""
        weight = GRAVITY * self.stated.body_kg
        means = np.r_[np.full(3, MEAN_FORCE * weight), np.full(2, MEAN_ARM_M * weight), MEAN_TWIST_NM] ** 2
        if not self.strides.whole:  # soft tissue does not return to its initial place
            means = means + np.mean(self.tissue[..., 0] ** 2, axis=0)
        nuisance = np.concatenate([self._taken(), self.in_every_session], axis=3)
        return WalkNoise(self.strides.harmonics, np.eye(6), means, nuisance)

    def _taken(self) -> np.ndarray:
        """Return nuisance columns for errors in the motion, in units of `TAKEN`: (1, 6, k, 7).

        They are a share of each wave of the required reaction by channel, and one of all channels that grows with the
        square of the frequency, as errors of accelerations do.
        """
        h = self.strides.harmonics
        waves = self.strides.mean([s.needed for s in self.as_read.trials]) * (h > 0)
        out = np.zeros((*waves.shape, 7))
        out[:, range(6), :, range(6)] = TAKEN * np.moveaxis(waves, 1, 0)
        out[..., 6] = TAKEN * waves * (h / 4.0) ** 2
        return out

    @cached_property
    def in_every_session(self) -> np.ndarray:
        """Residuals by ordinary errors of landmarks and plates of one standard deviation: (1, 6, k, m).

        They are fewer columns than there are errors, of nearly the same covariance.
        """
        forms = [(self.as_read.x[n], f.ordinary) for n, f in self.forms.items() if f.ordinary > 0.0]
        landmarks = np.moveaxis(disturbed(self._first, self.strides, misplaced, self.seed), 0, 2)[None]
        columns = np.concatenate([landmarks, *(size * columns for columns, size in forms)], axis=3)
        vectors, sizes, _ = np.linalg.svd(columns.reshape(self.as_read.y.size, -1), full_matrices=False)
        kept = sizes > SMALL_N
        return (vectors[:, kept] * sizes[kept]).reshape(*self.as_read.y.shape, -1)

    @cached_property
    def tissue(self) -> np.ndarray:
        """Residuals by soft tissue: (draws, 6, k)."""
        return disturbed(self._first, self.strides, tissue, self.seed)

    @cached_property
    def shaken(self) -> np.ndarray:
        """Residuals of a stride by white noise of one unit: (draws, 6, k)."""
        return disturbed(self._first, self.strides, white, self.seed)

    def turned(self, residual: np.ndarray) -> Designs:
        """Return the same with channels rotated for the residual of a set, (1, 6, k)."""
        other = copy.copy(self)
        other.noise = self._as_measured.uncorrelated(residual)
        return other

    def _shifted(self) -> Design:
        """Return the design matrix at the delay of the plates that fits best, by repeated linearization."""
        later, design, prior = 0.0, self.as_read, self.plausible((self.shift,))[None]
        for _ in range(SHIFT_ROUNDS):
            aim, columns = (self.noise.rotated(v)[None] for v in (design.y, design.x[self.shift]))
            (found,) = fit_many(aim, columns, prior, self.noise)
            step = float(np.clip(found.values[0], -0.05, 0.05))
            later = float(np.clip(later + step, -0.2, 0.2))
            design = self.strides.mean_design([t.read_later(later) for t in design.trials], [self.forms[self.shift]])
            if abs(step) < SHIFT_ENDS_S:
                break
        return replace(self.strides.mean_design(design.trials, self.forms.values()), later_s=later)

    def design(self, names: Names) -> Design:
        """Return the design matrix in which a set is fitted: with the clock shifted if the set has a shift."""
        return self.shifted if self.shift in names else self.as_read

    def columns(self, names: Names) -> np.ndarray:
        """Return columns of a set in the mean stride, one form after the other: (1, 6, k, p)."""
        none = np.zeros((*self.as_read.y.shape, 0))
        return np.concatenate([none, *(self.design(names).x[n] for n in names)], axis=3)

    def readings(self, sets: Sequence[Names]) -> Known:
        """Return what plates read while a foot is in the air, and what each of some sets of as many parameters adds."""
        weight = 1.0 / np.hypot(ORDINARY_N, self.stated.air_std_n)
        forms = [[self.forms[n] for n in names] for names in sets]
        shown = [[np.isin(range(len(weight)), f.reads) * weight for f in some for _ in f.parameters] for some in forms]
        columns = np.reshape(shown, (len(sets), -1, len(weight))) if len(sets[0]) else np.zeros((1, 0, len(weight)))
        return (self.stated.air_n * weight)[None], columns.swapaxes(1, 2)

    def residual(self, names: Names, values: np.ndarray) -> np.ndarray:
        """Return the residual of a set in the mean stride, (1, 6, k)."""
        return self.design(names).y - self.columns(names) @ values

    def by_stride(self, names: Names) -> tuple[np.ndarray, np.ndarray]:
        """Return residual (n, 6, k) and columns (n, 6, k, p) of a set, stride by stride."""
        trials = self.design(names).trials
        y = self.strides.coefficients([s.residual for s in trials])
        return y, self.strides.coefficients([self.signals(names, s) for s in trials])

    def signals(self, names: Names, trial: WalkTrial) -> np.ndarray:
        """Return columns of a set along a trial: (n, 6, p)."""
        empty = np.zeros((len(trial.needed), 6, 0))
        return np.concatenate([empty, *(self.forms[n].columns(trial) for n in names)], axis=2)

    def whitened(self, values: np.ndarray, variance: np.ndarray) -> np.ndarray:
        """Return waves (n, 6, k), whitened by a variance (1, 6, k) and by the nuisance parameters: (n, 6 k).

        With F the nuisance's columns in units of the noise, u s v' its singular values: (1 + F F')^(-1/2) is
        1 - u (1 - (1 + s^2)^(-1/2)) u'.
        """
        root = np.sqrt(variance)
        nuisance = (self.noise.nuisance / root[..., None]).reshape(root.size, -1)
        u, s, _ = np.linalg.svd(nuisance, full_matrices=False)
        white = (self.noise.rotated(values) / root).reshape(len(values), root.size)
        return np.asarray(white - (white @ u) * (1.0 - 1.0 / np.sqrt(1.0 + s**2)) @ u.T)

    def plausible(self, names: Names) -> np.ndarray:
        """Return the plausible size of every parameter of a set, (p,)."""
        return np.array([form.plausible for form in (self.forms[n] for n in names) for _ in form.parameters])
