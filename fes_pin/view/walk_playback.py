"""A measured walk to look at: the body moves as measured, with the ground reactions that were read and are required."""

import numpy as np
import pinocchio as pin

from fes_pin.view.arrows import Arrow
from fes_pin.view.viewer import FRAMES_A_SECOND, BodyScene
from fes_pin.walk.motion import Motion
from fes_pin.walk.result import WalkDiagnosis
from fes_pin.walk.walk_trial import LOADED_N, Plates

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
