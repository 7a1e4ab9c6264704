"""The nerve table: signs, mirror, virtual work, agreement with the measured moment arms."""

import csv
import json
import os
from pathlib import Path

import numpy as np
import pytest

from fes_pin.body.joints import JOINT_NAMES, MIRROR_SIGN
from fes_pin.data.errors import InputError
from fes_pin.muscles.muscles import standard_muscles
from fes_pin.muscles.nerves import Nerves

SHARED = Path(os.environ.get("FES_PIN_DATA", Path(__file__).parents[2].parent / "shared"))
MEASURED = (SHARED if (SHARED / "nerve_moment_arms").is_dir() else SHARED / "data") / "nerve_moment_arms"
SIGNS = {
    "femoral": {"knee_flexion": -1, "hip_flexion": 1},
    "tibial": {"ankle_dorsiflexion": -1, "knee_flexion": 1, "mtp_extension": -1},
    "deep_peroneal": {"ankle_dorsiflexion": 1, "mtp_extension": 1},
    "superficial_peroneal": {"ankle_inversion": -1, "ankle_dorsiflexion": -1},
    "hamstrings": {"hip_flexion": -1, "knee_flexion": 1},
    "superior_gluteal": {"hip_adduction": -1},
    "inferior_gluteal": {"hip_flexion": -1},
    "obturator": {"hip_adduction": 1},
    "iliopsoas": {"hip_flexion": 1},
    "sacral_rotators": {"hip_rotation": -1},
}


def random_angles(count, seed=0):
    table = standard_muscles()
    return np.random.default_rng(seed).uniform(table.lower, table.upper, (count, len(JOINT_NAMES)))


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("nerve", SIGNS)
def test_every_nerve_turns_its_joints_the_anatomical_way(nerve, side):
    nerves = Nerves([f"{side}_{nerve}"])
    torque = dict(zip(JOINT_NAMES, nerves.torque_matrix()[:, 0], strict=True))
    for joint, sign in SIGNS[nerve].items():
        assert sign * torque[f"{side}_{joint}"] > 1.0
    other = "right" if side == "left" else "left"
    assert all(value == 0.0 for joint, value in torque.items() if joint.startswith(other))


def test_left_is_the_mirror_of_right():
    q = random_angles(20)
    mirrored = np.concatenate([q[:, 8:16], q[:, :8], q[:, 16:]], axis=1)
    left = Nerves([n for n in Nerves().names if n.startswith("left_")]).torque_matrix(q)
    right = Nerves([n for n in Nerves().names if n.startswith("right_")]).torque_matrix(mirrored)
    np.testing.assert_allclose(left[:, :8], right[:, 8:16], atol=1e-12)
    signs = [MIRROR_SIGN.get(joint, 1.0) for joint in JOINT_NAMES[16:]]
    np.testing.assert_allclose(left[:, 16:], np.array(signs)[:, None] * right[:, 16:], atol=1e-12)


def test_right_erector_bends_right_and_right_external_oblique_turns_left():
    torque = Nerves(["right_ercspn", "right_extobl"]).torque_matrix()
    assert torque[JOINT_NAMES.index("lumbar_extension"), 0] > 0 and torque[JOINT_NAMES.index("lumbar_bending"), 0] > 0
    assert torque[JOINT_NAMES.index("lumbar_rotation"), 1] > 0 and torque[JOINT_NAMES.index("lumbar_extension"), 1] < 0


def test_smooth_moment_arms_are_the_gradient_of_one_length():
    table, h = standard_muscles(), 1e-5
    for q in random_angles(5) * 0.8:
        gradient = [(table.lengths(q + h * e) - table.lengths(q - h * e)) / (2 * h) for e in np.eye(19)]
        smooth = table.constant + np.einsum("mij,j->mi", table.slope, q)
        np.testing.assert_allclose(-np.array(gradient), smooth.T, atol=1e-8)
    assert np.abs(table.rest).max() < 3e-3  # what the length leaves over of the measured arms, m


def test_a_posture_beyond_the_measured_range_is_held_at_its_edge():
    table = standard_muscles()
    np.testing.assert_array_equal(table.moment_arms(table.upper + 1.0), table.moment_arms(table.upper))


def test_batch_equals_single_and_mapping_equals_array():
    nerves, q = Nerves(), random_angles(7)
    batch = nerves.torque_matrix(q)
    for k in range(7):
        np.testing.assert_allclose(
            batch[k], nerves.torque_matrix(dict(zip(JOINT_NAMES, q[k], strict=True))), atol=1e-12
        )


def test_force_velocity_is_one_at_rest_less_when_shortening_more_when_lengthening():
    nerves = Nerves(["right_vas_lat"])
    j = JOINT_NAMES.index("right_knee_flexion")
    still, extend, flex = (nerves.torque_matrix(None, {"right_knee_flexion": v})[j, 0] for v in (0.0, -3.0, 3.0))
    assert still == pytest.approx(nerves.torque_matrix()[j, 0])
    assert abs(extend) < abs(still) < abs(flex) <= 1.4 * abs(still)
    assert nerves.torque_matrix(None, {"right_knee_flexion": -100.0})[j, 0] == 0.0


def test_force_length_never_exceeds_the_upper_bound():
    q = random_angles(50)
    with_length = np.abs(Nerves.muscles(force_length=True).torque_matrix(q))
    assert (with_length <= np.abs(Nerves.muscles().torque_matrix(q)) + 1e-12).all()
    assert with_length.sum() < 0.98 * np.abs(Nerves.muscles().torque_matrix(q)).sum()


def test_fatigue_strength_and_size_scale_the_columns():
    names = ["left_femoral", "left_tibial"]
    fresh = Nerves(names).torque_matrix()
    np.testing.assert_allclose(Nerves(names).tired(left_tibial=0.4).torque_matrix(), fresh * [1.0, 0.4])
    np.testing.assert_allclose(Nerves.of_subject(72.6 * 2, 0.9, names).torque_matrix(), fresh)
    low, high = Nerves(names).torque_band()
    assert (np.abs(low) <= np.abs(fresh)).all() and (np.abs(fresh) <= np.abs(high)).all()


def test_a_list_of_nerves_says_how_rough_the_trunk_is():
    assert "round figures" in str(Nerves(["left_erector_spinae"]))
    assert "round figures" not in str(Nerves(["left_femoral"]))


def test_a_nerve_is_the_sum_of_its_muscles():
    q = random_angles(1)[0]
    muscles = Nerves.muscles("right_tibial")
    assert len(muscles.names) == 6
    np.testing.assert_allclose(muscles.torque_matrix(q).sum(1), Nerves(["right_tibial"]).torque_matrix(q)[:, 0])


@pytest.mark.parametrize(
    "make",
    [
        lambda: Nerves(["left_sciatica"]),
        lambda: Nerves(["left_tibial", "left_tibial"]),
        lambda: Nerves(strength=-1.0),
        lambda: Nerves(strength=float("nan")),
        lambda: Nerves(length=0.0),
        lambda: Nerves(["left_tibial"], fatigue={"left_tibial": 1.5}),
        lambda: Nerves(["left_tibial"], fatigue={"left_femoral": 0.5}),
        lambda: Nerves().torque_matrix({"left_kneee": 0.1}),
        lambda: Nerves().torque_matrix(np.zeros(18)),
        lambda: Nerves().torque_matrix(np.full(19, np.nan)),
        lambda: Nerves().torque_matrix({"left_knee_flexion": "bent"}),
        lambda: Nerves.of_subject(-70.0, 1.8),
    ],
)
def test_bad_input_is_one_clear_line(make):
    with pytest.raises(InputError) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.shared
def test_measured_postures_are_met_to_the_rounding_of_the_table():
    if not MEASURED.is_dir():
        pytest.skip("the measured moment arms are not here")
    postures = next(iter(json.loads((MEASURED / "postures.json").read_text()).values()))
    rename = {"knee_flexion": ("knee_angle", -1), "ankle_dorsiflexion": ("ankle_angle", 1)}
    rename |= {"ankle_inversion": ("subtalar_angle", 1), "mtp_extension": ("mtp_angle", 1)}
    with (MEASURED / "gait2392_subject01_moment_arms.csv").open() as file:
        rows = [r for r in csv.DictReader(file) if r["nerve_group"] != "trunk"]
    for label, angles in postures.items():
        q, keys = {}, {}
        for joint in JOINT_NAMES[8:16]:
            name, sign = rename.get(joint.removeprefix("right_"), (joint.removeprefix("right_"), 1))
            q[joint], keys[joint] = sign * angles.get(f"{name}_r", 0.0), (f"r_{name}_r_m", sign)
        arms = standard_muscles().moment_arms(q)
        for row in (r for r in rows if r["posture"] == label):
            column = arms[:, standard_muscles().names.index(f"right_{row['muscle'].removesuffix('_r')}")]
            for joint, (key, sign) in keys.items():
                assert column[JOINT_NAMES.index(joint)] == pytest.approx(sign * float(row.get(key, 0.0)), abs=1.2e-4)
