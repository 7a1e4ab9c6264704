"""A contact stretches before it slips: at rest dry friction is a spring to where the joint stopped."""

import numpy as np
import pytest
from driven.bristles import DAMPING, DT, FRICTION, MASS, STIFFNESS, believed, trial
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import maximise
from fes_pin.identify.process_noise import first_guess
from fes_pin.models.effects import CoulombFriction
from fes_pin.models.simulate import simulated_trial
from fes_pin.search.likelihood_fits import LikelihoodFits
from fes_pin.search.likelihood_forms import refined_form

NAMES = ("coulomb_friction",)
STRETCH = 2e-3


def pulled(force):
    """A heavy slide without damping, from rest."""
    model = believed().with_parameters({"inertia_scale": 1.0, "damping": 0.0})
    time = np.arange(len(force)) * DT
    columns = {"effort": np.asarray(force, float), "position": np.zeros(len(force))}
    friction = CoulombFriction(FRICTION, stretch=STRETCH)
    return simulated_trial(model + friction, Trial("a", "motion", columns, time))["position"]


def test_a_force_below_friction_is_held_by_a_spring_that_lets_go_back():
    """Damped critically, nearly: 1.8 kN s/m beside 10 kN/m, a time constant of a fifth of a second."""
    n = round(4.0 / DT)
    position = pulled(np.r_[np.full(n, 0.6 * FRICTION), np.zeros(n)])
    assert position[n - 1] == pytest.approx(0.6 * STRETCH, rel=0.01)
    assert abs(position[-1]) < 0.01 * STRETCH


def test_a_force_above_friction_accelerates_by_the_rest():
    n = round(2.0 / DT)
    position = pulled(np.full(n, 3.0 * FRICTION))
    speed = np.gradient(position, DT)
    late = slice(n // 2, n - 1)
    slope = np.polyfit(np.arange(n)[late] * DT, speed[late], 1)[0]
    assert slope == pytest.approx(2.0 * FRICTION / MASS, rel=1e-3)


def test_a_joint_that_was_pushed_beyond_its_stretch_stays_within_it_of_where_it_stopped():
    n = round(1.0 / DT)
    position = pulled(np.r_[np.full(n, 3.0 * FRICTION), np.full(4 * n, 0.0)])
    assert position[-1] > 20.0 * STRETCH
    assert position.max() - position[-1] == pytest.approx(STRETCH, rel=0.05)


def test_a_stretch_too_short_for_integration_steps_is_not_shorter_than_they_resolve():
    """The stiffness of 20 N over a nanometre would ring at 15 kHz."""
    n = round(1.0 / DT)
    model = believed().with_parameters({"inertia_scale": 1.0}) + CoulombFriction(FRICTION, stretch=1e-9)
    columns = {"effort": np.full(n, 0.5 * FRICTION), "position": np.zeros(n)}
    position = simulated_trial(model, Trial("a", "motion", columns, np.arange(n) * DT))["position"]
    assert np.abs(position).max() < 1e-4


def refined(trials):
    """The nominal fit, that of friction in its plainest form, and that in the form that the data demand."""
    sets = LikelihoodFits(believed(), trials, [CoulombFriction])
    nominal = sets.nominal()
    plain = maximise(LikelihoodProblem(nominal.model + CoulombFriction(), trials, nominal.noise))
    sets.extend(())
    while better := refined_form(sets.fits[NAMES], sets.library.measured):
        sets.fits[NAMES] = better
    return nominal, plain, sets.fits[NAMES]


def test_bristles_are_read_as_friction_with_a_stretch():
    """LuGre's friction, which no form of the engine is: plain dry friction falls short of it, and calls it random."""
    nominal, plain, found = refined([trial(1), trial(2)])
    friction = found.model.effects[0]
    assert "stretch" in friction.refined()
    assert nominal.sse - plain.sse > 100.0
    assert plain.sse - found.sse > nominal.sse - plain.sse
    assert found.noise.std["effort"] < 0.6 * plain.noise.std["effort"]
    assert friction.torque_nm == pytest.approx(FRICTION, rel=0.1)
    assert found.values["damping"] == pytest.approx(DAMPING, rel=0.1)
    assert found.values["inertia_scale"] == pytest.approx(1.0, abs=0.03)
    assert friction.stretch == pytest.approx(FRICTION / STIFFNESS, rel=0.6)


def test_a_contact_that_stretches_far_and_rings_is_no_friction_that_falls_off():
    """A millimetre, as of belts and gears, damped by a sixth of what is critical: before, its stretch was not found."""
    stiffness = FRICTION / 1e-3
    damping = 2.0 * np.sqrt(stiffness * MASS) / 6.0
    _, plain, found = refined([trial(k, contact=(stiffness, damping)) for k in (3, 4)])
    friction = found.model.effects[0]
    assert friction.stretch == pytest.approx(1e-3, rel=0.3)
    assert friction.torque_nm == pytest.approx(FRICTION, rel=0.05)
    assert found.values["inertia_scale"] == pytest.approx(1.0, abs=0.02)
    assert found.noise.std["effort"] < 0.6 * plain.noise.std["effort"]


def test_the_shortest_stretch_that_a_fit_may_come_to_is_still_one():
    """At none the model has no spring: a fit that ended there was one of another model, with another likelihood."""
    read, name = [trial(1)], "coulomb_friction.stretch"
    model = believed() + CoulombFriction(FRICTION, softness=0.5, stretch=STRETCH)
    problem = LikelihoodProblem(model, read, first_guess(model, read))
    shortest = {**model.parameters(), name: problem.limits[name][0]}
    again = LikelihoodProblem(model.with_parameters(shortest), read, problem.noise)
    unknowns = problem.start_unknowns()
    assert again.free == problem.free
    assert again.cost(shortest, unknowns) == pytest.approx(problem.cost(shortest, unknowns), abs=1e-6)
    none = model.with_parameters({name: 0.0})
    without = LikelihoodProblem(none, read, problem.noise)
    assert name not in without.free
    assert abs(without.cost(none.parameters(), unknowns) - problem.cost(shortest, unknowns)) > 10.0


def test_a_lag_beside_friction_of_a_contact_that_breaks_away_at_once_is_named(tmp_path):
    """Held-out trials refused it where friction was of another form in their fits than in that of all."""
    drawn = draw(("coulomb_friction", "sensor_lag"), 0.3, 6200035, tmp_path, recorded=True)
    found = diagnose_joint(read_study(drawn.study))
    assert sorted(c.name for c in found.causes) == sorted(drawn.causes), str(found)
