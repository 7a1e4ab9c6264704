"""Error rates of what is simulated: the remainder; folds; the next experiment."""

import numpy as np
from diagnosis.hidden import study_of
from identify.rigs import trials_of

from fes_pin.models.predict import predict
from fes_pin.prepare.measured import folds_of
from fes_pin.remainder.lack_of_fit import lack_of_fit
from fes_pin.search.likelihood_fits import LikelihoodFits


def test_the_remainder_keeps_its_level():
    """In 100 studies without a remainder one in a hundred has one: more than five would be a defect (P = 5e-4)."""
    rng = np.random.default_rng(3)
    model, trials = trials_of("muscle", rng, count=5, n=300)
    clean = [predict(model, t) for t in trials]
    found = 0
    for _ in range(100):
        noisy = [
            t.with_columns(force_n=c["force_n"] + 0.2 * rng.standard_normal(len(t)))
            for t, c in zip(trials, clean, strict=True)
        ]
        found += lack_of_fit(LikelihoodFits(model, noisy, (), answered=False).nominal()).unexplained
    assert found <= 5


def test_a_smooth_remainder_is_located():
    rng = np.random.default_rng(4)
    model, trials = trials_of("muscle", rng, count=5, n=300)
    bent = [t.with_columns(force_n=t["force_n"] + 0.4 * (t.time / t.time[-1]) ** 2) for t in trials]
    fitted = LikelihoodFits(model, bent, (), answered=False).nominal()
    left = lack_of_fit(fitted)
    assert left.unexplained and left.p_value < 1e-6
    assert left.where in {"time", "history", "offset"}


def test_folds_leave_out_whole_trials_of_every_kind():
    trials = study_of("ankle", n_motion=6, n_isometric=4, duration_s=2.0).trials
    folds = folds_of(trials)
    assert sorted(i for f in folds for i in f) == list(range(len(trials)))
    assert len(folds) == 5
    assert [len(f) for f in folds_of(trials[:3])] == [1, 1, 1]
    for fold in folds:  # what is left has both kinds and both loads
        left = [t for i, t in enumerate(trials) if i not in fold]
        assert {t.kind for t in left} == {"motion", "isometric"}
        assert {t.conditions.get("load_kg") for t in left} >= {1.0, 1.5}
