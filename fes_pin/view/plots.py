"""Figures of a diagnosis: trials with their residuals, missing torque, ranking of the causes.

Each takes results and returns a matplotlib `Figure` of its own, without pyplot's state. No text of the study stands in
a figure: its words belong to the page around it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as MplPath

from fes_pin.data.trial import Trial
from fes_pin.diagnose.replay import Replay
from fes_pin.identify.noise import NoiseModel
from fes_pin.view.missing import Missing, binned, explained, smoothed
from fes_pin.view.style import (
    BAND,
    EXTENDED,
    FAINT,
    MEASURED,
    NOMINAL,
    PANEL,
    STIMULUS,
    WIDTH,
    bare,
    label,
    legend_above,
    milli,
    styled,
    thin_curve,
    unit_of,
)

DOTS = 500
"""Dots of one panel."""
PULSES = 400
"""Single pulses that are drawn; more of them become a grey band."""


def trial_figure(
    one: Replay, noise: NoiseModel, position_unit: str = "rad", extended: bool = True, legend: bool = True
) -> Figure:
    """One trial: measured over simulated, the residual (measured - simulated) beneath, the stimulus as a strip.

    The residual is drawn as it is, faint, and smoothed.

    Parameters
    ----------
    one
        The trial.
    noise
        Of each output; the residual's band is twice its standard deviation.
    position_unit
        "rad" or "m".
    extended
        False where the extended model is the nominal one.
    legend
        False where the page has one.
    """
    stimulus = [n for n in one.measured.columns if n not in one.outputs]
    heights = [h for _ in one.outputs for h in (2.0, 1.2)] + [0.42] * len(stimulus)
    with styled():
        figure = Figure(figsize=(WIDTH, 0.65 + 0.3 * legend + 0.78 * sum(heights)))
        total = figure.get_figheight()
        margins = {"left": 0.165, "right": 0.985, "top": 1 - (0.08 + 0.24 * legend) / total, "bottom": 0.5 / total}
        grid = figure.add_gridspec(len(heights), 1, height_ratios=heights, hspace=0.16, **margins)
        rows = [figure.add_subplot(grid[k]) for k in range(len(heights))]
        for k, name in enumerate(one.outputs):
            _curves(rows[2 * k], one, name, extended)
            rows[2 * k].set_ylabel(label(name, position_unit))
            beneath = rows[2 * k + 1]
            factor, unit = milli(one.measured.residual(one.nominal, name), unit_of(name, position_unit))
            band = factor * 2.0 * noise[name].std if name in noise else 0.0
            beneath.axhspan(-band, band, color=BAND, lw=0)
            _residuals(beneath, one, name, extended, factor)
            beneath.set_ylabel(f"residual\n({unit})")
        for axes, name in zip(rows[2 * len(one.outputs) :], stimulus, strict=True):
            _strip(axes, one.measured, name)
            axes.set_ylabel(_short(label(name, position_unit)), rotation=0, ha="center", va="center", fontsize=9.0)
        for axes in rows:
            axes.set_xlim(one.measured.time[0], one.measured.time[-1])
            axes.yaxis.set_label_coords(-0.125, 0.5)
        for axes in rows[2 * len(one.outputs) :]:
            axes.yaxis.set_label_coords(-0.145, 0.4)
        for axes in rows[:-1]:
            bare(axes)
        rows[-1].set_xlabel("time (s)")
        if legend:
            handles, names = rows[0].get_legend_handles_labels()
            legend_above(figure, handles[::-1], names[::-1])
    return figure


def _short(text: str) -> str:
    return text.replace("pulse width", "width").replace(" (", "\n(")


def _curves(axes: Axes, one: Replay, name: str, extended: bool) -> None:
    """Simulations behind, the measurement in front."""
    time = one.measured.time
    if extended:
        axes.plot(*thin_curve(time, one.extended[name]), color=EXTENDED, lw=4.0, label="extended")
    axes.plot(*thin_curve(time, one.nominal[name]), color=NOMINAL, lw=1.8, label="nominal")
    axes.plot(*thin_curve(time, one.measured[name]), color=MEASURED, lw=0.9, label="measured")


def _residuals(axes: Axes, one: Replay, name: str, extended: bool, factor: float) -> None:
    """Residuals of both models, as they are and smoothed."""
    models = [(one.nominal, NOMINAL)] + [(one.extended, EXTENDED)] * extended
    raw = [one.measured.residual(simulated, name) for simulated, _ in models]
    axes.axhline(0.0, color=FAINT, lw=0.7)
    for residual, (_, colour) in zip(raw, models, strict=True):
        axes.plot(*thin_curve(one.measured.time, factor * residual, 220), color=colour, lw=0.6, alpha=0.4)
    for residual, (_, colour) in zip(raw, models, strict=True):
        axes.plot(*thin_curve(*smoothed(one.measured.time, factor * residual), 220), color=colour, lw=1.9)
    limit = 1.1 * factor * max(float(np.abs(r).max()) for r in raw)
    axes.set_ylim(-limit or -1.0, limit or 1.0)
    axes.locator_params(axis="y", nbins=4)


def _strip(axes: Axes, trial: Trial, name: str) -> None:
    """The stimulus, thin and without a scale of its own but its end points."""
    time, values = trial.time, trial[name]
    if name == "stim":
        times = time[values > 0.5]
        axes.set_yticks([])
        if len(times) <= PULSES:
            axes.vlines(times, 0.0, 1.0, color=STIMULUS, lw=0.6)
        else:
            axes.fill_between(*thin_curve(time, values), color=STIMULUS, lw=0)
        return
    axes.fill_between(*thin_curve(time, values), step="post", color=STIMULUS, alpha=0.55, lw=0)
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    axes.set_ylim(low, high if high > low else low + 1.0)
    ends = [low, high] if low < 0.0 < high else [high if high > 0 else low]
    axes.set_yticks(ends, [f"{v:.0f}" if abs(v) >= 100 else f"{v:.3g}" for v in ends], fontsize=8.5)


def missing_figure(
    before: Sequence[Missing], after: Sequence[Missing], name: str, position_unit: str = "rad", legend: bool = True
) -> Figure:
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
    position_unit, legend
        As in `trial_figure`.
    """
    with styled():
        figure = Figure(figsize=(PANEL, 2.5 + 0.25 * legend))
        axes = figure.add_axes((0.19, 0.19, 0.77, 0.72 - 0.08 * legend))
        factor, unit = milli(np.concatenate([m.value for m in before]), before[0].unit)
        _against(axes, before, after, name, factor)
        limit = factor * _limit(before)
        axes.set(ylim=(-limit, limit), xlabel=label(name, position_unit))
        axes.set_ylabel(f"missing {before[0].kind} ({unit})")
        axes.yaxis.set_label_coords(-0.17, 0.5)
        axes.locator_params(axis="both", nbins=5)
        if legend:
            legend_above(figure, *axes.get_legend_handles_labels())
    return figure


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


def _against(axes: Axes, before: Sequence[Missing], after: Sequence[Missing], name: str, factor: float) -> None:
    x, value = _joined(before, name)
    axes.axhline(0.0, color=FAINT, lw=0.7)
    chosen = _spread(x, value)
    _dots(axes, x[chosen], factor * value[chosen])
    axes.plot(*_medians(x, factor * value), color=MEASURED, lw=1.8, marker="o", ms=3.4, label="nominal")
    if after:
        at, left = _joined(after, name)
        axes.plot(*_medians(at, factor * left), color=EXTENDED, lw=2.6, label="extended")
    axes.set_title(f"{100 * explained(value, x):.0f} % of its variance", fontsize=9.5, loc="right", pad=3)


def _spread(x: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Instants at about equal distances along the curve in a panel: rest is drawn once, motion in full."""
    steps = np.abs(np.diff(x)) / max(float(np.ptp(x)), 1e-300) + np.abs(np.diff(value)) / max(
        float(np.ptp(value)), 1e-300
    )
    along = np.concatenate([[0.0], np.cumsum(steps + 0.3 * steps.mean() + 1e-12)])
    return np.unique(np.searchsorted(along, np.linspace(0.0, along[-1], min(DOTS, len(x)))))


def _dots(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Dots as one path of round pen-downs: a tenth of the size of single markers."""
    ends = np.stack([x, x + 1e-6 * max(float(np.ptp(x)), 1e-12)], axis=1)
    vertices = np.stack([ends, np.stack([y, y], axis=1)], axis=2).reshape(-1, 2)
    path = MplPath(vertices, np.tile([MplPath.MOVETO, MplPath.LINETO], len(x)))
    path.should_simplify = False
    pen = {"lw": 2.4, "edgecolor": NOMINAL, "alpha": 0.6, "capstyle": "round"}
    axes.add_patch(PathPatch(path, fill=False, **pen))


def _medians(x: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    groups = binned(value, x)
    return np.array([at for at, _ in groups]), np.array([float(np.median(v)) for _, v in groups])


def stimulus_figure(trial: Trial, position_unit: str = "rad") -> Figure:
    """The inputs of a trial that is still to be run."""
    names = list(trial.columns)
    with styled():
        figure = Figure(figsize=(WIDTH, 0.6 + 1.0 * len(names)))
        for k, name in enumerate(names):
            axes = figure.add_subplot(len(names), 1, k + 1)
            _strip(axes, trial, name)
            axes.set(ylabel=label(name, position_unit), xlim=(trial.time[0], trial.time[-1]), xlabel="time (s)")
        figure.subplots_adjust(left=0.16, right=0.985, bottom=0.48 / figure.get_figheight(), top=0.96)
    return figure


def by_kind(many: Sequence[Missing]) -> Mapping[str, list[int]]:
    """Which of them can share a figure, by kind."""
    out: dict[str, list[int]] = {}
    for k, one in enumerate(many):
        out.setdefault(one.kind, []).append(k)
    return out
