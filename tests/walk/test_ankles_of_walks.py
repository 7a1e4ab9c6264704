"""The sign of an ankle follows from its foot, which would turn with the other sign while it lies flat."""

import numpy as np
import pytest

import fes_pin as fp

pytestmark = pytest.mark.shared
BOTH = "both ankles count dorsiflexion negative: taken with the other sign"


@pytest.fixture
def made(gait, tmp_path, request):
    """The folder of a walk of some strides; odd ones limp."""
    from walking_matrix.conventions import walk

    walk(gait, tmp_path / "walk", request.param, request.param % 2 == 1)
    return tmp_path / "walk"


def change(folder, joint, sides, factor=-1.0):
    from walking_matrix.conventions import scaled

    scaled("coords.csv", lambda name: name in [f"q_{joint}_angle_{side}" for side in sides], factor)(folder)


def state(folder, **keys):
    path = folder / "study.toml"
    lines = "".join(f'{key} = "{word}"\n' for key, word in keys.items())
    path.write_text(f"{path.read_text()}\n[conventions]\n{lines}")


@pytest.mark.parametrize("made", range(4), indirect=True)
@pytest.mark.parametrize("knees", ["rl", "r"])
def test_ankles_are_told_whatever_the_knees_count(made, knees):
    usual = fp.read_study(made).trials[0]
    change(made, "knee", knees)
    change(made, "ankle", "rl")
    found = fp.read_study(made).trials[0]
    assert BOTH in found.remarks and len(found.remarks) == 2
    for name in ("q_ankle_angle_r", "q_ankle_angle_l", "q_knee_angle_r"):
        np.testing.assert_allclose(found[name], usual[name], atol=1e-9)


@pytest.mark.parametrize("made", range(3), indirect=True)
def test_what_is_stated_of_an_ankle_is_kept_and_not_tested(made):
    usual = fp.read_study(made).trials[0]
    change(made, "ankle", "rl")
    state(made, dorsiflexion_right="negative", dorsiflexion_left="positive")
    kept = fp.read_study(made).trials[0]
    assert kept.remarks == ()
    np.testing.assert_allclose(kept["q_ankle_angle_r"], usual["q_ankle_angle_r"])
    np.testing.assert_allclose(kept["q_ankle_angle_l"], -usual["q_ankle_angle_l"])


@pytest.mark.parametrize("made", range(3), indirect=True)
@pytest.mark.parametrize("factor", [0.0, -0.05, 0.3])
def test_of_an_ankle_that_hardly_moves_nothing_is_said(made, factor):
    change(made, "ankle", "l", factor)
    assert fp.read_study(made).trials[0].remarks == ()


@pytest.mark.parametrize("made", [0], indirect=True)
def test_the_flexion_of_an_ankle_is_taken_by_the_sign_that_the_walk_shows(made):
    path = made / "coords.csv"
    usual = fp.read_study(made).trials[0]
    change(made, "ankle", "rl")
    path.write_text(path.read_text().replace("q_ankle_angle_", "q_ankle_flex_"))
    found = fp.read_study(made).trials[0]
    assert BOTH in found.remarks and any("ankle_flex_r as ankle_angle_r" in words for words in found.remarks)
    np.testing.assert_allclose(found["q_ankle_angle_l"], usual["q_ankle_angle_l"], atol=1e-9)


@pytest.mark.parametrize("made", [0, 1, 9], indirect=True)
@pytest.mark.parametrize("degrees", [90.0, -40.0, 200.0])
def test_which_way_the_body_walks_does_not_matter(made, degrees):
    from walking_matrix.conventions import turned

    turned(np.radians(degrees))(made)
    assert fp.read_study(made).trials[0].remarks == ()
    change(made, "ankle", "l")
    said = "the left ankle counts dorsiflexion negative: taken with the other sign"
    assert fp.read_study(made).trials[0].remarks == (said,)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("way", ["usual", "limping", "pointed feet", "stiff ankles"])
def test_slow_and_fast_walks_are_taken_as_they_are(gait, tmp_path, way, seed):
    from walking_matrix.conventions import GAITS, paced
    from walks.synthetic import Wrong, make

    made = tmp_path / "walk"
    make(GAITS[way](paced(gait, seed), seed), made, Wrong(strides=2, tissue=0.5), seed)
    assert not [words for words in fp.read_study(made).trials[0].remarks if "ankle" in words]
    change(made, "ankle", "rl")
    if way in ("usual", "limping"):
        assert BOTH in fp.read_study(made).trials[0].remarks
