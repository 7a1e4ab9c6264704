"""Parts of efforts that are held out: those that the others identify, or none."""

import numpy as np
import pytest
from effort.bench import study, trial

from fes_pin.effort import verdict
from fes_pin.effort.search import searched
from fes_pin.models.nominal import nominal_model


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    one = study(tmp_path_factory.mktemp("arm"), [trial(seed, friction=0.1, seconds=5.0) for seed in range(2)])
    return searched(nominal_model(one).rig, one.trials)


def test_every_part_of_trials_that_move_alike_is_predicted(found):
    assert found.names == ("coulomb_friction",)
    units = found.verdict.predicted(found.state.found.best)
    assert len(units) == 8 and units.all()


def test_only_parts_that_are_predicted_count(found, monkeypatch):
    best = found.state.found.best
    whole = found.verdict.errors_of(best, best)
    monkeypatch.setattr(verdict, "identified_folds", lambda *_: [[1, 6]])
    some = found.verdict.errors_of(best, best)
    assert np.array_equal(some.squares, whole.squares[[1, 6]])
    assert np.array_equal(some.noise, whole.noise[[1, 6]])
    assert found.verdict.weigh(found.state.found).evidence["coulomb_friction"].low > 0.0


def test_where_none_is_predicted_the_fit_itself_is_judged(found, monkeypatch):
    best, sets = found.state.found.best, found.models
    monkeypatch.setattr(verdict, "identified_folds", lambda *_: [])
    inside = found.verdict.errors_of(best, best).squares.sum()
    left = sets.problem(best.names, best.forms).residuals(best.values)[0]
    assert inside == pytest.approx(
        sum(float(np.sum((r * w) ** 2)) for r, w in zip(left, sets.roots(best), strict=True))
    )
