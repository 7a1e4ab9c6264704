"""The choice between two estimators of the same trials."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis.hidden import study_of

from fes_pin.data.trial import derived_trial
from fes_pin.diagnosis.search.likelihood_fits import MEASUREMENT
from fes_pin.diagnosis.search.likelihood_models import LikelihoodModels, LikelihoodSearch
from fes_pin.diagnosis.verdict import error_within, judged_of
from fes_pin.models.nominal import nominal_model


def test_trials_that_the_study_holds_out_do_not_choose_between_estimators():
    """The error that chooses is that of the fitted trials, each predicted by a fit to the others."""
    study = study_of("joint", driven=False)
    *train, held = study.trials
    models = LikelihoodModels(nominal_model(study), train, effects=(), answered=False, noise=MEASUREMENT)
    search = LikelihoodSearch(models, lambda share, words: None)
    found = search.run()
    columns = {n: -v if n == "position" else v for n, v in held.columns.items()}
    one, other, none = (
        judged_of(search, found, test, 0) for test in ([held], [derived_trial(held, columns=columns)], [])
    )
    assert one.held_out_ahead[1].free < 1.0 < 100.0 < other.held_out_ahead[1].free
    assert error_within(one, models) == error_within(other, models)
    assert error_within(one, models) == pytest.approx(none.held_out_ahead[1].free, rel=1e-9)
    assert np.isfinite(error_within(replace(none, held_out_ahead=None), models))
