"""The nerve table: signs, mirror, virtual work, agreement with the measured moment arms."""

import copy
import csv
import json
import os
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from fes_pin.allocation.allocate import allocate
from fes_pin.body.joints import JOINT_NAMES, MIRROR_SIGN, joint_limits
from fes_pin.data.errors import InputError
from fes_pin.muscles.fibres import active_force, tendon_force
from fes_pin.muscles.muscles import KNOWN_DEG, standard_muscles
from fes_pin.muscles.nerves import HEALTHY, PARALYSED, PARALYSED_BAND, Nerves
from fes_pin.muscles.paths import ANKLE, COORDINATES, HEEL_BONE, HINGES, MTP, Hinge, leg_paths

SHARED = Path(os.environ.get("FES_PIN_DATA", Path(__file__).parents[2].parent / "shared"))
MEASURED = (SHARED if (SHARED / "nerve_moment_arms").is_dir() else SHARED / "data") / "nerve_moment_arms"
SIGNS = {
    "femoral": {"knee_flexion": -1, "hip_flexion": 1},
    "tibial": {"ankle_dorsiflexion": -1, "ankle_inversion": 1, "knee_flexion": 1, "mtp_extension": -1},
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
    low, high = (np.clip(edge, -0.5, 2.0) for edge in (table.lower, table.upper))
    return np.random.default_rng(seed).uniform(low, high, (count, len(JOINT_NAMES)))


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("nerve", SIGNS)
def test_every_nerve_turns_its_joints_the_anatomical_way(nerve, side):
    nerves = Nerves([f"{side}_{nerve}"], strength=HEALTHY)
    torque = dict(zip(JOINT_NAMES, nerves.torque_matrix()[:, 0], strict=True))
    for joint, sign in SIGNS[nerve].items():
        assert sign * torque[f"{side}_{joint}"] > 0.9
    other = "right" if side == "left" else "left"
    assert all(value == 0.0 for joint, value in torque.items() if joint.startswith(other))


def test_left_is_the_mirror_of_right():
    q = random_angles(20)
    signs = np.array([MIRROR_SIGN.get(joint, 1.0) for joint in JOINT_NAMES[16:]])
    mirrored = np.concatenate([q[:, 8:16], q[:, :8], signs * q[:, 16:]], axis=1)
    left = Nerves([n for n in Nerves().names if n.startswith("left_")]).torque_matrix(q)
    right = Nerves([n for n in Nerves().names if n.startswith("right_")]).torque_matrix(mirrored)
    np.testing.assert_allclose(left[:, :8], right[:, 8:16], atol=1e-12)
    np.testing.assert_allclose(left[:, 16:], signs[:, None] * right[:, 16:], atol=1e-12)


def test_right_erector_bends_right_and_right_external_oblique_turns_left():
    torque = Nerves(["right_ercspn", "right_extobl"]).torque_matrix()
    assert torque[JOINT_NAMES.index("lumbar_extension"), 0] > 0 and torque[JOINT_NAMES.index("lumbar_bending"), 0] > 0
    assert torque[JOINT_NAMES.index("lumbar_rotation"), 1] > 0 and torque[JOINT_NAMES.index("lumbar_extension"), 1] < 0


def test_moment_arms_are_the_gradient_of_the_length():
    table, h = standard_muscles(), 1e-6
    q = random_angles(20)[:, None] * 0.98
    gradient = (table.lengths(q + h * np.eye(19)) - table.lengths(q - h * np.eye(19))) / (2 * h)
    np.testing.assert_allclose(-gradient, table.moment_arms(q[:, 0]), atol=1e-8)


def test_a_nerve_has_no_torque_about_a_joint_that_it_does_not_cross():
    torque = Nerves(["left_tibial", "left_femoral"]).torque_matrix(random_angles(5))
    turned = {JOINT_NAMES[j] for j in range(19) if torque[:, j, 0].any()}
    ankle = ("ankle_dorsiflexion", "ankle_inversion", "ankle_rotation")
    assert turned == {f"left_{j}" for j in ("knee_flexion", *ankle, "mtp_extension")}
    reasons = allocate({"left_hip_adduction": 20.0}, Nerves(["left_tibial"])).reasons
    assert reasons == ["left hip adduction 20.0 N m short: no stimulated nerve turns it"]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("joint", KNOWN_DEG)
def test_no_torque_jumps_anywhere(joint, seed):
    """Where a muscle comes upon bone or leaves it, lengths and moment arms are continuous: halving the step where each
    muscle's changes most makes the change vanish (seed 0: the other joints at 0)."""
    table = standard_muscles()
    posture = random_angles(1, seed)[0] if seed else np.zeros(len(JOINT_NAMES))
    j, muscles = JOINT_NAMES.index(f"right_{joint}"), np.arange(len(table.names) // 2, len(table.names))

    def at(angles):
        q = np.tile(posture, (len(angles), 1))
        q[:, j] = angles
        return np.concatenate([table.lengths(q)[:, None], table.moment_arms(q)], axis=1)[..., muscles]

    grid = np.radians(np.linspace(*KNOWN_DEG[joint], 121))
    values = at(grid)
    widest = np.abs(np.diff(values, axis=0)).max(axis=1).argmax(axis=0)
    own = np.arange(len(muscles))
    low, high, left, right = grid[widest], grid[widest + 1], values[widest, :, own], values[widest + 1, :, own]
    for _ in range(14):
        middle = 0.5 * (low + high)
        value = at(middle)[own, :, own]
        first = np.abs(value - left).max(axis=1) > np.abs(right - value).max(axis=1)
        low, left = np.where(first, low, middle), np.where(first[:, None], left, value)
        high, right = np.where(first, middle, high), np.where(first[:, None], value, right)
    assert np.abs(right - left).max() < 1e-5


@pytest.mark.parametrize(
    ("joint", "angle", "nerve", "turned"),
    [("hip_flexion", 45.0, "iliopsoas", "hip_adduction"), ("knee_flexion", 69.33, "femoral", "knee_flexion")],
)
def test_a_hundredth_of_a_degree_changes_no_torque_by_more_than_a_hundredth(joint, angle, nerve, turned):
    low, high = (
        Nerves([f"left_{nerve}"], strength=HEALTHY).torque_matrix({f"left_{joint}": np.radians(angle + step)})
        for step in (-0.01, 0.01)
    )
    j = JOINT_NAMES.index(f"left_{turned}")
    assert abs(high[j, 0] - low[j, 0]) < 0.01 * np.abs(low).max()


@pytest.mark.parametrize(
    ("muscle", "joint", "sign"),
    [
        ("psoas", "hip_flexion", 1),
        ("iliacus", "hip_flexion", 1),
        ("rect_fem", "hip_flexion", 1),
        ("glut_max3", "hip_flexion", -1),
        ("bifemlh", "hip_flexion", -1),
        ("semimem", "hip_flexion", -1),
        ("bifemlh", "knee_flexion", 1),
        ("semimem", "knee_flexion", 1),
        ("med_gas", "knee_flexion", 1),
        ("vas_lat", "knee_flexion", -1),
        ("soleus", "ankle_dorsiflexion", -1),
        ("tib_ant", "ankle_dorsiflexion", 1),
        ("glut_med2", "hip_adduction", -1),
        ("per_long", "ankle_inversion", -1),
    ],
)
def test_a_muscle_pulls_its_anatomical_way_over_all_angles_that_are_known(muscle, joint, sign):
    table, j = standard_muscles(), JOINT_NAMES.index(f"left_{joint}")
    q = np.zeros((60, len(JOINT_NAMES)))
    q[:, j] = np.radians(np.linspace(*KNOWN_DEG[joint], 60))
    arms = sign * table.moment_arms(q)[:, j, table.names.index(f"left_{muscle}")]
    assert arms.min() > 2e-3 and arms.max() < 0.1


def test_known_angles_are_those_of_the_joint_or_less():
    for joint, (low, high) in KNOWN_DEG.items():
        limits = np.degrees(joint_limits(f"left_{joint}"))
        assert limits[0] - 1e-9 <= low < high <= limits[1] + 1e-9


def test_a_posture_a_little_beyond_what_is_known_is_held_and_said_far_beyond_refused():
    nerves = Nerves(["left_iliopsoas", "left_femoral"])
    at = {f: nerves.torque_matrix({"left_hip_flexion": np.radians(f)}) for f in (80.0, 85.0, 94.0)}
    np.testing.assert_array_equal(at[85.0], at[94.0])
    assert not np.array_equal(at[80.0], at[85.0])
    assert nerves.held({"left_hip_flexion": np.radians(85.0)}) == ()
    (said,) = nerves.held({"left_hip_flexion": np.radians(94.0)})
    assert "left hip flexion 94 degrees" in said and "85" in said
    with pytest.raises(InputError, match=r"left_hip_flexion are known from -30 to 85 degrees.*100 is too far"):
        nerves.torque_matrix({"left_hip_flexion": np.radians(100.0)})
    with pytest.raises(InputError, match="right_knee_flexion"):
        nerves.torque_matrix({"right_knee_flexion": np.radians(121.0)})
    assert nerves.torque_matrix({"lumbar_bending": 3.0}).shape == (19, 2)  # constant levers hold anywhere
    a = allocate({"left_knee_flexion": -20.0}, nerves, {"left_hip_flexion": np.radians(94.0)})
    assert a.held == (said,) and said in str(a)


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


def test_no_muscle_pulls_more_than_at_its_optimal_length():
    table, q = standard_muscles(), random_angles(50)
    fraction = table.isometric_fraction(q)
    assert (fraction >= 0.0).all() and (fraction <= 1.0).all()
    at_best = Nerves.muscles(force_length=False).torque_matrix(q)
    assert np.abs(Nerves.muscles().torque_matrix(q)).sum() < 0.9 * np.abs(at_best).sum()


def test_fibres_and_tendon_pull_alike():
    table, q = standard_muscles(), random_angles(20)
    along = table.isometric_fraction(q)
    stretched = np.array([brentq(lambda e, f=f: tendon_force(np.array(e)) - f, 0.0, 0.1) for f in along.ravel()])
    extent = table.lengths(q) - table.tendon * (1.0 + stretched.reshape(along.shape))
    thickness = table.fibre * np.sin(table.pennation)
    size = np.hypot(extent, thickness)
    pulled = active_force(size / table.fibre) * extent / size
    taut = extent > 1e-3
    np.testing.assert_allclose(pulled[taut], along[taut], rtol=1e-6)
    assert taut.mean() > 0.9


def test_fatigue_strength_and_size_scale_the_columns():
    names = ["left_femoral", "left_tibial"]
    fresh = Nerves(names).torque_matrix()
    np.testing.assert_allclose(Nerves(names).tired(left_tibial=0.4).torque_matrix(), fresh * [1.0, 0.4])
    np.testing.assert_allclose(Nerves.of_subject(72.6 * 2, 0.9, names).torque_matrix(), fresh)
    low, high = Nerves(names).torque_band()
    assert (np.abs(low) <= np.abs(fresh)).all() and (np.abs(fresh) <= np.abs(high)).all()


def test_strength_is_that_of_paralysed_muscle_unless_another_is_given():
    names = ["left_femoral"]
    assumed, healthy = Nerves(names), Nerves(names, strength=HEALTHY)
    np.testing.assert_allclose(assumed.torque_matrix(), PARALYSED * healthy.torque_matrix())
    for nerves, ends in ((assumed, PARALYSED_BAND), (healthy, (1 / 1.8, 1.8))):
        for end, torque in zip(ends, nerves.torque_band(), strict=True):
            np.testing.assert_allclose(torque, end * healthy.torque_matrix())
    assert "paralysed muscle; 0.3 to 0.7" in str(assumed) and "as given" in str(healthy)


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
        lambda: Nerves(strength=1e300),
        lambda: Nerves(length=1e9),
        lambda: Nerves(strength="strong"),
        lambda: Nerves(length=None),
        lambda: Nerves(5),
        lambda: Nerves(["left_tibial"], fatigue=0.5),
        lambda: Nerves(["left_tibial"], fatigue={"left_tibial": "x"}),
        lambda: Nerves.of_subject("heavy", 1.8),
        lambda: Nerves.of_subject(70.0, float("nan")),
        lambda: Nerves.of_subject(70.0, 1.8, strength="x"),
        lambda: Nerves().torque_matrix(np.zeros((3, 19)), np.zeros((2, 19))),
        lambda: Nerves().torque_matrix(v="fast"),
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
    """The points are OpenSim's: turned about its axes, they have its lengths and moment arms."""
    if not MEASURED.is_dir():
        pytest.skip("the measured moment arms are not here")
    postures = next(iter(json.loads((MEASURED / "postures.json").read_text()).values()))
    ankle, subtalar = (-0.10501355, -0.17402245, 0.97912632), (0.78717961, 0.60474746, -0.12094949)
    hinges = (
        *HINGES[:4],
        Hinge("ankle_dorsiflexion", ankle, of="tibia", offset=ANKLE),
        Hinge("ankle_inversion", subtalar, of="talus", offset=HEEL_BONE, reaches=True),
        Hinge("mtp_extension", (-0.5809544, 0.0, 0.81393611), of="calcaneus", offset=MTP, reaches=True),
    )
    paths = replace(leg_paths(), hinges=hinges)
    rename = {"knee_flexion": ("knee_angle", -1), "ankle_dorsiflexion": ("ankle_angle", 1)}
    rename |= {"ankle_inversion": ("subtalar_angle", 1), "mtp_extension": ("mtp_angle", 1)}
    names = [rename.get(joint, (joint, 1)) for joint in COORDINATES]
    with (MEASURED / "gait2392_subject01_moment_arms.csv").open() as file:
        rows = [r for r in csv.DictReader(file) if r["nerve_group"] != "trunk"]
    for label, angles in postures.items():
        q = np.array([[sign * angles.get(f"{name}_r", 0.0) for name, sign in names]])
        (arms,), (lengths,) = paths.moment_arms(q), paths.lengths(q)
        for row in (r for r in rows if r["posture"] == label):
            i = paths.names.index(row["muscle"].removesuffix("_r"))
            assert lengths[i] == pytest.approx(float(row["lmt_m"]), abs=2e-5)
            for column, (name, sign) in zip(arms[:, i], names, strict=True):
                assert column == pytest.approx(sign * float(row.get(f"r_{name}_r_m", 0.0)), abs=5e-5)


@pytest.mark.parametrize("none", [[], (), "", {}, iter(())])
def test_a_selection_of_no_nerve_is_refused_and_not_all_of_them(none):
    with pytest.raises(InputError, match="nerve"):
        Nerves(none)
    with pytest.raises(InputError, match="nerves"):
        Nerves().select(none)


def test_select_takes_only_what_is_there():
    nerves = Nerves(["left_femoral", "left_tibial"], strength=1.0).tired(left_tibial=0.5)
    assert nerves.select("left_tibial") == Nerves(["left_tibial"], strength=1.0, fatigue={"left_tibial": 0.5})
    for names in (["right_femoral"], ["left_femoral", "left_soleus"], ["femoral"], [3]):
        with pytest.raises(InputError):
            nerves.select(names)
    assert nerves.select({"left_tibial", "left_femoral"}).names == ("left_femoral", "left_tibial")


def test_nerves_cannot_be_changed_nor_can_copies_of_them():
    left = {"left_femoral": 0.5}
    nerves = Nerves(["left_femoral"], fatigue=left)
    left["left_femoral"] = 7.0
    for same in (nerves, copy.deepcopy(nerves), pickle.loads(pickle.dumps(nerves))):
        assert same == nerves and hash(same) == hash(nerves) and same.left_over == [0.5]
        with pytest.raises(TypeError):
            same.fatigue["left_femoral"] = 7.0
        with pytest.raises(ValueError, match="read-only"):
            same.members[0] = 7.0
    with pytest.raises(InputError, match="force_length"):
        Nerves(force_length="no")
