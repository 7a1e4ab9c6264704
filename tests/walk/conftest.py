"""The measured walk as the walking model reads it."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from fes_pin.body.build import Body, pelvis_to_hip
from fes_pin.data.motion import read_coordinates, read_ground_reaction
from fes_pin.walk.motion import Session, motion_of
from fes_pin.walk.walk_trial import plates_of

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))


@pytest.fixture(scope="session")
def segments(walk):
    return walk / "reference/subject01_model.json"


@pytest.fixture(scope="session")
def hip(segments):
    body = Body.from_segments(segments)
    return pelvis_to_hip(body, json.loads(segments.read_text()))


@pytest.fixture(scope="session")
def measured(walk, segments, hip):
    """Motion and coordinates of the walk, all samples."""
    time, columns = read_coordinates(walk / "coords_mtpfree.csv")
    return motion_of(Body.from_segments(segments), time, columns, hip, Session()), columns


@pytest.fixture(scope="session")
def with_plates(walk, measured):
    """The motion while the plates were recorded, and the plates."""
    motion, _ = measured
    time, columns = read_ground_reaction(walk / "grf_raw_600hz.csv")
    part = motion.part((motion.time >= time[0]) & (motion.time <= time[-1]))
    return part, plates_of(time, columns, part.time, Session())


def rms(values):
    return np.sqrt(np.mean(np.square(values), axis=0))


@pytest.fixture(scope="session")
def gait(walk):
    from walks.synthetic import gait_of

    return gait_of(walk)
