"""Every cause's columns against walks that hide it: forces by Newton and Euler in numpy, not by the engine."""

import numpy as np
import pytest

from fes_pin.data.study import read_study
from fes_pin.walk.effects import EFFECTS, walk_library
from fes_pin.walk.recording import recordings_of

pytestmark = pytest.mark.shared
HIDDEN = [  # cause, site as it is hidden, size, more of it, form that must take it away, size of its parameter
    ("segment_mass", "trunk", 0.15, {}, "trunk", 0.15),
    ("segment_mass", "left_thigh,right_thigh", -0.2, {}, "both thighs", -0.2),
    ("segment_com", "trunk", 0.04, {"axis": (1, 0, 0)}, "trunk, forward", 0.04),
    ("segment_com", "trunk", 0.04, {"axis": (0, 0, 1)}, "trunk, up", 0.04),
    ("segment_inertia", "trunk", 0.5, {}, "trunk", 0.5),
    ("external_force", "trunk", 40.0, {"axis": (0, 0, 1), "at": (0, 0, 0.3)}, "trunk, up", 40.0),
    ("external_force", "trunk", 40.0, {"axis": (1, 0, 0), "at": (0, 0, 0.3)}, "trunk, forward", 40.0),
    ("plate_gain", "right", 0.08, {}, "right plate", 0.08),
    ("plate_offset", "left", 25.0, {"axis": (0, 0, 1)}, "left plate, up force, while loaded", 25.0),
    ("clock_offset", "", 0.01, {}, "both plates", 0.01),
    ("base_tilt", "", 0.04, {"axis": (1, 0, 0)}, "forward", 0.04),
    ("base_tilt", "", -0.04, {"axis": (0, 1, 0)}, "left", -0.04),
]


def trial(gait, folder, wrong, seed=3):
    from walks.synthetic import make

    make(gait, folder, wrong, seed)
    (recording,) = recordings_of(read_study(folder))
    return recording


def size(residual):
    """Root mean square, moments counted as forces at 0.18 m."""
    return np.sqrt(np.mean(np.square(residual * [1, 1, 1, *[1 / 0.18] * 3])))


@pytest.fixture(scope="module")
def clean(gait, tmp_path_factory):
    from walks.synthetic import Wrong

    return trial(gait, tmp_path_factory.mktemp("clean"), Wrong(tissue=0.0, markers_m=0.0, placed=0.0, strides=2))


def test_where_nothing_is_wrong_the_two_codes_agree(clean):
    """What is left is the plates' noise of 1 N and what differentiation costs."""
    inside = slice(10, -10)
    assert (np.sqrt(np.mean(clean.residual[inside] ** 2, axis=0)) < [2.5, 2.5, 3.5, 1.5, 1.5, 1.0]).all()


@pytest.mark.parametrize(("cause", "site", "amount", "extra", "form", "value"), HIDDEN)
def test_the_columns_of_a_cause_take_it_away(gait, clean, tmp_path, cause, site, amount, extra, form, value):
    from walks.synthetic import Wrong

    wrong = Wrong(cause, site, amount, tissue=0.0, markers_m=0.0, placed=0.0, strides=2, extra=extra)
    hidden = trial(gait, tmp_path, wrong)
    (one,) = (f for f in walk_library() if f.cause == cause and f.site == form)
    inside = slice(10, -10)
    made = (one.columns(hidden) @ np.array([value]))[inside]
    before, after = size(hidden.residual[inside]), size(hidden.residual[inside] - made)
    floor = size(clean.residual[inside])
    assert before > 1.5 * floor
    assert after < floor + 0.15 * before


def test_a_force_at_the_pelvis_acts_midway_between_the_hips(clean):
    from fes_pin.walk.effects.external_force import place_of

    origin, thigh = clean.motion.poses["pelvis"][1], clean.motion.poses["left_thigh"][1]  # both hips, on a right foot
    apart = clean.motion.body.height_m * 0.095
    assert np.allclose(np.linalg.norm(origin - thigh, axis=1), apart, rtol=1e-3)
    point = place_of(clean, "pelvis")
    for hip in (origin, thigh):
        assert np.allclose(np.linalg.norm(point - hip, axis=1), 0.5 * apart, rtol=1e-3)


def test_the_catalogue_is_the_contracts(shared):
    import tomllib

    contract = tomllib.loads((shared / "contract/effects.toml").read_text())
    asked = {name for name, entry in contract.items() if "body" in entry["rigs"]} | {"base_tilt", "condition_misread"}
    assert {e.name for e in EFFECTS} == asked


def test_forms_are_told_apart_by_cause_and_site():
    labels = [(f.cause, f.site) for f in walk_library()]
    assert len(set(labels)) == len(labels)
    assert all(len(f.parameters) == len(f.units) > 0 for f in walk_library())
