"""Sections of the report of a walk: the ground reaction, and the extended body."""

from collections.abc import Mapping

import numpy as np

from fes_pin.view.drawing import Drawing, panels, svg
from fes_pin.view.page import Markup, element, figure, key, section
from fes_pin.view.sections import Parts, not_testable
from fes_pin.view.style import COLOURS
from fes_pin.view.walk_playback import PLAYBACK_FILE, playback_html
from fes_pin.walk.judge import CHANNELS
from fes_pin.walk.result import BODY_FILE, WalkDiagnosis
from fes_pin.walk.walk_trial import stretches

SHOWN_S = 4.0
"""Longest part of each trial that is shown, s."""
ROW = 144.0
"""Height of a channel."""
PYTHON = f'import fes_pin as fp\n\nbody = fp.Body.from_urdf("{BODY_FILE}")\nlinear = fp.linearize(body, "mid_stance")'


def _counts(diagnosis: WalkDiagnosis) -> str:
    """Return the number of strides, in words."""
    return f"{diagnosis.models.designs.strides.count} strides"


def _sections(diagnosis: WalkDiagnosis) -> list[Markup]:
    """Its own sections."""
    words = f"The extended body stands next to this page, the walk to be watched in {PLAYBACK_FILE}."
    return [
        section("Ground reaction", *_trials(diagnosis)),
        not_testable(diagnosis, diagnosis.absorbed, "soft tissue and noise hide these at their usual size"),
        section("The body, to be used", element("p", words), element("pre", PYTHON)),
    ]


def _trials(diagnosis: WalkDiagnosis) -> list[Markup]:
    designs, best = diagnosis.models.designs, diagnosis.best
    extended = [("extended", "required by the extended model")] if best.names else []
    out = [key(("measured", "measured"), ("nominal", "required"), *extended)]
    for number, trial in enumerate(designs.as_read.trials):
        curves = {"nominal": trial.needed, "measured": trial.measured}
        if best.names:
            with_it = designs.design(best.names).trials[number]
            made = trial.measured - (with_it.residual - designs.signals(best.names, with_it) @ best.fitted.values)
            curves = {"extended": made, **curves}
        single = trial.plates.loaded["left"] ^ trial.plates.loaded["right"]
        drawn = _drawing(trial.name, trial.motion.time, curves, single)
        words = f"Trial {trial.name}, at most {SHOWN_S:g} s of it; single supports are shaded."
        out.append(figure(drawn, words, file=trial.name))
    return out


def _drawing(trial: str, time: np.ndarray, curves: Mapping[str, np.ndarray], single: np.ndarray) -> Drawing:
    """Six channels about the centre of mass, forces on the left and moments on the right.

    Parameters
    ----------
    curves
        Each of shape (n, 6), by the name of its colour, the last in front.
    single
        Shape (n,): whether one foot alone is on the ground.
    """
    shown = time <= time[0] + SHOWN_S
    time = time[shown]
    columns, words = {"time_s": time}, []
    drawing, axes = panels([ROW] * 3, columns=2)
    for channel, (name, panel) in enumerate(zip(CHANNELS, axes.T.flat, strict=True)):
        unit = "N" if channel < 3 else "N m"
        own = {of: values[shown, channel] for of, values in curves.items()}
        columns |= {f"{name.replace(' ', '_')}_{of}": values for of, values in reversed(own.items())}
        for rows in stretches(single[shown]):
            panel.axvspan(time[rows.start], time[rows.stop - 1], color=COLOURS["band"])
        for of, values in own.items():
            panel.plot(time, values, color=COLOURS[of], linewidth=2.4 if of == "extended" else 1.2)
        panel.set_ylabel(f"{name} ({unit})".replace(" about", "\nabout"))
        words.append(f"{name} from {own['measured'].min():.3g} to {own['measured'].max():.3g} {unit}")
    for panel in axes[-1]:
        panel.set_xlabel("time (s)")
    return Drawing.of(svg(drawing, f"Ground reaction of trial {trial}: {', '.join(words)}."), columns)


PARTS = Parts(_counts, _sections, ("not testable",), {PLAYBACK_FILE: playback_html}, "Residual = measured - required. ")
