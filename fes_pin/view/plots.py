"""Figures of a diagnosis: trials with their residuals, missing torque, the inputs of a trial still to be run.

Each takes results and returns a `Drawing`. No text of the study stands in a figure but in its description.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.replay import Replay
from fes_pin.infer.noise import NoiseModel
from fes_pin.infer.text import percent
from fes_pin.view.chart import Panel, limits_of, svg, tick_text
from fes_pin.view.drawing import Drawing, rows_csv
from fes_pin.view.missing import Missing, binned, explained, smoothed
from fes_pin.view.style import WIDTHS, label, milli, thin_curve, unit_of

DOTS = 500
"""Dots of one panel."""
PULSES = 400
"""Single pulses that are drawn; more of them become a grey band."""
POINTS = 350
"""Stretches of a curve that keep their extremes."""
FEWEST = 60
"""Of these, in a study of so many trials that the page would be too large."""
ON_PAGE = 25_000
"""Stretches of all trials of a study together."""
WIDE, NARROW, LEFT, GAP = 420.0, 330.0, 66.0, 10.0
"""Widths of a trial's figure and of a panel of the missing torque, room for the axis on the left and between panels."""


def points_of(trials: int) -> int:
    """Stretches of each curve in a study of so many trials: the page stays within about 10 MB."""
    return max(FEWEST, min(POINTS, ON_PAGE // max(trials, 1)))


def trial_drawing(
    one: Replay, noise: NoiseModel, position_unit: str = "rad", points: int = POINTS, alone: bool = False
) -> Drawing:
    """One trial: measured over simulated, the residual (measured - simulated) below, the stimulus as a strip.

    The residual is drawn as it is, faint, and smoothed.

    Parameters
    ----------
    one
        The trial.
    noise
        Of each output; the residual's band is twice its standard deviation.
    position_unit
        "rad" or "m".
    points
        Stretches of each curve that keep their extremes.
    alone
        True for a file of its own.
    """
    time, top, panels = one.measured.time, 8.0, []
    columns = {"time_s": time}
    for name in one.outputs:
        curves = {of: trial[name] for of, trial in (*one.models.items(), ("measured", one.measured))}
        columns |= {f"{name}_{of}": values for of, values in reversed(curves.items())}
        panel = Panel(LEFT, top, WIDE - LEFT - 8, 130, (time[0], time[-1]), limits_of(*curves.values()))
        for of, values in curves.items():
            panel.line(*thin_curve(time, values, points), of, WIDTHS[of])
        panel.y_axis(label(name, position_unit))
        factor, unit = milli(one.residuals(name)["nominal"], unit_of(name, position_unit))
        band = factor * 2.0 * noise[name].std if name in noise else 0.0
        beneath = _residuals(one, name, factor, band, points, top + 130 + GAP)
        beneath.y_axis(f"residual\n({unit})", title_at=26)
        panels += [panel, beneath]
        top += 130 + GAP + 76 + GAP
    for name in (n for n in one.measured.columns if n not in one.outputs):
        columns[name] = one.measured[name]
        panels.append(_strip(one.measured, name, top, position_unit, points))
        top += 28 + GAP
    panels[-1].x_axis("time (s)")
    drawn = svg(panels, WIDE, top + 28, described(one, position_unit), alone)
    return Drawing.of(drawn, columns, 2 * points)


def described(one: Replay, position_unit: str) -> str:
    """A trial in words: what was measured, and by how much each model misses it."""
    trial, words = one.measured, []
    for name in one.outputs:
        what, unit = label(name, position_unit).partition(" (")[0], unit_of(name, position_unit)
        missed = [f"{of} model at most {_short(np.abs(r).max())} {unit} off" for of, r in one.residuals(name).items()]
        low, high = _short(trial[name].min()), _short(trial[name].max())
        words.append(f"{what} from {low} to {high} {unit}; {', '.join(missed)}")
    errors = ", extended ".join(percent(e) for e in one.errors)
    return f"Trial {trial.name}, {trial.kind}, {trial.duration:.3g} s: {'. '.join(words)}. E nominal {errors}."


def _short(value: float) -> str:
    return f"{float(value):.3g}"


def _residuals(one: Replay, name: str, factor: float, band: float, points: int, top: float) -> Panel:
    """Residuals of the models, as they are and smoothed."""
    time, few = one.measured.time, max(FEWEST, round(0.6 * points))
    residuals = {of: factor * r for of, r in one.residuals(name).items()}
    limit = 1.1 * max(float(np.abs(r).max()) for r in residuals.values()) or 1.0
    panel = Panel(LEFT, top, WIDE - LEFT - 8, 76, (time[0], time[-1]), (-limit, limit))
    panel.box(panel.x, (-band, band), "band")
    panel.zero()
    for of, residual in residuals.items():
        panel.line(*thin_curve(time, residual, few), of, 0.6, 0.45)
    for of, residual in residuals.items():
        panel.line(*thin_curve(*smoothed(time, residual), few), of, 1.9)
    return panel


def _strip(trial: Trial, name: str, top: float, position_unit: str, points: int) -> Panel:
    """The stimulus, thin and without a scale of its own but its end points."""
    time, values = trial.time, trial[name]
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    limits = (low, high if high > low else low + 1.0)
    panel = Panel(LEFT, top, WIDE - LEFT - 8, 28, (float(time[0]), float(time[-1])), limits)
    if name == "stim":
        times = time[values > 0.5]
        if len(times) <= PULSES:
            edges = np.repeat(times, 3)
            panel.line(edges, np.tile([0.0, 1.0, np.nan], len(times)), "stimulus", 0.7)
        else:
            panel.filled(*thin_curve(time, values, points), "stimulus", 0.6)
        panel.y_axis("pulses", [], 30)
        return panel
    panel.filled(*thin_curve(time, values, points), "stimulus", 0.55)
    ends = [low, high] if low < 0.0 < high else [high if high > 0 else low]
    step = 1.0 if max(map(abs, ends)) >= 100 else 10.0 ** np.floor(np.log10(max(*map(abs, ends), 1e-9)) - 1)
    panel.y_axis("", [(v, tick_text(v, step)) for v in ends])
    words = label(name, position_unit).replace("pulse width", "width").replace(" (", "\n(").split("\n")
    for k, line in enumerate(words):
        panel.text(2, top + 11 + 12 * k, line)
    return panel


def missing_drawing(
    before: Sequence[Missing], after: Sequence[Missing], name: str, position_unit: str = "rad"
) -> Drawing:
    """Missing torque (or force) against one variable.

    Dots are instants of all trials; the lines join the medians of bins of equal width. The percentage says how much of
    the variance is a function of that variable alone.

    Parameters
    ----------
    before
        Of the nominal model, trial by trial, all of one kind.
    after
        Of the extended model; empty where it is the nominal one.
    name
        Of the variable.
    position_unit
        As in `trial_drawing`.
    """
    x, value = _joined(before, name)
    factor, unit = milli(value, before[0].unit)
    limit, room = factor * _limit(before), 0.03 * float(np.ptp(x)) or 1.0
    panel = Panel(58, 22, NARROW - 66, 150, (float(x.min()) - room, float(x.max()) + room), (-limit, limit))
    panel.zero()
    chosen = _spread(x, value)
    panel.dots(x[chosen], factor * value[chosen], "nominal", opacity=0.6)
    at, middle = _medians(x, value)
    panel.line(at, factor * middle, "measured", 1.8)
    rows: list[tuple[str | float, ...]] = [("instant", a, b) for a, b in zip(x[chosen], value[chosen], strict=True)]
    rows += [("median_nominal", a, b) for a, b in zip(at, middle, strict=True)]
    left = ""
    if after:
        there, stays = _medians(*_joined(after, name))
        panel.line(there, factor * stays, "extended", 2.8)
        rows += [("median_extended", a, b) for a, b in zip(there, stays, strict=True)]
        left = f"; of the extended model from {_short(stays.min())} to {_short(stays.max())} {before[0].unit}"
    share_of = explained(value, x)
    panel.text(NARROW - 8, 14, f"{100 * share_of:.0f} % of its variance", "end")
    panel.x_axis(label(name, position_unit))
    panel.y_axis(f"missing {before[0].kind} ({unit})")
    words = (
        f"Missing {before[0].kind} against {label(name, position_unit)}: its median in bins runs from "
        f"{_short(middle.min())} to {_short(middle.max())} {before[0].unit}{left}. "
        f"{100 * share_of:.0f} % of its variance is a function of this alone."
    )
    head = ("what", label(name, position_unit).replace(",", ""), f"missing {before[0].kind} ({before[0].unit})")
    return Drawing(svg([panel], NARROW, 212, words), rows_csv(head, rows))


def share(before: Sequence[Missing], name: str) -> float:
    """Share of the missing input's variance that is a function of one variable alone, 0 to 1."""
    x, value = _joined(before, name)
    return explained(value, x)


def _joined(many: Sequence[Missing], name: str) -> tuple[np.ndarray, np.ndarray]:
    return np.concatenate([m.against[name] for m in many]), np.concatenate([m.value for m in many])


def _limit(many: Sequence[Missing]) -> float:
    """Half the height of a panel: all but the few largest values."""
    values = np.abs(np.concatenate([m.value for m in many]))
    return max(1.15 * float(np.quantile(values, 0.995)), 1e-12)


def _spread(x: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Instants at about equal distances along the curve in a panel: rest is drawn once, motion in full."""
    steps = np.abs(np.diff(x)) / max(float(np.ptp(x)), 1e-300) + np.abs(np.diff(value)) / max(
        float(np.ptp(value)), 1e-300
    )
    along = np.concatenate([[0.0], np.cumsum(steps + 0.3 * steps.mean() + 1e-12)])
    return np.unique(np.searchsorted(along, np.linspace(0.0, along[-1], min(DOTS, len(x)))))


def _medians(x: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    groups = binned(value, x)
    return np.array([at for at, _ in groups]), np.array([float(np.median(v)) for _, v in groups])


def stimulus_drawing(trial: Trial, position_unit: str = "rad") -> Drawing:
    """The inputs of a trial that is still to be run."""
    panels = [_strip(trial, name, 8 + 38 * k, position_unit, POINTS) for k, name in enumerate(trial.columns)]
    panels[-1].x_axis("time (s)")
    ranges = ", ".join(
        f"{label(n, position_unit)} from {_short(v.min())} to {_short(v.max())}" for n, v in trial.columns.items()
    )
    drawn = svg(panels, WIDE, 8 + 38 * len(panels) + 28, f"Inputs of the next trial, {trial.duration:.3g} s: {ranges}.")
    return Drawing.of(drawn, {"time_s": trial.time, **trial.columns})
