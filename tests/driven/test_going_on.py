"""A search goes on where something is left, whatever further causes promise."""

import numpy as np
import pytest
from driven.bristles import believed, trial

from fes_pin.diagnosis.likelihood_models import LikelihoodModels, LikelihoodSearch
from fes_pin.models.effects import CoulombFriction, SensorOffset
from fes_pin.search.score import Scores


@pytest.mark.parametrize("effects", [[SensorOffset], [CoulombFriction]], ids=["friction is left", "nothing is left"])
def test_a_search_whose_causes_promise_nothing_goes_on_where_something_is_left(effects, monkeypatch):
    """A slide with dry friction: beside the nominal model it is left, and taken up by a random effort."""
    sets = LikelihoodModels(believed(), [trial(1), trial(2)], effects)
    search = LikelihoodSearch(sets, lambda share, words: None)
    best = search.run().best
    names = tuple(e.name for e in best.model.effects)
    assert names == (("coulomb_friction",) if CoulombFriction in effects else ())
    monkeypatch.setattr(sets.library, "scores", lambda base: Scores([], np.zeros((0, 0)), []))
    assert search._worth_extending(names) == (CoulombFriction not in effects)
