"""Efforts that answer what is foretold from them: what they add to the likelihood, and how late they come out."""

from dataclasses import replace

import numpy as np
import pytest
from driven_rigs.draw import Base, draw, urdf

from fes_pin.data.answered import answer_of
from fes_pin.data.log import Log
from fes_pin.data.study import Study, read_study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.effort_timing import cost_of_answers
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import LikelihoodFits

MASS, DAMPING, DT = 10.0, 20.0, 0.01
STIFFNESS, BRAKE = 1000.0, 150.0


def held_slide() -> Trial:
    """A slide that is pushed at random, and held by its place and its last difference."""
    rng = np.random.default_rng(4140000)
    q = v = before = push = 0.0
    effort, position = np.empty(3000), np.empty(3000)
    for k in range(3000):
        position[k] = q + 1e-4 * rng.standard_normal()
        effort[k] = -STIFFNESS * position[k] - BRAKE * (position[k] - before) / DT
        before = position[k]
        push = 0.95 * push + 5.0 * rng.standard_normal()
        a = (effort[k] + push - DAMPING * v) / MASS
        q, v = q + DT * v + 0.5 * DT**2 * a, v + DT * a
    return Trial("00", "motion", {"effort": effort, "position": position}, np.arange(3000) * DT)


def test_gains_are_those_of_the_controller():
    trial = held_slide()
    gains = answer_of(trial["effort"], [trial["position"]]).gains
    assert gains.shape == (3000, 1, 2)
    assert np.median(gains[:, 0, 0]) == pytest.approx(-STIFFNESS - BRAKE / DT, rel=1e-4)
    assert np.median(gains[:, 0, 1]) == pytest.approx(BRAKE / DT, rel=1e-4)


def test_what_is_added_is_the_determinant_of_both_equations(tmp_path):
    """Of a slide each row's effort moves the next reading by DT^2 / (2 m), of which a part answers that reading."""
    (tmp_path / "rig.urdf").write_text(urdf(Base("slide", MASS, DAMPING, 0.0, 0.25, 15.0)))
    start = {"inertia_scale": 1.0, "damping": DAMPING}
    study = Study(
        "slide", "joint", {"gravity_scale": 0.0}, start, (held_slide(),), tmp_path, {"urdf": tmp_path / "rig.urdf"}
    )
    found = LikelihoodFits(nominal_model(study), study.trials, []).nominal()
    known = found.model.with_parameters({"inertia_scale": 1.0, "damping": DAMPING})
    fitted = replace(found, model=known, parameters=known.parameters(), noise=replace(found.noise, correlation_s=0.0))
    for rows in (0.2, 0.4):
        felt = rows * DT**2 / (2.0 * MASS) * (-STIFFNESS - BRAKE / DT)
        expected = -2.0 * len(study.trials[0]) * np.log(1.0 - felt)
        assert expected < -80.0
        assert cost_of_answers(fitted, study.trials, Log(effort_late_s=rows * DT)) == pytest.approx(expected, rel=0.03)
    assert cost_of_answers(fitted, study.trials, Log(effort_late_s=-0.2 * DT)) == 0.0
    assert cost_of_answers(fitted, study.trials, Log()) == 0.0


def test_between_both_a_log_of_every_fifth_sample_is_told_no_frame_that_swings(tmp_path):
    """By the innovations alone efforts are 3.4 ms late, in place of 4: then a frame is named, and the mass is off."""
    diagnosis = diagnose_joint(read_study(draw((), 0.3, 4130003, tmp_path, recorded=True, every=5).study))
    assert diagnosis.verdict == "adequate", str(diagnosis)
    assert diagnosis.log.effort_over_s == pytest.approx(0.008, rel=0.1)
    fitted = diagnosis.extended
    assert abs(fitted.values["inertia_scale"] - 1.0) < 2.0 * fitted.std("inertia_scale")
