"""A rat's muscle on a lever: its best cause is not lost among the others, and what is found foretells unseen cycles."""

import json

import numpy as np
import pytest

from fes_pin import diagnose
from fes_pin.data.study import read_study
from fes_pin.models.effects import SensorLag
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import simulate
from fes_pin.search.likelihood_fits import LikelihoodFits

pytestmark = pytest.mark.shared

LAG = ("sensor_lag",)


@pytest.fixture(scope="module")
def study(shared):
    return read_study(shared / "data/rat_muscle")


@pytest.fixture(scope="module")
def trials(study):
    """Every fourth of those that are fitted."""
    return [t for t in study.trials if t.role != "held_out"][::4]


def singles(study, trials, library):
    sets = LikelihoodFits(nominal_model(study), trials, library)
    sets.nominal()
    sets.extend(())
    return sets


@pytest.fixture(scope="module")
def alone(study, trials):
    """The fit of a lag that has no rival."""
    return singles(study, trials, [SensorLag]).fits[LAG]


def test_the_best_cause_is_found_beside_the_whole_library(study, trials, alone):
    """It begins where little is random, and looks hopeless until what is random has had a turn."""
    sets = singles(study, trials, None)
    assert sets.ranked(1)[0] == LAG
    assert sets.fits[LAG].sse == pytest.approx(alone.sse, abs=10.0)


def test_its_fit_tries_every_step(alone):
    """Slopes for gains as they are go with it to its end: trying fewer steps there it ended 500 to 1300 short."""
    assert alone.sse < -98000.0


def share_of_peak(model, trial):
    """Error from the first pulse to the last over the peak, percent: as reference.json defines it."""
    pulses = np.flatnonzero(trial["stim"] > 0)
    part = slice(pulses[0], pulses[-1] + 5)
    missed = trial.residual(simulate(model, trial), "force_n")[part]
    return 100.0 * float(np.sqrt(np.mean(missed**2))) / float(trial["force_n"][part].max())


@pytest.mark.long
def test_what_is_found_foretells_cycles_better_than_the_authors(shared, study):
    """Ten minutes: the answer hangs on every cause's bounds, for a false one that nothing binds takes all the rest."""
    found = diagnose(study)
    theirs = json.loads((shared / "data/rat_muscle/reference.json").read_text())["ssc"]["IM_rmse_percent_of_peak"]
    cycles = [t for t in study.trials if t.name.startswith("ssc")]
    assert len(cycles) == 54
    assert np.mean([share_of_peak(found.extended.model, t) for t in cycles]) < theirs
    assert {"series_elasticity", "force_velocity", "force_length"} <= {c.name for c in found.causes}
