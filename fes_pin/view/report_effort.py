"""The part of the report that shows efforts along the measured motion: in time, their residual, and friction."""

from collections.abc import Mapping

import numpy as np

from fes_pin.diagnosis.along_motion import AlongMotion, along_motion, effort_band, left_out, with_efforts
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.models.model import Model
from fes_pin.view.drawing import Drawing, panels, rows_csv, svg
from fes_pin.view.missing import Missing, binned
from fes_pin.view.page import Markup, element, figure, folded, joined, key
from fes_pin.view.plots import MODELS, NARROW, OVER_RESIDUAL, add_legend, instants, missing_drawing, over_residual
from fes_pin.view.report_trials import OPEN
from fes_pin.view.style import COLOURS, WIDTHS, label, quantity, short_unit

THIRDS = {"lower": "stage-sensor", "middle": "stage-joint", "upper": "stage-muscle"}
"""Colours of the dots of a friction map, by the third of the positions that they are in."""


def effort_section(diagnosis: Diagnosis) -> list[Markup]:
    """Efforts along the measured motion of a joint whose effort was recorded; nothing of another rig."""
    rig = diagnosis.model.rig
    trials = with_efforts(rig, diagnosis.study.trials)
    if (band := effort_band(rig, trials)) is None:
        return []
    models = {"nominal": diagnosis.nominal.model} | ({"extended": diagnosis.model} if diagnosis.causes else {})
    if not (shown := along_motion(models, trials, band)):
        return []
    names = left_out(diagnosis.model, trials)
    absent = f" Not in the prediction of the extended model: {', '.join(names)}." * bool(names)
    text = (
        "The effort that a model needs for the motion as it was measured, by inverse dynamics. Measured and predicted "
        f"effort pass the same low pass of {band.low:.3g} Hz (-3 dB).{absent} Where the joint rests, friction takes "
        "any value up to its largest, and a residual says little."
    )
    return [element("p", text), *_in_time(shown, rig.units()["effort"]), *_against(shown, models, rig.units())]


def _in_time(shown: list[AlongMotion], unit: str) -> list[Markup]:
    """Return a figure of each trial, largest residuals first."""
    largest = sorted(enumerate(shown, 1), key=lambda pair: -float(np.std(pair[1].residual("nominal"))))
    figures = [figure(effort_drawing(one, unit), one.name, file=f"effort_{k}") for k, one in largest]
    first, others = (element("div", joined(part), class_="grid") for part in (figures[:OPEN], figures[OPEN:]))
    return [first, folded("Show the other trials, with smaller residuals", others)] if figures[OPEN:] else [first]


def _against(shown: list[AlongMotion], models: Mapping[str, Model], units: Mapping[str, str]) -> list[Markup]:
    """Return the residual against speed and angle, and the friction of the model that has most causes."""
    unit, q, last = units["effort"], units["q"], [*models][-1]
    before, after = ([_missing(one, n, unit) for one in shown] for n in ("nominal", last))
    drawn = {n: missing_drawing(before, after if len(models) > 1 else [], n, q) for n in ("rate", "angle")}
    grid = joined([figure(one, file=f"effort_against_{n}") for n, one in drawn.items()])
    extended = [("extended", "extended, median")] * (len(models) > 1)
    words = (
        f"Friction: the measured effort without all that the {last} model has but damping, dry friction and drag. Dots "
        f"are instants, thin lines their medians, by thirds of the {quantity('position', q)[0]}. Where the thirds "
        "differ, friction depends on the position, or on the way since the joint turned."
    )
    return [
        element("h3", "Missing effort: measured minus predicted"),
        key(("nominal", "nominal, instants"), ("measured", "nominal, median"), *extended),
        element("div", grid, class_="grid three"),
        element("h3", "Friction map"),
        key((last, f"fitted, {last}"), *((colour, f"{name} third") for name, colour in THIRDS.items())),
        element("div", figure(friction_drawing(shown, last, unit, q), words, file="friction_map"), class_="grid three"),
    ]


def _missing(one: AlongMotion, of: str, unit: str) -> Missing:
    return Missing("effort", unit, one.residual(of), {"rate": one.velocity, "angle": one.position})


def effort_drawing(one: AlongMotion, unit: str) -> Drawing:
    """Effort of one trial: measured over predicted, and the residual (measured - predicted) below.

    Parameters
    ----------
    unit
        Of the effort.
    """
    curves = {"measured": one.measured, **one.predicted}
    drawing, axes = panels(OVER_RESIDUAL)
    over_residual(axes[:, 0], one.time, curves, MODELS, ("effort", unit))
    axes[-1, 0].set_xlabel("time (s)")
    add_legend(drawing, {n: MODELS[n] for n in curves})
    off = ", ".join(f"{n} model at most {np.abs(one.residual(n)).max():.3g} {unit} off" for n in one.predicted)
    words = f"Effort from {one.measured.min():.3g} to {one.measured.max():.3g} {unit}, trial {one.name}; {off}."
    return Drawing.of(svg(drawing, words), {"time_s": one.time, **{f"effort_{n}": v for n, v in curves.items()}})


def friction_drawing(shown: list[AlongMotion], of: str, unit: str, position_unit: str) -> Drawing:
    """Friction map: what a model leaves of the effort but friction, against speed, with the model's friction.

    Small dots are rows of all trials, in colours by thirds of the positions, thin lines their medians; large dots are
    the fitted friction, a curve where it depends on the speed alone.

    Parameters
    ----------
    of
        Name of the model.
    unit, position_unit
        Of the effort and of the position.
    """
    velocity, position = (np.concatenate([getattr(one, n) for one in shown]) for n in ("velocity", "position"))
    value = np.concatenate([one.without_others(of) for one in shown])
    fitted = np.concatenate([one.friction[of] for one in shown])
    factor, small = short_unit(value, unit)
    drawing, axes = panels([150.0], NARROW, 58.0)
    panel = axes[0, 0]
    panel.axhline(color=COLOURS["faint"], linewidth=0.8)
    panel.plot(velocity, factor * fitted, "o", color=COLOURS[of], markersize=WIDTHS["extended"], markeredgewidth=0.0)
    rows: list[tuple[str | float, ...]] = [("fitted", velocity[k], fitted[k]) for k in instants(velocity, fitted)]
    thirds = np.searchsorted(np.quantile(position, (1.0 / 3.0, 2.0 / 3.0)), position)
    for k, (name, colour) in enumerate(THIRDS.items()):
        for side in (velocity < 0.0, velocity >= 0.0):  # friction jumps between them
            x, y = (v[side & (thirds == k)] for v in (velocity, value))
            if len(x) < 2:
                continue
            chosen, (there, middle, _) = instants(x, y), binned(y, x)
            panel.plot(x[chosen], factor * y[chosen], ".", color=COLOURS[colour], markersize=2.4, alpha=0.6)
            panel.plot(there, factor * middle, color=COLOURS[colour], linewidth=1.4)
            rows += [(name, *pair) for pair in zip(x[chosen], y[chosen], strict=True)]
    panel.set(xlabel=label("velocity", position_unit), ylabel=f"friction ({small})")
    against, place = label("velocity", position_unit), quantity("position", position_unit)[0]
    words = f"Friction against {against}, by thirds of the {place}; "
    words += f"fitted from {fitted.min():.3g} to {fitted.max():.3g} {unit}."
    return Drawing(svg(drawing, words), rows_csv(("what", against, f"friction ({unit})"), rows))
