"""A study of walking made ready: the body that is believed, its motion, and the plates on the motion's clock."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from fes_pin.body.build import Body
from fes_pin.data.errors import InputError, errors_of
from fes_pin.data.smooth import CUTOFF_HZ
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.walk.motion import Session, has_rates, motion_of, pelvis_to_hip
from fes_pin.walk.plausible import carried_along, check_together
from fes_pin.walk.walk_trial import WalkTrial, plates_of

MASS_SHARE = 0.01
"""Share by which the mass that a study states may differ from that of its segments."""
FEWEST = 10
"""Samples of motion and reaction together, at least."""


def body_of(study: Study) -> tuple[Body, np.ndarray]:
    """The body that a study believes in, and its right hip centre in OpenSim's pelvis, (3,) m.

    Raises
    ------
    InputError
        The study is of another rig, its table of segments or URDF cannot be used, or a table's masses do not
        sum to the study's.
    """
    if study.rig != "body":
        raise InputError(f"expected a study of rig body, found {study.rig}", file=study.folder)
    height = study.constants.get("height_m")
    if "urdf" in study.files:
        body = Body.from_urdf(study.files["urdf"])
        if body.height_m is None and height is not None:
            body = replace(body, height_m=height)
        return body, pelvis_to_hip(body)
    if "segments" in study.files:
        path = study.files["segments"]
        body = Body.from_segments(path)
        with errors_of(path):
            mass = study.constants.get("mass_kg", body.mass_kg)
            if abs(mass - body.mass_kg) > MASS_SHARE * body.mass_kg:
                raise InputError(f"its segments weigh {body.mass_kg:.2f} kg, and the study says mass_kg = {mass:g}")
            return body, pelvis_to_hip(body, json.loads(path.read_text()))
    body = Body.from_subject(study.constants["mass_kg"], study.constants["height_m"])
    return body, pelvis_to_hip(body)


def recordings_of(study: Study, *, cutoff_hz: float = CUTOFF_HZ, body: Body | None = None) -> list[WalkTrial]:
    """Every trial of a walking study, each file at its own sample rate; by the body that is given, else the study's.

    Raises
    ------
    InputError
        As `body_of`, and for a trial too short to filter.
    """
    believed, hip = body_of(study)
    return [_recording(trial, body or believed, hip, cutoff_hz) for trial in study.trials]


def _recording(trial: Trial, body: Body, hip: np.ndarray, cutoff_hz: float) -> WalkTrial:
    paths = list(map(Path, trial.as_read.sha256)) if trial.as_read is not None else []
    source, reaction = paths[0] if paths else None, paths[-1] if paths else None
    if trial.as_read is not None and trial.as_read.recordings and not trial.is_edited:
        (time, columns), (raw_time, raw) = trial.as_read.recordings
    else:
        time, raw_time = trial.time, trial.time
        columns = {n: v for n, v in trial.columns.items() if n.startswith(("q_", "qd_", "qdd_"))}
        raw = {n: v for n, v in trial.columns.items() if n not in columns}
    edge = 0.0 if has_rates(columns) else 0.5 / cutoff_hz
    inside = (time >= max(raw_time[0], time[0] + edge)) & (time <= min(raw_time[-1], time[-1] - edge))
    if inside.sum() < FEWEST:
        raise InputError(f"trial {trial.name} has {inside.sum()} samples of motion and reaction together", file=source)
    session = Session(cutoff_hz, trial.conditions.get("belt_speed_mps", 0.0), float(time[0]))
    moved = partial(motion_of, body, hip=hip, session=session)
    read = partial(plates_of, raw_time, dict(raw), session=session)
    with errors_of(source):
        motion = moved(time, columns).part(inside)
        plates = read(motion.time)
    with errors_of(reaction):
        check_together(motion, plates)
        rows = carried_along(motion, plates)
    used = motion.part(rows), plates.part(rows)
    return WalkTrial(trial.name, *used, time, dict(columns), moved, read, session)
