"""A further form of an effect is adopted where the data tell its parameters, whatever stood at a bound before."""

from dataclasses import replace

import numpy as np
import pytest
from identify.rigs import WHITE, measured
from models.cases import RIGS, trial

from fes_pin.identify.fit import fit_problem
from fes_pin.identify.problem import Problem
from fes_pin.models.effects import CoulombFriction, SensorNonlinearity
from fes_pin.models.model import Model
from fes_pin.search.likelihood_forms import is_identified
from fes_pin.search.starts import number_of_forms, refinements

BOUND = "coulomb_friction.stiction"


@pytest.fixture(scope="module")
def fitted():
    """A joint whose friction has stiction, in which the data tell it."""
    rng = np.random.default_rng(0)
    true = Model(RIGS["joint"]) + CoulombFriction(0.05, stiction=0.8, stribeck_speed=0.5) + SensorNonlinearity(0.1)
    trials = [measured(true, trial("joint", "motion", rng, 1200), rng) for _ in range(4)]
    return fit_problem(Problem(true, trials, WHITE), true.parameters())


def test_what_the_data_tell_is_identified(fitted):
    assert BOUND in fitted.free
    assert is_identified(fitted)


def test_a_form_that_ends_at_its_bound_is_not(fitted):
    assert not is_identified(replace(fitted, at_bound=(BOUND,)))
    assert not is_identified(replace(fitted, at_bound=(BOUND,)), fitted)


def test_what_stood_at_its_bound_before_does_not_count(fitted):
    stuck = replace(fitted, at_bound=(BOUND,))
    assert is_identified(stuck, stuck)


@pytest.mark.parametrize(
    ("rig", "effects", "count"),
    [
        ("joint", (CoulombFriction(0.05),), 6),
        ("ankle", (CoulombFriction(0.05),), 6),
        ("joint", (CoulombFriction(0.05, stiction=0.8, stretch=1e-3),), 4),
        ("joint", (), 1),
    ],
)
def test_a_form_shares_its_level_with_all_that_are_tried(rig, effects, count):
    """Of friction a joint has all but asymmetry, an ankle all but the stretch of a contact."""
    model = Model(RIGS[rig])
    for one in effects:
        model = model + one
    assert number_of_forms(model, model.effects) == count


@pytest.mark.parametrize(("way", "tried"), [(0.0, False), (0.3, True)])
def test_a_form_that_the_measured_motion_gives_no_size_is_not_tried(way, tried):
    """Presliding is a share of the way of an imposed motion: where none is, it had been fitted as no form."""
    time = np.arange(200) * 0.01
    measured = {"time": time, "position": way * np.sin(time), "reading": np.zeros(200)}
    model = Model(RIGS["joint"]) + CoulombFriction(0.05)
    starts = refinements(model, model.effects[0], measured)
    assert starts
    assert all(one.effects[0].refined() for one in starts)
    assert any("presliding" in one.effects[0].refined() for one in starts) is tried
