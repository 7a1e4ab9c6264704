"""A rat's muscle on a lever: its best cause is not lost among the others."""

import pytest

from fes_pin.data.study import read_study
from fes_pin.diagnose.search.likelihood_fits import LikelihoodFits
from fes_pin.models.effects import SensorLag
from fes_pin.models.nominal import nominal_model

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
    sets.extend_all(())
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
