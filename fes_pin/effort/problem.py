"""Least squares of the low-passed effort as a problem of `infer`: residuals, sensitivities, weights."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fes_pin.effort.columns import (
    NOMINAL,
    Links,
    Sizes,
    Torques,
    Values,
    backlash,
    frame_vibration,
    library,
    nominal_columns,
    stated_friction,
)
from fes_pin.effort.motion import Band, Motion, Record
from fes_pin.infer.optimum import Optimum
from fes_pin.infer.problem import Linearized, Problem, Unknowns
from fes_pin.models.effects.coulomb_friction import STATED

FREEDOM = 6.0
"""Degrees of freedom of Student's t of a residual, by whose weights sets are compared: a distant row counts little
(Lange, Little and Taylor, J. Am. Stat. Assoc. 84:881, 1989, who find 4 to 8)."""
HELD_ROWS = 0.5
"""Rows by which a command acts late that is held until the next."""
ROUNDS, NEGLIGIBLE = 40, 1e-12
"""Steps of a variance under the weights of Student's t, and its least share of the mean square of the effort."""
STEP = 1e-4
"""Step of a numerical derivative, as a share of the value or of the size at which a cause is tried."""
KEPT_VIEWS, KEPT_COLUMNS = 24, 500
"""Corrections of the reading, and columns, that are kept: those of two steps through all places of the library."""
RUBS = "coulomb_friction"
"""The cause that is beyond the dry friction that is stated."""
SWINGS = "frame_vibration"
"""The cause that changes what an inertia takes of the effort."""
HOLD = "hold_rows"
"""Rows by which an effort acts after it was recorded, a nuisance where the motion is imposed."""
Columns = dict[str, np.ndarray]


class Rows:
    """All trials at their rows: columns by name at any values, each made once.

    Parameters
    ----------
    records
        The trials.
    band
        Their band.
    links
        Of the rig.
    """

    def __init__(self, records: Sequence[Record], band: Band, links: Links) -> None:
        self.band, self.links = band, links
        tracks = [t for t in (Motion(r, band) for r in records) if len(t.rows)]
        self.sizes = _sizes(tracks, links)
        self.tracks = _moving(tracks, self.sizes.fast)
        self.library = library(self.sizes, max(band.low, 3.5))
        self.reversing = [t.reversing(self.sizes.fast) for t in self.tracks]
        self._views: OrderedDict[object, list[Motion]] = OrderedDict()
        self._made: OrderedDict[object, list[Sequence[np.ndarray]]] = OrderedDict()

    @property
    def lengths(self) -> list[int]:
        """Rows of each trial."""
        return [len(t.rows) for t in self.tracks]

    def seen(self, values: Values, names: Sequence[str]) -> tuple[object, list[Motion]]:
        """Return the tracks as sensor causes of a set have them, with a key; a play lies before what reads it."""
        views = sorted((c for c in map(self.library.get, names) if c and c.view), key=lambda c: c.view is backlash)
        key = tuple((c.name, *own(values, c.name).items()) for c in views)
        if not views:
            return key, self.tracks
        if key not in self._views:
            tracks = self.tracks
            for cause in views:
                assert cause.view is not None
                many = [(t, cause.view(t, own(values, cause.name), self.sizes)) for t in tracks]
                tracks = [Motion(t.record, t.band, reading, t.rows) for t, reading in many]
            self._views[key] = tracks
            if len(self._views) > KEPT_VIEWS:
                self._views.popitem(last=False)
        return key, self._views[key]

    def columns(self, values: Values, names: Sequence[str], only: str = "") -> list[Columns]:
        """Return the columns of each trial, by the parameter that multiplies each.

        Parameters
        ----------
        only
            The cause whose columns alone are made; by default those of a set and of the nominal model.
        """
        key, tracks = self.seen(values, names)
        out: list[Columns] = [{} for _ in tracks] if only else self._nominal_columns(key, tracks, values, names)
        for name in (only,) if only else names:
            cause = self.library[name]
            if cause.torques is None:
                continue
            shapes = {n: v for n, v in own(values, name).items() if n not in cause.amplitudes}
            make = partial(self._along, cause.torques, shapes)
            many = self._once((key, name, *shapes.items()), make, tracks)
            for one, made in zip(out, many, strict=True):
                one.update(zip((f"{name}.{n}" for n in cause.amplitudes), made, strict=True))
        for one in out if RUBS in names else ():  # what is stated has the form of what is beyond it
            one.update({STATED: one[f"{RUBS}.torque_nm"]} if STATED in one else {})
        return out

    def _nominal_columns(
        self, key: object, tracks: Sequence[Motion], values: Values, names: Sequence[str]
    ) -> list[Columns]:
        """Return the columns of the nominal model, as a tilt and a frame that swings of a set have them."""
        tilt = values.get("base_tilt.tilt_rad", 0.0) if "base_tilt" in names else 0.0
        many = self._once((key, "", tilt), lambda t: nominal_columns(t, self.links, tilt), tracks)
        out = [dict(zip(NOMINAL, one, strict=True)) for one in many]
        if self.links.friction:
            many = self._once((key, STATED), lambda t: stated_friction(t, self.sizes), tracks)
            for one, (column,) in zip(out, many, strict=True):
                one[STATED] = column
        if SWINGS in names:
            swinging = own(values, SWINGS)
            place = (key, SWINGS, *swinging.items())
            many = self._once(place, lambda t: (frame_vibration(t, swinging, self.links.inertia),), tracks)
            for one, (change,) in zip(out, many, strict=True):
                one["inertia_scale"] = one["inertia_scale"] + change
        return out

    def _along(self, torques: Torques, shapes: Values, track: Motion) -> Sequence[np.ndarray]:
        return torques(track, shapes, self.sizes)

    def _once(
        self, place: object, make: Callable[[Motion], Sequence[np.ndarray]], tracks: Sequence[Motion]
    ) -> list[Sequence[np.ndarray]]:
        """Return what is made of each track, made once."""
        if place not in self._made:
            self._made[place] = [make(t) for t in tracks]
            if len(self._made) > KEPT_COLUMNS:
                self._made.popitem(last=False)
        return self._made[place]

    def efforts(self, values: Values) -> list[np.ndarray]:
        """Return the low-passed effort of each trial, as late as its hold and a sensor's lag have it."""
        hold, lag = values[HOLD], values.get("sensor_lag.lag_s", 0.0)
        many = self._once(("effort", hold, lag), lambda t: (t.effort(hold * t.dt, lag),), self.tracks)
        return [one for (one,) in many]


def own(values: Values, name: str) -> dict[str, float]:
    """Return the values of a cause by its own names."""
    return {n.removeprefix(f"{name}."): v for n, v in values.items() if n.startswith(f"{name}.")}


def _moving(tracks: Sequence[Motion], fast: float) -> list[Motion]:
    """Return trials at the rows in which the joint does not rest: there friction may have any size below its limit."""
    moving = [Motion(t.record, t.band, None, t.rows[~t.resting(fast)]) for t in tracks]
    return [t for t in moving if len(t.rows)]


def _sizes(tracks: Sequence[Motion], links: Links) -> Sizes:
    q, v = (np.concatenate([getattr(t, n) for t in tracks]) for n in "qv")
    marks = (0.02, 0.07, 0.15, 0.3, 0.5, 0.7, 0.85, 0.93, 0.98)
    quantiles = dict(zip(marks, map(float, np.quantile(q, marks)), strict=True))
    usual, fast = float(np.sqrt(np.mean(v**2))), float(np.quantile(np.abs(v), 0.98))
    seconds = max(float(t.time[-1]) for t in tracks)
    return Sizes(float(q.min()), float(q.max()), usual, fast, seconds, quantiles, links)


class EffortProblem(Problem):
    """The effort of a set of causes.

    Parameters
    ----------
    rows
        The trials.
    names
        The set.
    free
        Names of the fitted parameters.
    limits
        Their bounds.
    variances
        Of the noise of usual rows and of those near reversals; None to begin with those of the first residuals.
    robust
        Whether weights are those of Student's t with a variance of its own near reversals; else all rows count alike.
    kept
        Of each trial, the rows that are fitted, as bool; None for all.
    """

    unknown_names = ()

    def __init__(
        self,
        rows: Rows,
        names: Sequence[str],
        limits: dict[str, tuple[float, float]],
        variances: tuple[float, float] | None = None,
        robust: bool = True,
        kept: Sequence[np.ndarray] | None = None,
    ) -> None:
        self.rows, self.names, self.limits, self.free = rows, tuple(names), limits, tuple(limits)
        self.variances, self.robust, self.kept = variances, robust, kept

    def start_unknowns(self) -> Unknowns:
        """Return no unknowns, one empty mapping a trial."""
        return [{} for _ in self.rows.tracks]

    def residuals(self, values: Values) -> tuple[list[np.ndarray], list[Columns]]:
        """Return residuals of each trial in the effort's unit, and the columns of the parameters that are linear."""
        gain = 1.0 + values.get("effort_gain.error", 0.0)
        columns, left = self.rows.columns(values, self.names), []
        for effort, one in zip(self.rows.efforts(values), columns, strict=True):
            left.append(effort - sum(values[n] * column for n, column in one.items()) / gain)
            for n in one:
                one[n] = one[n] / gain
        return left, columns

    def sensitivities(self, values: Values, names: Sequence[str]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return residuals, and derivatives of the prediction by some parameters, shape (m, names), of each trial."""
        left, columns = self.residuals(values)
        many: list[list[np.ndarray]] = [[] for _ in left]
        for name in names:
            step = STEP * max(abs(values[name]), self._scale(name))
            there = None if name in columns[0] else self.residuals({**values, name: values[name] + step})[0]
            for k, one in enumerate(many):
                one.append(columns[k][name] if there is None else (left[k] - there[k]) / step)
        return left, [np.stack(one, axis=1) for one in many]

    def _scale(self, name: str) -> float:
        cause, _, parameter = name.partition(".")
        tried = self.rows.library[cause].amplitudes.get(parameter) if parameter else None
        low, high = self.limits.get(name, (0.0, 1.0))
        return tried[2] if tried and tried[2] else high - low if math.isfinite(high - low) else 1.0

    def linearize(self, values: Values, unknowns: Unknowns) -> list[Linearized]:
        """Return residuals and sensitivities of the fitted rows by their standard deviation."""
        left, slopes = self.sensitivities(values, self.free)
        if self.variances is None:
            self.variances = self._likelier(left)
        parts = []
        for k, (one, slope) in enumerate(zip(left, slopes, strict=True)):
            roots, constant = self.roots(k, one, self.variances)
            at = slice(None) if self.kept is None else self.kept[k]
            scaled = Linearized((one * roots)[at], (slope * roots[:, None])[at], np.zeros((len(one[at]), 0)))
            parts.append(replace(scaled, log_determinant=float(constant[at].sum())))
        return parts

    def roots(self, k: int, left: np.ndarray, variances: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Return the roots of the weights of a trial's rows at residuals, and what makes squares a likelihood.

        With weights (nu + 1) / (nu + r^2 / s^2) the squares have the slope of Student's likelihood.
        """
        variance = np.where(self.rows.reversing[k] & self.robust, variances[1], variances[0])
        if not self.robust:
            return 1.0 / np.sqrt(variance), np.log(variance)
        square = left**2 / variance
        weight = (FREEDOM + 1.0) / (FREEDOM + square)
        constant = np.log(variance) + (FREEDOM + 1.0) * np.log1p(square / FREEDOM) - weight * square
        return np.sqrt(weight / variance), constant

    def _likelier(self, left: Sequence[np.ndarray]) -> tuple[float, float]:
        """Return the variances that are likeliest at residuals."""
        slow = np.concatenate([r & self.robust for r in self.rows.reversing])
        kept = np.ones(len(slow), bool) if self.kept is None else np.concatenate(list(self.kept))
        squares, variances = np.concatenate(left) ** 2, []
        floor = max(NEGLIGIBLE * float(np.mean(np.concatenate(self.rows.efforts({HOLD: 0.0})) ** 2)), 1e-300)
        for group in (~slow & kept, slow & kept):
            some = squares[group] if group.sum() > FREEDOM else squares[kept]
            variance = max(float(np.mean(some)), floor)
            for _ in range(ROUNDS * self.robust):
                weight = (FREEDOM + 1.0) / (FREEDOM + some / variance)
                variance = max(float(np.mean(weight * some)), floor)
            variances.append(variance)
        return variances[0], variances[1]

    def noise_step(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Improve the variances; return by how much twice the negative log-likelihood falls."""
        left, _ = self.residuals(values)
        before = self._cost(left)
        self.variances = self._likelier(left)
        return before - self._cost(left)

    def costs(self, points: Sequence[tuple[Values, Unknowns]]) -> list[float]:
        """Return twice the negative log-likelihood at several points."""
        return [self._cost(self.residuals(values)[0]) for values, _ in points]

    def _cost(self, left: Sequence[np.ndarray]) -> float:
        assert self.variances is not None
        each = ((r, *self.roots(k, r, self.variances), k) for k, r in enumerate(left))
        rows = (np.square(r * root) + constant for r, root, constant, _ in each)
        return float(sum(x[slice(None) if self.kept is None else self.kept[k]].sum() for k, x in enumerate(rows)))


@dataclass(frozen=True, kw_only=True, eq=False)
class EffortFit(Optimum):
    """A fit of a set of causes.

    Attributes
    ----------
    names
        The set, in alphabetical order.
    forms
        Numbers of the forms of each cause that are fitted, by name, where there are some.
    variances
        Of the noise at the end.
    """

    names: tuple[str, ...]
    forms: Mapping[str, tuple[int, ...]]
    variances: tuple[float, float]
