"""Attainable torques: support, distance, share and outline against points of the set and against linear programs."""

import numpy as np
import pytest
from scipy.optimize import linprog, lsq_linear

from fes_pin.allocation.attainable_torques import AttainableTorques
from fes_pin.allocation.walk import allocate_walk
from fes_pin.body.joints import JOINT_NAMES
from fes_pin.data.errors import InputError
from fes_pin.muscles.nerves import Nerves


def random_set(rng):
    m, n = int(rng.integers(1, 5)), int(rng.integers(1, 9))
    return AttainableTorques(rng.normal(size=(m, n)) * 50 * rng.choice([0.0, 1.0], (m, n), p=[0.3, 0.7]))


def test_points_made_by_recruitment_are_inside_and_supported():
    rng = np.random.default_rng(0)
    for _ in range(300):
        set_ = random_set(rng)
        torque = set_.columns @ rng.uniform(0, 1, set_.columns.shape[1])
        nearest = set_.nearest(torque)
        assert nearest.inside and set_.contains(torque)
        np.testing.assert_allclose(set_.columns @ nearest.recruitment, nearest.torque, atol=1e-9)
        for direction in rng.normal(size=(5, len(torque))):
            assert direction @ torque <= set_.support(direction) + 1e-9
        assert set_.share(torque) >= 1.0 - 1e-7


def test_distance_equals_bounded_least_squares_and_separates():
    rng, outside = np.random.default_rng(1), 0
    for _ in range(300):
        set_ = random_set(rng)
        torque = rng.normal(size=len(set_.joints)) * 100
        nearest = set_.nearest(torque)
        # bounds in lsq_linear need room, so that columns of zeros do no harm
        expected = lsq_linear(set_.columns, torque, (0.0, 1.0), method="bvls", tol=1e-14)
        assert nearest.distance == pytest.approx(np.sqrt(2 * expected.cost), abs=1e-5)
        if not nearest.inside:
            outside += 1
            away = torque - nearest.torque  # a plane between the torque and the set
            assert away @ nearest.torque >= set_.support(away) - 1e-6 * np.linalg.norm(away) * 100
            assert set_.share(torque) < 1.0 + 1e-6
    assert outside > 100


def test_share_is_the_largest_attainable_multiple():
    rng = np.random.default_rng(2)
    for _ in range(100):
        set_ = random_set(rng)
        torque = set_.columns @ rng.uniform(0, 1, set_.columns.shape[1])
        if not torque.any():
            assert set_.share(torque) == np.inf
            continue
        share = set_.share(torque)
        assert set_.nearest(share * torque).distance <= 1e-4
        assert not set_.contains(1.01 * share * torque) or share * np.abs(torque).max() < 1e-3


def test_range_is_what_linear_programs_find():
    nerves = Nerves(["left_tibial", "left_femoral", "left_hamstrings"])
    set_ = AttainableTorques(nerves, {"left_knee_flexion": 0.4})
    for joint, row in zip(set_.joints, set_.columns, strict=True):
        least, most = (linprog(s * row, bounds=[(0, 1)] * 3).fun * s for s in (1, -1))
        assert set_.range(joint) == pytest.approx((least, most), abs=1e-9)


def test_outline_is_convex_and_holds_every_corner_on_it_or_within():
    rng = np.random.default_rng(3)
    for _ in range(40):
        columns = rng.normal(size=(2, rng.integers(1, 7))) * 30
        set_ = AttainableTorques(columns)
        corners = set_.outline("joint_1", "joint_2")
        for direction in rng.normal(size=(20, 2)):
            assert (corners @ direction).max() == pytest.approx(set_.support(direction), abs=1e-9)
        if len(corners) > 2:
            edges = np.roll(corners, -1, 0) - corners
            turn = edges[:, 0] * np.roll(edges[:, 1], -1) - edges[:, 1] * np.roll(edges[:, 0], -1)
            assert (turn >= -1e-9).all()


def test_more_nerves_attain_no_less_of_a_gait():
    rng = np.random.default_rng(4)
    few, many = (
        ["left_femoral", "left_tibial"],
        ["left_femoral", "left_tibial", "left_hamstrings", "left_deep_peroneal"],
    )
    joints = ["left_knee_flexion", "left_ankle_dorsiflexion"]
    q = rng.uniform(-0.2, 0.4, (80, 19))
    torque = np.zeros((80, 19))
    torque[:, [JOINT_NAMES.index(j) for j in joints]] = rng.normal(size=(80, 2)) * 30
    weights = np.array([float(j in joints) for j in JOINT_NAMES])
    walks = [allocate_walk(torque, Nerves(names), q, weights=weights, effort=1e-8) for names in (few, many)]
    shares = [(np.abs(walk.shortfall[:, weights > 0.0]) <= 1.0).all(1).mean() for walk in walks]
    assert 0.0 < shares[0] < shares[1] <= 1.0
    by_hand = [
        AttainableTorques(Nerves(many), q[k], joints)
        .nearest(torque[k, [JOINT_NAMES.index(j) for j in joints]])
        .distance
        < 0.5
        for k in range(80)
    ]
    assert shares[1] == pytest.approx(np.mean(by_hand), abs=0.05)


@pytest.mark.parametrize(
    "make",
    [
        lambda: AttainableTorques(np.full((2, 2), np.nan)),
        lambda: AttainableTorques(Nerves(), joints=["left_toe"]),
        lambda: AttainableTorques(Nerves(), joints=["left_knee_flexion"]).support({"left_hip_flexion": 1.0}),
        lambda: AttainableTorques(Nerves()).outline("left_knee_flexion", "left_toe"),
        lambda: AttainableTorques(Nerves()).nearest(np.full(19, np.nan)),
    ],
)
def test_bad_input_is_one_clear_line(make):
    with pytest.raises(InputError) as caught:
        make()
    assert "\n" not in str(caught.value)
