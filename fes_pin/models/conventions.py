"""Conventions of a joint's columns that its data contradict: a sign, degrees, millinewtons, an encoder's counts.

The effort of a joint of inertia J is J a + f(q, v). A regression of efforts on the acceleration, and on whatever
position and velocity can do, gives J whatever f is. The URDF gives it too. No cause turns its sign, and none that is
known has a factor beyond `PHYSICAL`. Where the two differ by more, each convention is tried with the URDF's gravity
in the place of f: it has a size for the inertia and for gravity, which it should bring near those of the URDF, and an
error.

Free motion shows ratios alone: a pendulum's acceleration by the URDF is that of its angle in one unit only.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from fes_pin.data.direction import (
    ALIKE,
    FARTHEST,
    FEWEST,
    SLOWEST_ROWS,
    band_hz,
    columns_of_motion,
    moved,
    smoothed_rows,
)
from fes_pin.data.spectra import SLOWEST_HZ
from fes_pin.data.trial import Trial, derived_trial
from fes_pin.models.goals import fitted_of
from fes_pin.models.rigs.base import Rig
from fes_pin.models.rigs.joint import Joint

PHYSICAL = 10.0
"""Factor of an inertia, or of its inverse, that causes may have: `effort_gain` is from -0.9 to 9."""
SURELY = 5.0
"""Standard deviations by which an inertia differs from 0."""
EXPLAINED, OF_ACCELERATION = 0.8, 0.5
"""Least share of the variance of efforts that the motion explains; and of what position and velocity leave of it, the
acceleration. Of 36 driven rigs (`scripts/accuracy driven`, `large`) 0.88 and 0.56 are the least."""
BELIEVED = 0.35
"""Deviation of the logarithm of an inertia or a weight that is believed: a factor of 2 is two deviations."""
MARGIN, SURE = 4.0, 16.0
"""Difference of twice the log-likelihood from which the likeliest convention is named alone, and taken: two and four
standard deviations."""
TIMES_SLOWER = 10.0
"""Rows for each that is independent: what a model leaves out is slower than the band."""
ROWS = 3.0
"""Periods of the slowest band that a trial lasts, at least, where no other band is seen."""
UNFIT = 0.5
"""Share of the variance that inertia and gravity leave in a wrong unit, or of a command that nothing follows."""
ANSWERED = 0.9
"""Share of the variance of efforts from which the angle alone explains them."""
DEGREE = math.pi / 180.0
UNLESS = "no scale that [columns] states is doubted"
"""How a convention is stated that the data seem to contradict."""


class Convention(NamedTuple):
    """What a column may be in the place of what is stated, and the factors that give what was meant."""

    column: str
    words: str
    position: float = 1.0
    effort: float = 1.0


UNITS: Mapping[str, tuple[Mapping[float, str], Mapping[float, str]]] = {
    "position": ({1.0: "rad", DEGREE: "degrees"}, {1.0: "m", 1e-3: "mm"}),
    "effort": ({1.0: "N m", 1e-2: "N cm", 1e-3: "mN m"}, {1.0: "N", 1e-3: "mN"}),
}
"""Units that columns of a joint that turns, and of one that slides, are taken for, by their factors."""
SIGNS = (
    Convention("effort", "with the other sign", effort=-1.0),
    Convention("position", "with the other sign", position=-1.0),
)


class Tried(NamedTuple):
    """A convention and the ratios of inertia and weight to those of the URDF that it has.

    `left` is the share of the variance that is not explained, and `unlikely` twice the negative log-likelihood.
    """

    of: Convention
    inertia: float
    weight: float
    left: float
    unlikely: float


def with_meant_columns(trials: Sequence[Trial], rig: Rig) -> tuple[tuple[Trial, ...], list[str]]:
    """Return trials of a joint in the conventions that they are in, and a warning about each that is not as stated.

    One that the data do not tell from others is said, and the trials stay. Trials that are held out have no part in it.
    """
    if not isinstance(rig, Joint):
        return tuple(trials), []
    out, said = tuple(trials), list[str]()
    for find in (_unit, _sign):
        taken, words = find(_Seen(fitted_of(out), rig.constants))
        said += words
        out = tuple(_meant(t, taken) for t in out) if taken else out
    return out, said


def answered_angle(trials: Sequence[Trial], rig: Rig) -> list[str]:
    """Return a warning about efforts that fall with the angle, as those of a controller do and of no load.

    What the URDF's inertia and gravity explain is no answer.
    """
    seen = _Seen(trials, rig.constants) if isinstance(rig, Joint) else None
    if seen is None or not seen.is_driven or not seen.motions:
        return []
    share, slope = seen.answer()
    stated = seen.tried(Convention("effort", "as stated"))
    is_load = stated.left < UNFIT and (stated.inertia > 1.0 / PHYSICAL or not stated.weight < 0.0)
    if is_load or not (share > ANSWERED and slope < 0.0):
        return []
    angle = "sin(position)" if rig.constants["revolute"] else "position"
    said = f"the effort answers the angle: R2 {share:.2f} with {slope:.3g} {angle}"
    return [f"{said}: it is a controller's command or has the other sign; no load pulls so"]


def _meant(trial: Trial, by: Convention) -> Trial:
    """Return a trial with its columns and its start by the factors of a convention."""
    factors = {"position": by.position, "velocity": by.position, "effort": by.effort}
    columns = {n: v * factors.get(n, 1.0) for n, v in trial.columns.items()}
    started = {n: v * by.position if n in ("position0", "velocity0") else v for n, v in trial.conditions.items()}
    return derived_trial(trial, columns=columns, conditions=started)


class _Seen:
    """What trials show of the inertia of a joint, and of each convention."""

    def __init__(self, trials: Sequence[Trial], constants: Mapping[str, float]) -> None:
        self.constants = constants
        self.is_driven, self.trials = _moving(trials)
        self.band = band_hz(self.trials)
        if math.isnan(self.band):  # coarse readings, or short: what is slow may show it
            self.band, self.trials = SLOWEST_HZ, [t for t in self.trials if _is_long(t)]
        self.motions = [moved(t, self.band) for t in self.trials]
        read = [t.as_read.factors if t.as_read else {} for t in trials]
        self.factors = {n: next((f[n] for f in read if n in f), 1.0) for n in UNITS}

    def inertia(self) -> float:
        """Return the inertia that efforts show, over that of the URDF; NaN where they show none."""
        if not self.motions or not self.is_driven:
            return math.nan
        every = np.concatenate(self.motions, axis=1)
        low, high, usual = every[0].min(), every[0].max(), _usual(every[1])
        known = [columns_of_motion(q, v, 0.5 * (low + high), 0.5 * (high - low), usual) for q, v, _, _ in self.motions]
        rows = self._rows([[m[2], *columns, m[3]] for m, columns in zip(self.motions, known, strict=True)])
        basis = _basis(rows[:, 1:-1])
        free, left = (x - basis @ (basis.T @ x) for x in (rows[:, 0], rows[:, -1]))
        power, before = float(free @ free), float(left @ left)
        if not power > 0.0 or not before > 0.0:
            return math.nan
        inertia = float(free @ left) / power
        missed = float(np.sum((left - inertia * free) ** 2))
        deviation = math.sqrt(missed / max(len(rows) / TIMES_SLOWER - 1.0, 1.0) / power)
        explained = 1.0 - missed / len(rows) / max(float(np.var(rows[:, -1])), 1e-300)
        seen = explained > EXPLAINED and missed < (1.0 - OF_ACCELERATION) * before and abs(inertia) > SURELY * deviation
        return inertia / self.constants["inertia"] if seen else math.nan

    def tried(self, of: Convention) -> Tried:
        """Return what a convention makes of inertia and weight, and what the URDF's gravity and friction leave then."""
        turned, lines = of.position, []
        usual = _usual(np.concatenate([m[1] for m in self.motions]))
        for q, v, a, effort in self.motions:
            angle = self.constants["revolute"] * turned * q
            weight = self.constants["gravity_cos"] * np.cos(angle) + self.constants["gravity_sin"] * np.sin(angle)
            rubs = [v / usual, v * np.abs(v) / usual**2, np.tanh(v / (0.1 * usual)), np.ones_like(v)]
            lines.append([turned * self.constants["inertia"] * a, weight, *rubs, of.effort * effort])
        rows = self._rows(lines)
        if not self.is_driven:  # what the acceleration is by gravity
            rows = np.column_stack([rows[:, 1:-1], -rows[:, 0]])
        columns, wanted = rows[:, :-1], rows[:, -1]
        weights = np.linalg.lstsq(columns / _sizes(columns), wanted, rcond=ALIKE)[0] / _sizes(columns)
        share = float(np.sum((wanted - columns @ weights) ** 2) / max(np.sum((wanted - wanted.mean()) ** 2), 1e-300))
        count = len(rows) / TIMES_SLOWER
        inertia, weight = (weights[0], weights[1]) if self.is_driven else (1.0, weights[0])
        heavy = math.hypot(self.constants["gravity_cos"], self.constants["gravity_sin"]) > 0.0
        heavy &= self.constants["revolute"] > 0.0
        beliefs = _belief(inertia) + (_belief(weight) if heavy else 0.0)
        unlikely = count * math.log(share + 1e-6) + beliefs
        return Tried(of, float(inertia), float(weight) if heavy else math.nan, share, unlikely)

    def answer(self) -> tuple[float, float]:
        """Return the share of the variance of efforts that the angle alone explains, and its factor: of its sine."""
        turns = self.constants["revolute"]
        rows = self._rows([[np.ones_like(q), np.sin(q) if turns else q, effort] for q, _, _, effort in self.motions])
        slope = np.linalg.lstsq(rows[:, :2], rows[:, 2], rcond=None)[0]
        return 1.0 - float(np.var(rows[:, 2] - rows[:, :2] @ slope) / np.var(rows[:, 2])), float(slope[1])

    def units(self) -> list[Convention]:
        """Return the units that columns may be in, but for those that are stated."""
        found = []
        for column, units in UNITS.items():
            words, stated = units[0 if self.constants["revolute"] else 1], self.factors[column]
            if stated in words:
                others = {f: one for f, one in words.items() if f != stated}
                new = ((f"in {one}, not {words[stated]}", {column: f / stated}) for f, one in others.items())
                found += [Convention(column, said, **factor) for said, factor in new]
        return found

    def signs(self) -> list[Convention]:
        """Return the columns that may have the other sign, but for those whose scale is stated."""
        return [c for c in SIGNS if not math.isnan(self.factors[c.column])]

    def _rows(self, lines: Sequence[Sequence[np.ndarray]]) -> np.ndarray:
        """Return the columns of each trial, some of (n,), below the band and as rows: (rows, columns)."""
        each = zip(self.trials, lines, strict=True)
        return np.concatenate([smoothed_rows(t, np.stack(list(one)), self.band) for t, one in each])


def _moving(trials: Sequence[Trial]) -> tuple[bool, list[Trial]]:
    """Return whether efforts drive trials that move, and those; else the trials that move freely, of effort 0."""
    moving = [t for t in trials if "position" in t and len(t) >= FEWEST and 0.0 < np.ptp(t["position"]) < FARTHEST]
    if driven := [t for t in moving if "effort" in t and np.ptp(t["effort"]) > 0.0]:
        return True, driven
    return False, [t.with_columns(effort=np.zeros(len(t))) for t in moving if "effort" not in t]


def _is_long(trial: Trial) -> bool:
    """Return whether a trial has rows in the slowest band."""
    return trial.dt * SLOWEST_HZ < SLOWEST_ROWS and len(trial) * trial.dt * SLOWEST_HZ > 2.0 * ROWS


def _usual(speeds: np.ndarray) -> float:
    """Return the root mean square of speeds, (n,): above 0."""
    return float(np.sqrt(np.mean(speeds**2))) + 1e-300


def _sizes(columns: np.ndarray) -> np.ndarray:
    """Return the root mean square of each column of (n, k), shape (k,): above 0."""
    return np.asarray(np.sqrt(np.mean(np.square(columns), axis=0)) + 1e-300)


def _basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal columns; those that are alike count once."""
    basis, values, _ = np.linalg.svd(columns / _sizes(columns), full_matrices=False)
    return np.asarray(basis[:, values > ALIKE * values[0]])


def _belief(ratio: float) -> float:
    """Return twice the negative logarithm of how likely a ratio to what is believed is; none is below 0."""
    return (math.log(max(ratio, 1e-6)) / BELIEVED) ** 2


def _unit(seen: _Seen) -> tuple[Convention | None, list[str]]:
    """Return the unit that columns are in, where it is taken, and what is said of it."""
    if not seen.is_driven:
        return _unit_of_free_motion(seen)
    ratio = seen.inertia()
    if 1.0 / PHYSICAL < abs(ratio) < PHYSICAL or math.isnan(ratio):
        return None, []
    sign = math.copysign(1.0, ratio)
    tried = [(c, seen.tried(c._replace(effort=sign * c.effort))) for c in seen.units()]
    fits = [t._replace(of=c) for c, t in tried if 1.0 / PHYSICAL < t.inertia < PHYSICAL]
    fits.sort(key=lambda t: t.unlikely)
    if counts := _counted(seen, abs(ratio), fits):
        return None, [counts]
    if fits:
        return _named(fits, abs(ratio))
    if all(math.isnan(f) for f in seen.factors.values()):
        return None, []
    return None, [
        f"efforts show {abs(ratio):.3g} times the inertia of the URDF: is a column in another unit, or the URDF?"
    ]


def _named(fits: Sequence[Tried], ratio: float) -> tuple[Convention | None, list[str]]:
    """Return the likeliest of some units, where it is taken, and what is said of it."""
    best, others = fits[0], [t for t in fits[1:] if t.unlikely - fits[0].unlikely < MARGIN]
    if others:
        either = " or ".join(f"{t.of.column} is {t.of.words} (inertia_scale {t.inertia:.3g})" for t in (best, *others))
        return None, [f"{either}: the data do not tell which, and as stated inertia_scale is {ratio:.3g}"]
    evidence = f"inertia_scale {best.inertia:.3g} instead of {ratio:.3g}"
    is_taken = _belief(best.inertia) < MARGIN and all(t.unlikely - best.unlikely > SURE for t in fits[1:])
    does = "it is read so" if is_taken else "it is read as stated"
    return (best.of if is_taken else None), [f"{best.of.column} is {best.of.words}: {evidence}; {does} ({UNLESS})"]


def _counted(seen: _Seen, ratio: float, fits: Sequence[Tried]) -> str:
    """Return what is said of positions in counts of an encoder; "" where they are in none."""
    whole = all((t["position"] == np.rint(t["position"])).all() for t in seen.trials)
    is_unit = any(_belief(t.inertia) < 1.0 for t in fits)
    if not whole or ratio > 1.0 or is_unit or math.isnan(seen.factors["position"]):
        return ""
    per = (
        f"{2.0 * math.pi / ratio:.3g} counts a turn" if seen.constants["revolute"] else f"{1.0 / ratio:.3g} counts a m"
    )
    evidence = f"inertia_scale is {ratio:.2g}, and 1 with about {per}"
    return f"position is in counts of an encoder, whole numbers alone: {evidence} ({UNLESS})"


def _unit_of_free_motion(seen: _Seen) -> tuple[Convention | None, list[str]]:
    """Return degrees, where a pendulum that nothing drives swings in them and not in rad."""
    c = seen.constants
    if not seen.motions or not c["revolute"] or not math.hypot(c["gravity_cos"], c["gravity_sin"]) > 0.0:
        return None, []
    before = seen.tried(Convention("position", "as stated")).left
    for one in (k for k in seen.units() if k.column == "position" and before > UNFIT):
        tried = seen.tried(one)
        if tried.left < UNFIT * before and 1.0 / PHYSICAL < tried.weight < PHYSICAL:
            leaves = f"gravity leaves {100.0 * tried.left:.2g} % of its acceleration, not {100.0 * before:.3g} %"
            return one, [f"{one.column} is {one.words}: {leaves}; it is read so ({UNLESS})"]
    return None, []


def _sign(seen: _Seen) -> tuple[Convention | None, list[str]]:
    """Return which column has the other sign, where it is taken, and what is said of it."""
    ratio = seen.inertia()
    if not ratio < 0.0 or not (known := seen.signs()):
        return None, []
    best, *others = sorted((seen.tried(c) for c in known), key=lambda t: t.unlikely)
    evidence = f"inertia_scale {-ratio:.3g} instead of {ratio:.3g}, and no cause turns the sign of an inertia"
    if others and others[0].unlikely - best.unlikely < MARGIN:
        which = "effort or position has the other sign, and the data do not tell which"
        return SIGNS[0], [f"{which}: {evidence}; effort is turned round ({UNLESS})"]
    return best.of, [f"{best.of.column} has the other sign: {evidence}; it is turned round ({UNLESS})"]
