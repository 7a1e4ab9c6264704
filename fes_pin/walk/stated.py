"""What a walk states by itself: the mass that its plates carry, and what each plate reads while its foot is in the air.

The mean vertical force over whole strides, and of one who stands, is the weight, as momentum returns to its initial
value. A foot in the air loads no plate.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.ndimage import binary_dilation

from fes_pin.body.build import GRAVITY, MASS_SHARE
from fes_pin.body.joints import SIDES
from fes_pin.data.study import Study
from fes_pin.infer.levels import POSSIBLE_SIZES, SEEN_DEVIATIONS
from fes_pin.walk.effect import AXES
from fes_pin.walk.likelihood import MEAN_FORCE
from fes_pin.walk.recording import recordings_of
from fes_pin.walk.strides import Strides, strides_of
from fes_pin.walk.walk_trial import ORDINARY_N, WalkTrial, stretches

SETTLED_S = 0.1
"""s; how far from a step the low pass no longer carries it."""


@dataclass(frozen=True)
class Stated:
    """Quantities that walks state by themselves, with standard errors from the scatter between strides and swings.

    Attributes
    ----------
    body_kg, mass_kg, mass_std_kg
        Mass of the body as believed, and mass that the plates carry with its standard error, infinite without whole
        strides.
    air_n, air_std_n
        (6,) N: forward, left and up force of the left plate, then of the right one, while its foot is in the air, with
        standard errors, infinite of a foot that never is.
    said
        What was taken otherwise than it was read.
    """

    body_kg: float
    mass_kg: float
    mass_std_kg: float
    air_n: np.ndarray
    air_std_n: np.ndarray
    said: tuple[str, ...] = ()

    @classmethod
    def of(cls, trials: Sequence[WalkTrial], strides: Strides) -> Stated:
        """Return what trials state that are cut into strides."""
        body = sum(p[0] for p in trials[0].motion.parameters.values())
        air, air_std = (np.hstack(each) for each in zip(*(_in_the_air(trials, side) for side in SIDES), strict=True))
        up = np.array([trials[k].measured[rows, 2].mean() for k, rows, _ in strides.windows if strides.whole])
        mass, std = _mean((up - air[2] - air[5]) / GRAVITY)
        said = tuple(words for trial in trials for words in trial.said)
        return cls(body, float(mass), float(np.hypot(std, MEAN_FORCE * body)), air, air_std, said)

    def contradictions(self, study: Study) -> Iterator[str]:
        """Yield a sentence on the mass where a study states another, and on each plate that reads an unloaded foot.

        What was assumed on reading comes first.
        """
        done: dict[str, list[str]] = {}
        for trial in study.trials:
            for words in trial.remarks:
                done.setdefault(words, []).append(trial.name)
        yield from (words if len(study) == 1 else f"{words} ({', '.join(names)})" for words, names in done.items())
        yield from self.said
        if abs(self.mass_kg - self.body_kg) > max(SEEN_DEVIATIONS * self.mass_std_kg, MASS_SHARE * self.body_kg):
            whose = "mass_kg states" if "mass_kg" in study.constants else "its segments weigh"
            yield f"the plates carry {self.mass_kg:.1f} kg in the mean of whole strides, {whose} {self.body_kg:.4g}"
        for (side, axis), force, std in zip(product(SIDES, AXES), self.air_n, self.air_std_n, strict=True):
            if abs(force) > max(SEEN_DEVIATIONS * std, POSSIBLE_SIZES * ORDINARY_N):
                yield f"the {side} plate reads {force:.3g} N {axis} while its foot is in the air"


def contradictions_of(study: Study) -> tuple[str, ...]:
    """Return what walks state by themselves against their study, a line each.

    Raises
    ------
    InputError
        As `recordings_of`.
    """
    trials = recordings_of(study)
    return tuple(Stated.of(trials, strides_of(trials, trials[0].session.cutoff_hz)).contradictions(study))


def _in_the_air(trials: Sequence[WalkTrial], side: str) -> tuple[np.ndarray, np.ndarray]:
    """Return force of one plate while its foot is in the air, and standard error: (3,) each."""
    swings = []
    for trial in trials:
        free = ~binary_dilation(trial.plates.loaded[side], iterations=int(np.ceil(SETTLED_S / trial.motion.dt)))
        swings += [trial.plates.feet[side][rows, :3].mean(axis=0) for rows in stretches(free)]
    return _mean(np.reshape(swings, (-1, 3)))


def _mean(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and standard error of values; 0 and infinite of none. The scatter of one value is taken as 0."""
    n = len(values)
    if not n:
        return np.zeros(values.shape[1:]), np.full(values.shape[1:], np.inf)
    return values.mean(axis=0), values.std(axis=0, ddof=min(n - 1, 1)) / np.sqrt(n)
