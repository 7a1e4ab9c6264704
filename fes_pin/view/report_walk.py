"""Sections of the report of a walk: the ground reaction, and the extended body; and the walk to look at.

There the body moves as measured, with the ground reactions that were read and are required.
"""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from fes_pin.view.arrows import Arrow
from fes_pin.view.drawing import Drawing, panels, svg
from fes_pin.view.page import Markup, element, figure, section
from fes_pin.view.plots import MEASURED, OVER_RESIDUAL, add_legend, over_residual
from fes_pin.view.sections import Parts, not_testable
from fes_pin.view.style import COLOURS
from fes_pin.view.viewer import FRAMES_A_SECOND, BodyScene
from fes_pin.walk.judge import CHANNELS
from fes_pin.walk.motion import Motion
from fes_pin.walk.result import BODY_FILE, WalkDiagnosis
from fes_pin.walk.walk_trial import LOADED_N, Plates, stretches

PLAYBACK_FILE = "playback.html"
METRES_A_NEWTON = 2e-3
"""An arrow of 1 m is a force of 500 N."""
SEEN_THROUGH = 0.35
READ, REQUIRED = 0x17191C, 0xD55E00
"""Colours of `view.style`: measured, nominal."""
LONGEST_S = 4.0


def playback_html(diagnosis: WalkDiagnosis) -> str:
    """The first trial of a diagnosis of walking as a page that plays it."""
    first = diagnosis.models.designs.as_read.trials[0]
    return show_reactions(first.motion, first.plates, f"{diagnosis.study.name}, {first.name}").html()


def show_reactions(motion: Motion, plates: Plates, caption: str = "") -> BodyScene:
    """The walk with the ground reaction of both feet together as read (black) and as the motion requires (orange).

    Arrows start where the reactions pierce the ground. The body walks on the spot: its centre of mass's mean way is
    taken off. A long walk is shown to its first seconds, at about 30 frames a second.

    Parameters
    ----------
    motion, plates
        On one clock.
    caption
        Shown before what the arrows are.
    """
    every = max(1, round(1.0 / (FRAMES_A_SECOND * motion.dt)))
    rows = slice(0, int(LONGEST_S / motion.dt) + 1, every)
    part = motion.part(rows)
    way = _way(motion)[rows]
    read = Arrow(*_arrow(plates.total[rows], way), READ)
    needed = Arrow(*_arrow(part.required, way), REQUIRED)
    words = "ground reaction of both feet: read (black), required by the motion (orange); 1 m is 500 N"
    scene = BodyScene(motion.body, f"{caption}: {words}" if caption else words, fps=round(1.0 / (every * motion.dt)))
    scene.opacity = SEEN_THROUGH
    scene.play(part.q[:, 7:])
    places = (pin.XYZQUATToSE3(q[:7]) for q in part.q)
    scene.carry([pin.SE3(place.rotation, place.translation - off) for place, off in zip(places, way, strict=True)])
    scene.arrows += [read, needed]
    return scene


def _way(motion: Motion) -> np.ndarray:
    """Return the mean path of the walk, (n, 3) m: a straight line at steady speed, on the ground."""
    line = np.stack([np.ones_like(motion.time), motion.time - motion.time[0]], axis=1)
    way = line @ np.linalg.lstsq(line, motion.centre, rcond=None)[0]
    way[:, 2] = 0.0
    return way


def _arrow(wrench: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Foot and vector of a reaction; nothing where the feet carry nothing."""
    up = wrench[:, 2] > LOADED_N
    pressure = np.column_stack([-wrench[:, 4], wrench[:, 3]]) / np.where(up, wrench[:, 2], np.inf)[:, None]
    foot = np.column_stack([pressure, np.zeros(len(wrench))]) - np.where(up[:, None], way, 0.0)
    return foot, METRES_A_NEWTON * wrench[:, :3] * up[:, None]


SHOWN_S = 4.0
"""Longest part of each trial that is shown, s."""
LEGEND = {
    **MEASURED,
    "nominal": ("nominal", "required, nominal body"),
    "extended": ("extended", "required, extended body"),
}
"""Legend of the ground reaction."""
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
    designs, best, out = diagnosis.models.designs, diagnosis.best, []
    for number, trial in enumerate(designs.as_read.trials):
        curves = {"measured": trial.measured, "nominal": trial.needed}
        if best.names:
            with_it = designs.design(best.names).trials[number]
            made = trial.measured - (with_it.residual - designs.signals(best.names, with_it) @ best.fitted.values)
            curves["extended"] = made
        single = trial.plates.loaded["left"] ^ trial.plates.loaded["right"]
        drawn = _drawing(trial.name, trial.motion.time, curves, single)
        words = f"Trial {trial.name}, at most {SHOWN_S:g} s of it; single supports are shaded."
        out.append(figure(drawn, words, file=trial.name))
    said = "Residual = measured - required, as it is (faint) and smoothed."
    return [element("p", said, class_="soft"), *out]


def _drawing(trial: str, time: np.ndarray, curves: Mapping[str, np.ndarray], single: np.ndarray) -> Drawing:
    """Six channels about the centre of mass with their residuals, forces on the left and moments on the right.

    Parameters
    ----------
    curves
        Each of shape (n, 6), by its name in `LEGEND`.
    single
        Shape (n,): whether one foot alone is on the ground.
    """
    shown = time <= time[0] + SHOWN_S
    time = time[shown]
    columns, words = {"time_s": time}, []
    drawing, axes = panels([*OVER_RESIDUAL] * 3, columns=2)
    for channel, name in enumerate(CHANNELS):
        pair, unit = axes[2 * (channel % 3) :, channel // 3][:2], "N" if channel < 3 else "N m"
        own = {of: values[shown, channel] for of, values in curves.items()}
        columns |= {f"{name.replace(' ', '_')}_{of}": values for of, values in own.items()}
        for rows in stretches(single[shown]):
            pair[0].axvspan(time[rows.start], time[rows.stop - 1], color=COLOURS["band"])
        over_residual(pair, time, own, LEGEND, (name.replace(" about", "\nabout"), unit))
        words.append(f"{name} from {own['measured'].min():.3g} to {own['measured'].max():.3g} {unit}")
    for panel in axes[-1]:
        panel.set_xlabel("time (s)")
    add_legend(drawing, {of: LEGEND[of] for of in curves})
    return Drawing.of(svg(drawing, f"Ground reaction of trial {trial}: {', '.join(words)}."), columns)


PARTS = Parts(_counts, _sections, ("not testable",), {PLAYBACK_FILE: playback_html}, "Residual = measured - required. ")
