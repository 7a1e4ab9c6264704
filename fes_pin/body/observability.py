"""Which goniometers see which modes, how well, and the fewest that see the falls well enough.

That a sensor sees a mode says little: what counts is how far off the lean is that one believes in after a look. The
figure is the posterior of a Bayesian regression: before, every mode's angle and rate (over its rate of growth or
frequency) are normal with a deviation of `PRIOR_DEG`; angles are then read for `LOOK_S` seconds, `RATE_HZ` times a
second, each with white noise of `NOISE_DEG`. The uncertainty is the standard deviation of each mode's angle at the end
of the look (S. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, 1993, section 11.6).
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fes_pin.body.controllability import RELATIVE_TOLERANCE, independent
from fes_pin.body.joints import known_joint, names_of
from fes_pin.body.linear_body import LinearBody
from fes_pin.body.modes import Mode, ModeSet
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import instance, positive_number
from fes_pin.data.show import Tabulated

NOISE_DEG, RATE_HZ, LOOK_S = 0.5, 200.0, 0.3
"""Noise of a good flexible goniometer, degrees; its sampling, Hz; the time that a fall leaves for a look, s (ours)."""
PRIOR_DEG = 10.0
"""Prior knowledge without sensors, degrees: within the linear model's reach (`fes_pin.body.plans.SETTLE_DEG`)."""

_SETS_AT_ONCE = 20000


@dataclass(frozen=True, eq=False)
class ModalObservability(Tabulated):
    """Observability of a body by goniometers at some joints.

    Parameters
    ----------
    modes, sensors
        The modes and the joints with a goniometer.
    gains
        Angle seen per degree of the mode's greatest joint: (modes, sensors).
    observable
        Whether each mode is seen (PBH).
    posterior_deg
        Deviation of each mode's angle that a look of `LOOK_S` seconds leaves, degrees of its greatest joint: (modes,).
    """

    modes: ModeSet = field(repr=False)
    sensors: tuple[str, ...]
    gains: np.ndarray = field(repr=False)
    observable: np.ndarray = field(repr=False)
    posterior_deg: np.ndarray = field(repr=False)

    @property
    def worst_deg(self) -> float:
        """The largest posterior deviation of a falling mode, degrees; 0 where nothing falls."""
        return float(self.posterior_deg[self.modes.kinds == "fall"].max(initial=0.0))

    _index = "mode"

    def _table(self) -> dict[str, Any]:
        names = [mode.name for mode in self.modes]
        return {"mode": names, "observable": self.observable.tolist(), "left_deg": self.posterior_deg.tolist()}

    def __str__(self) -> str:
        lines = ["goniometers: " + ", ".join(self.sensors)]
        look = f"{NOISE_DEG:g} deg of noise, {RATE_HZ:g} Hz, {LOOK_S:g} s"
        lines.append(f"uncertainty after a look ({look}), degrees of the mode's greatest joint:")
        for mode, seen, left in zip(self.modes, self.observable, self.posterior_deg, strict=True):
            lines.append(f"  {mode.name:66s} {'seen' if seen else 'NOT seen':9s} {left:8.2g} deg")
        return "\n".join(lines)


def observability(linear: LinearBody, sensors: Iterable[str]) -> ModalObservability:
    """Which modes goniometers at these joints see, and how well.

    Raises
    ------
    InputError
        Unknown or braced joint, or none.
    """
    found = linear.modes()
    names = tuple(known_joint(name) for name in names_of(sensors))
    if not names:
        raise InputError("at least one goniometer is needed")
    for name in names:
        if name not in linear.joint_names:
            raise InputError(f"{name!r} is braced: nothing moves there")
    rows = found.shapes[[linear.joint_names.index(name) for name in names]].T  # (modes, sensors), then per degree
    rows = rows * (found.degree / np.radians(1.0))[:, None]
    rows = np.where(np.abs(rows) > RELATIVE_TOLERANCE, rows, 0.0)
    (left,) = _posteriors(found.modes, rows[None])
    return ModalObservability(found, names, rows, independent(found.values, rows), left)


def _courses(found: Sequence[Mode]) -> np.ndarray:
    """Course of each mode's angle over a look per unit of its two unknowns: (samples, modes, 2).

    Of a fall these are its growing part at the end and its decaying part at the beginning, so that no course grows;
    of others the angle at the end, and its rate over the frequency (of a drift, the rate itself).
    """
    back = -np.arange(round(LOOK_S * RATE_HZ))[::-1] / RATE_HZ
    out = np.empty((len(back), len(found), 2))
    for i, mode in enumerate(found):
        if mode.kind == "fall":
            out[:, i] = 0.5 * np.exp(mode.rate * np.column_stack([back, back[0] - back]))
        elif mode.kind == "swing":
            out[:, i] = np.column_stack([np.cos(mode.rate * back), np.sin(mode.rate * back)])
        else:
            out[:, i] = np.column_stack([np.ones_like(back), back])
    return out


def _posteriors(found: Sequence[Mode], angles: np.ndarray) -> np.ndarray:
    """Posterior deviation of every mode's angle at the end of a look, for sets of sensors: (sets, modes) degrees.

    Parameters
    ----------
    found
        The modes; of some of all, the posterior if the others were known, which is never more.
    angles
        As `_angles` gives them, by set: (sets, modes, sensors).
    """
    courses = _courses(found)
    count = 2 * len(found)
    flat = courses.reshape(len(courses), count)
    falls = np.array([mode.kind == "fall" for mode in found])
    prior = PRIOR_DEG**2 * np.repeat(np.where(falls, 2.0, 1.0), 2)  # z and y are angle plus and minus rate
    seen = np.repeat(np.repeat(angles @ np.swapaxes(angles, 1, 2), 2, axis=1), 2, axis=2)
    information = np.diag(1.0 / prior) + (flat.T @ flat) * seen / NOISE_DEG**2
    covariance = np.linalg.inv(information).reshape(-1, len(found), 2, len(found), 2)
    i = np.arange(len(found))
    return np.sqrt(np.einsum("ia,niab,ib->ni", courses[-1], covariance[:, i, :, i].swapaxes(0, 1), courses[-1]))


def fewest_goniometers(
    linear: LinearBody, candidates: Sequence[str] | None = None, within_deg: float = 1.0
) -> tuple[ModalObservability, ...]:
    """All smallest sets of goniometers that leave every falling mode known well enough; the best first.

    Parameters
    ----------
    candidates
        Joints that can carry one; all that move by default.
    within_deg
        Posterior deviation that a look may leave of each falling mode, degrees (see this file's head).

    Raises
    ------
    InputError
        Unknown joint; a figure that is not positive; or no set sees every fall so well.
    """
    within_deg = positive_number(within_deg, "within_deg")
    instance(linear, LinearBody, "linear")
    names = tuple(linear.joint_names if candidates is None else names_of(candidates))
    whole = observability(linear, names)
    rows = [i for i, mode in enumerate(whole.modes) if mode.kind == "fall"]
    if whole.worst_deg > within_deg or not np.all(whole.observable[rows]):
        found = f"these joints leave a fall uncertain by {whole.worst_deg:.2g} degrees, more than {within_deg:g}"
        raise InputError(f"{found}: they do not see every falling mode")
    for size in range(1, len(names) + 1):
        sets: list[ModalObservability] = []
        combinations = itertools.combinations(range(len(names)), size)
        while some := list(itertools.islice(combinations, _SETS_AT_ONCE)):
            good = np.array(some)
            for part in [[i] for i in rows] + [rows, list(range(len(whole.modes)))] if rows else []:
                angles = np.moveaxis(whole.gains[part][:, good], 0, 1)
                left = _posteriors([whole.modes[i] for i in part], angles)
                good = good[left[:, [i in rows for i in part]].max(axis=1) <= within_deg]
            sets += [observability(linear, [names[i] for i in each]) for each in good]
        if sets:
            return tuple(sorted(sets, key=lambda found: found.worst_deg))
    return ()
