"""A set less one cause."""

import math
from dataclasses import replace

import numpy as np
import pytest
from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import maximise
from fes_pin.models.effects import CoulombFriction, EffortGain, PeriodicTorque
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import LikelihoodFits


@pytest.mark.parametrize("own", [False, True], ids=["a phase of all trials", "a phase of each trial's own"])
def test_less_its_only_cause_a_set_is_the_nominal_model(tmp_path, own):
    study, names = read_study(draw((), 0.3, 3, tmp_path).study), ("periodic_torque",)
    sets = LikelihoodFits(nominal_model(study), study.trials, [PeriodicTorque])
    nominal = sets.nominal()
    torque = PeriodicTorque.of_each_trial(frequency_hz=0.4) if own else PeriodicTorque(0.01, frequency_hz=0.4)
    problem = LikelihoodProblem(nominal.model + torque, study.trials, nominal.noise)
    sets.fits[names] = maximise(problem)
    del sets.fits[()]
    assert sets.without(names, "periodic_torque").sse == pytest.approx(nominal.sse, abs=0.5)


def test_a_set_that_runs_away_is_not_extended(tmp_path):
    """Less one of eight causes a muscle's model did, and the diagnosis ended there."""
    study = read_study(draw((), 0.3, 3, tmp_path).study)
    sets = LikelihoodFits(nominal_model(study), study.trials, [PeriodicTorque])
    nominal = sets.nominal()
    parts = tuple(replace(p, jacobian=np.full_like(p.jacobian, np.nan)) for p in nominal.parts)
    sets.fits[()] = replace(nominal, sse=math.inf, parts=parts)
    sets.extend(())
    assert set(sets.fits) == {()}


def test_less_one_cause_a_set_that_runs_away_is_grown_from_the_part_that_does_not(tmp_path):
    """As of eight causes of a muscle, which only together foretold anything."""
    study, names = read_study(draw(("coulomb_friction",), 0.3, 13, tmp_path).study), ("coulomb_friction", "effort_gain")
    sets = LikelihoodFits(nominal_model(study), study.trials, [CoulombFriction, EffortGain])
    nominal = sets.nominal()
    sets.extend(())
    known = sets.fits.pop(("coulomb_friction",))
    away = nominal.model + CoulombFriction(torque_nm=1e6) + EffortGain()
    unknown = np.full((len(away.fitted_parameters()),) * 2, np.inf)
    of_it = {"model": away, "free": away.fitted_parameters(), "parameters": away.parameters()}
    sets.fits[names] = replace(nominal, **of_it, covariance=unknown)
    assert sets.without(names, "effort_gain").sse == pytest.approx(known.sse, abs=1.0)
