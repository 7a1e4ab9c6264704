"""Trains of pulses that a rig may be driven with in a proposed trial."""

import numpy as np
import pytest
from models.cases import RIGS, trial

from fes_pin.data.errors import InputError
from fes_pin.data.trial import Trial
from fes_pin.models.effects.parallel_stiffness import ParallelStiffness
from fes_pin.models.model import Model
from fes_pin.models.predict import predict
from fes_pin.models.rigs.stimuli import LAST_S, ON_AND_PAUSE_S, RATES_HZ, trains


def test_trains_have_their_rates_their_pauses_and_an_end_before_the_trials():
    time = np.arange(0.0, 10.0, 1e-3)
    found = list(trains(time))
    asked = [(rate, on, pause) for rate in RATES_HZ for on, pause in ON_AND_PAUSE_S]
    assert len(found) == len(asked)
    for train, (rate, on, pause) in zip(found, asked, strict=True):
        assert set(np.unique(train)) == {0.0, 1.0}
        pulses = time[train > 0]
        assert pulses.max() < 10.0 - LAST_S
        assert ((pulses % (on + pause)) < on).all()
        first = pulses[pulses < on]
        assert len(first) == pytest.approx(rate * min(on, 10.0 - LAST_S), abs=1)
        assert np.ptp(np.diff(first)) <= 1.1e-3  # equally far apart, to the sample


def test_a_prediction_that_runs_away_is_refused_where_it_does():
    given = trial("joint", "motion", np.random.default_rng(0), 4000)
    falling = Model(RIGS["joint"]) + ParallelStiffness(stiffness_nm_per_rad=1e8)
    with pytest.raises(InputError, match=r"position is not finite from sample \d+ on: the model is unstable here"):
        predict(falling, Trial(given.name, "motion", given.columns, given.time, given.conditions))
