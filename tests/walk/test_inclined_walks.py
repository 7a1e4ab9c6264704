"""A laboratory whose axes slope is told from a push, from one who speeds up, and from a ground that slopes a little."""

import numpy as np
import pytest

import fes_pin as fp

pytestmark = pytest.mark.shared
X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


@pytest.fixture
def made(gait, tmp_path, request):
    """The folder of a walk of some strides."""
    from walking_matrix.conventions import walk

    walk(gait, tmp_path / "walk", request.param, request.param % 2 == 1)
    return tmp_path / "walk"


def remarks(folder):
    return fp.read_study(folder).trials[0].remarks


@pytest.mark.parametrize("made", range(3), indirect=True)
@pytest.mark.parametrize(("axis", "degrees"), [(Z, -18.0), (Z, 25.0), (X, 20.0)])
def test_axes_that_slope_are_said_and_the_walk_is_as_it_was(made, axis, degrees):
    from walking_matrix.conventions import turned

    usual = fp.read_study(made).trials[0]
    turned(np.radians(degrees), axis=axis)(made)
    found = fp.read_study(made).trials[0]
    assert len(found.remarks) == 1 and "the axes are taken as inclined by" in found.remarks[0]
    size = np.sqrt(np.mean(usual["r_Fy"] ** 2))
    for name in ("r_Fy", "l_Fy"):
        assert np.allclose(found[name], usual[name], atol=0.01 * size)
    for name in ("q_pelvis_tilt", "q_pelvis_list", "q_pelvis_rotation"):
        assert np.allclose(found[name], usual[name], atol=0.02)  # a walk of part of a stride pushes a little
    path = made / "study.toml"
    text = path.read_text()
    path.write_text(text + '\n[conventions]\naxes = "level"\n')
    kept = fp.read_study(made).trials[0]
    assert not kept.remarks and abs(np.mean(kept["r_Fy"] - found["r_Fy"])) > 1.0


@pytest.mark.parametrize("made", range(2), indirect=True)
def test_axes_that_are_stated_as_inclined_are_turned_by_any_angle(made):
    from walking_matrix.conventions import turned

    usual = fp.read_study(made).trials[0]
    turned(np.radians(-4.0), axis=Z)(made)
    assert remarks(made) == ()
    path = made / "study.toml"
    path.write_text(path.read_text() + '\n[conventions]\naxes = "inclined"\n')
    found = fp.read_study(made).trials[0]
    assert np.allclose(found["q_pelvis_tilt"], usual["q_pelvis_tilt"], atol=0.02)


@pytest.mark.parametrize("made", [0, 2], indirect=True)
def test_of_a_light_body_a_slope_may_be_a_push_and_both_are_said(made):
    from walking_matrix.conventions import turned

    turned(np.radians(-12.0), axis=Z)(made)
    (said,) = remarks(made)
    assert "the axes lean by 1" in said and "or something pushes" in said and "[conventions] axes says which" in said


def pushed(folder, newtons):
    """A constant horizontal force on the body, which the plates take up."""
    from walking_matrix.conventions import put, read

    pushes = read(folder / "grf.csv")
    up = pushes["r_Fy"] + pushes["l_Fy"]
    for side in "rl":
        pushes[f"{side}_Fx"] = pushes[f"{side}_Fx"] + newtons * pushes[f"{side}_Fy"] / np.maximum(up, 1.0)
    put(folder / "grf.csv", pushes)


@pytest.mark.parametrize("made", range(3), indirect=True)
@pytest.mark.parametrize("newtons", [60.0, -100.0, 140.0])
def test_a_push_is_no_slope(made, newtons):
    pushed(made, newtons)
    said = remarks(made)
    assert not said or (len(said) == 1 and "or something pushes" in said[0] and abs(newtons) >= 100.0)


@pytest.mark.parametrize("made", range(3), indirect=True)
@pytest.mark.parametrize("rate", [2.5, -3.0])
def test_one_who_speeds_up_is_on_no_slope(made, rate):
    """m/s2; the force that it takes is far above what inclines the axes, and the motion requires it."""
    from walking_matrix.conventions import put, read

    moves, mass = read(made / "coords.csv"), fp.read_study(made).constants["mass_kg"]
    time = moves["time_s"]
    way = 0.5 * rate * (time - time[0]) ** 2
    put(made / "coords.csv", moves | {"q_pelvis_tx": moves["q_pelvis_tx"] + way})
    pushed(made, mass * rate)
    pushes = read(made / "grf.csv")
    way = 0.5 * rate * (pushes["time_s"] - time[0]) ** 2
    put(made / "grf.csv", pushes | {f"{s}_copx": pushes[f"{s}_copx"] + way for s in "rl"})
    assert not [words for words in remarks(made) if "inclined" in words]


def test_turns_there_and_back_are_none():
    """The angles of the pelvis are those of turns about z, x and y, one after the other."""
    from fes_pin.data.legs import pelvis_of
    from fes_pin.data.walk_level import _turn
    from fes_pin.data.walk_recorded import RecordedWalk

    rng = np.random.default_rng(3)
    names = ("tilt", "list", "rotation")
    for _ in range(20):
        moves = {f"q_pelvis_{n}": rng.uniform(-1.0, 1.0, 5) for n in names}
        moves["q_pelvis_rotation"] += rng.integers(-2, 3) * 2.0 * np.pi
        moves |= {f"q_pelvis_t{c}": rng.normal(size=5) for c in "xyz"}
        up = np.array([rng.uniform(-0.4, 0.4), 1.0, rng.uniform(-0.4, 0.4)])
        plate = {f"{kind}{c}": rng.normal(size=5) for kind in ("F", "cop", "T") for c in "xyz"}
        walk = RecordedWalk(np.arange(5.0), dict(moves), np.arange(5.0), {"r": dict(plate)}, {})
        _turn(walk, up / np.linalg.norm(up))
        about = pelvis_of(walk.moves) @ pelvis_of(moves).transpose(0, 2, 1)
        assert np.allclose(about, about[0]) and np.allclose(about[0] @ (up / np.linalg.norm(up)), [0.0, 1.0, 0.0])
        assert np.all(np.abs(walk.moves["q_pelvis_rotation"] - moves["q_pelvis_rotation"]) < np.pi)
