"""What is built in control and paper checks itself, cannot be changed, is compared, copied and shown."""

import copy
import dataclasses
import math
import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from paper_ankle.constants import (
    FORCE_NOISE_N,
    HELD_AT_RAD,
    PRINTED,
    isometric_stimulus,
    paper_trial,
    paper_twin,
    twin_of_ratios,
)
from paper_ankle.error_region import ellipsoid_floor, error_domain, error_holding, profile_intervals
from paper_ankle.identifiability import ankle_identifiability
from paper_ankle.ratios import RatioProblem, ankle_of, least_error
from paper_ankle.twin import AnkleTwin, RunningTwin, record

import fes_pin as fp
from fes_pin.control.control import PositionController
from fes_pin.control.dynamics import AnkleDynamics, JointObserver
from fes_pin.control.endurance import Budget, muscle_budget
from fes_pin.control.loop import sine, track
from fes_pin.control.margins import margins
from fes_pin.control.pulse import StimulationLimits
from fes_pin.control.tuning import Gains, loop_at
from fes_pin.data.errors import InputError
from fes_pin.paper.antagonist import fit_antagonist
from fes_pin.paper.kalman import track_gain

TWIN = replace(paper_twin("3-23"), load_kg=0.5)
TIRING = ankle_of(TWIN) + fp.effects.Fatigue()


@cache
def results():
    """One of each kind."""
    controller = PositionController(ankle_of(TWIN), 0.5)
    held = record(TWIN, isometric_stimulus(2.0), "held", held_at_rad=HELD_AT_RAD, noise_std=FORCE_NOISE_N)
    loads = np.repeat([0.2, 0.5, 1.0, 1.5, 2.0], 2)
    angles = [replace(TWIN, load_kg=m).rest_angle() for m in loads.tolist()]
    noise = 2e-3 * np.random.default_rng(0).standard_normal(len(loads))
    problem = RatioProblem(ankle_of(paper_twin("3-23")), [paper_trial("3-23")])
    optimum = least_error(problem, starts=1)
    domain = error_domain(problem, optimum)
    return {
        "dynamics": controller.dynamics,
        "gains": controller.gains,
        "loop": loop_at(controller.dynamics, controller.observer, controller.gains, 1.8),
        "margins": margins(loop_at(controller.dynamics, controller.observer, controller.gains, 1.8)),
        "tracking": track(controller, RunningTwin(TWIN), sine(TWIN.rest_angle(), 10.0, 0.5, 2.0)),
        "budget": muscle_budget(TIRING, 0.5, sine(1.65, 10.0, 0.5, 2.0)),
        "limits": StimulationLimits(500, 9000, 900, 40),
        "history": track_gain(held, TWIN.constants(), FORCE_NOISE_N),
        "antagonist": fit_antagonist(loads, np.array(angles) + noise, 2e-3, TWIN.foot_mass_kg),
        "optimum": optimum,
        "extreme": domain.lowest["k1"],
        "identifiability": ankle_identifiability(ankle_of(TWIN), [paper_trial("3-23")]),
        "twin": TWIN,
        "printed": PRINTED["3-23"],
    }


EACH = pytest.mark.parametrize("name", [*results()])


@EACH
def test_a_copy_is_equal_has_the_same_hash_and_differs_from_another(name):
    one = results()[name]
    for other in (copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one)), dataclasses.replace(one)):
        assert one == other and hash(one) == hash(other)
    assert one != results()["twin" if name != "twin" else "gains"] and one != 1.0


@EACH
def test_frozen_means_frozen_in_copies_too(name):
    one = results()[name]
    for each in (one, copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        for item in dataclasses.fields(each):
            value = getattr(each, item.name)
            with pytest.raises(dataclasses.FrozenInstanceError):
                setattr(each, item.name, value)
            if isinstance(value, np.ndarray) and value.size:
                with pytest.raises(ValueError, match="read-only"):
                    value[...] = 7.0
            if isinstance(value, dict):
                pytest.fail(f"{name}.{item.name} can be changed")


@pytest.mark.parametrize("name", [n for n, r in results().items() if hasattr(r, "to_frame")])
def test_a_result_is_shown_as_a_frame_and_in_a_notebook(name):
    pytest.importorskip("pandas")
    one = results()[name]
    frame, page = one.to_frame(), one._repr_html_()
    assert len(frame) >= 1 and type(one).__name__ in page and "<table>" in page


def test_the_columns_of_a_frame_are_those_of_the_result():
    pytest.importorskip("pandas")
    budget, gains, margin = (results()[n] for n in ("budget", "gains", "margins"))
    assert list(budget.to_frame()) == ["time", "needed", "capacity"] and len(budget.to_frame()) == len(budget.time)
    np.testing.assert_array_equal(gains.to_frame().to_numpy(), gains.table)
    assert margin.to_frame()["delay_s"].tolist() == [margin.delay_s]


def test_arrays_that_were_given_can_still_be_changed_and_change_nothing():
    time = np.arange(3.0)
    budget = Budget(time, np.ones(3), np.ones(3))
    time[0] = 7.0
    assert budget.time[0] == 0.0


@pytest.mark.parametrize(
    "build",
    [
        lambda: Budget([0.0, 1.0], [0.5], [1.0, 1.0]),
        lambda: Budget([0.0], [math.nan], [1.0]),
        lambda: Budget([], [], []),
        lambda: Budget("a", [0.5], [1.0]),
        lambda: Gains(np.array([1.6, 2.0]), np.ones((2, 2)), 0.5, 0.9, 0.01),
        lambda: Gains(np.array([2.0, 1.6]), np.ones((2, 3)), 0.5, 0.9, 0.01),
        lambda: Gains(np.array([2.0]), np.ones((1, 3)), 0.5, 0.9, 0.01),
        lambda: replace(results()["dynamics"], inertia=0.0),
        lambda: replace(results()["dynamics"], pull_nm=math.nan),
        lambda: replace(results()["dynamics"], damping=-1.0),
        lambda: replace(results()["history"], gain=np.ones(3)),
        lambda: AnkleDynamics.of(ankle_of(TWIN), "0.5"),
        lambda: AnkleDynamics.of(ankle_of(TWIN).rig, 0.5),
        lambda: JointObserver(results()["dynamics"], angle_std_rad=math.nan),
        lambda: JointObserver(results()["dynamics"], torque_wander=math.inf),
        lambda: JointObserver(results()["dynamics"], share_wander=-1.0),
        lambda: JointObserver(ankle_of(TWIN)),
        lambda: PositionController(ankle_of(TWIN), 0.5, resolution_rad=math.nan),
        lambda: AnkleTwin(inertia_kgm2=0.0),
        lambda: AnkleTwin(load_kg=math.nan),
        lambda: AnkleTwin(threshold_us=1000.0, saturation_us=180.0),
        lambda: AnkleTwin(gain="1"),
        lambda: twin_of_ratios({"k1": 34.0}, 1.0),
        lambda: twin_of_ratios({"k1": 34.0, "k2": 0.0, "k3": 58.0}, 1.0),
        lambda: paper_twin("3-24"),
        lambda: RatioProblem(TWIN, [paper_trial("3-23")]),
        lambda: RatioProblem(ankle_of(TWIN), []),
        lambda: ellipsoid_floor(1.0, 2.0, math.nan, 5.0),
        lambda: ellipsoid_floor(1.0, 3.0, 2.0, 5.0),
        lambda: ankle_identifiability(ankle_of(TWIN), [paper_trial("3-23")], ("lever",)),
    ],
)
def test_what_cannot_be_is_refused_where_it_is_built(build):
    with pytest.raises(InputError) as refused:
        build()
    assert "\n" not in str(refused.value)


def test_what_is_asked_of_a_domain_is_checked():
    problem = RatioProblem(ankle_of(paper_twin("3-23")), [paper_trial("3-23")])
    optimum = results()["optimum"]
    domain = error_domain(problem, optimum)
    for ask in (
        lambda: domain.correlation("k1", "k4"),
        lambda: domain.minimum("k4"),
        lambda: domain.maximum("k4"),
        lambda: domain.outline("k1", "k1"),
        lambda: error_holding(problem, optimum, "k4", 60.0),
        lambda: error_holding(problem, optimum, "k2", -1.0),
        lambda: profile_intervals(problem, optimum, 0.0),
        lambda: error_domain(problem, optimum, math.nan),
        lambda: least_error(problem, starts=0),
    ):
        with pytest.raises(InputError):
            ask()
    with pytest.raises(TypeError):
        domain.lowest["k1"] = None
