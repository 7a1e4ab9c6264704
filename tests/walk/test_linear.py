"""Linear against full equations: the neglected terms are the whole difference, and vanish where they must."""

from dataclasses import replace

import numpy as np
import pytest

from fes_pin.walk.linear import along
from fes_pin.walk.motion import rooted_motion

pytestmark = pytest.mark.shared


@pytest.fixture(scope="module")
def rooted(measured, with_plates, hip):
    motion, plates = with_plates
    _, columns = measured
    inside = np.isin(measured[0].time, motion.time)
    own = {n: c[inside] for n, c in columns.items()}
    rows = next(rows for side, rows in plates.single_supports() if side == "right")
    return rooted_motion(motion, own, hip, rows)


def test_the_neglected_terms_are_the_whole_difference(rooted):
    found = along(rooted, 1)
    assert np.abs(found.full - found.linear - found.neglected.sum(axis=0)).max() < 1e-8


def test_more_postures_help_and_a_moving_one_more(rooted):
    errors = [np.linalg.norm(along(rooted, k).full - along(rooted, k).linear) for k in (1, 4)]
    moving = along(rooted, 4, moving=True)
    assert errors[1] < errors[0]
    assert np.linalg.norm(moving.full - moving.linear) < 0.5 * errors[1]


def test_at_rest_in_its_posture_nothing_is_neglected(rooted):
    one = rooted.part(slice(5, 6))
    still = replace(one, v=0.0 * one.v, a=0.0 * one.a)
    found = along(still, 1)
    assert np.abs(found.full - found.linear).max() < 1e-9
