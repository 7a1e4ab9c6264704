"""The choice between two estimators of the same trials."""

from types import SimpleNamespace

import pytest
from diagnosis.hidden import study_of

from fes_pin.data.trial import derived_trial
from fes_pin.diagnosis.likelihood_models import LikelihoodModels, LikelihoodSearch
from fes_pin.diagnosis.verdict import RigVerdict
from fes_pin.identify.ahead import free_residuals
from fes_pin.identify.error_measures import FREE
from fes_pin.infer.result import Remainder
from fes_pin.infer.verdict import State
from fes_pin.models.nominal import nominal_model
from fes_pin.search.likelihood_fits import MEASUREMENT


def test_trials_that_the_study_holds_out_do_not_choose_between_estimators():
    """The error that chooses is that of the fitted trials, each predicted by a fit to the others."""
    study = study_of("joint", driven=False)
    *train, held = study.trials
    models = LikelihoodModels(nominal_model(study), train, effects=(), answered=False, noise=MEASUREMENT)
    search = LikelihoodSearch(models, lambda share, words: None)
    found = search.run()
    columns = {n: -v if n == "position" else v for n, v in held.columns.items()}
    verdicts = [RigVerdict(search, test) for test in ([held], [derived_trial(held, columns=columns)], [])]
    states = [v.of(found) for v in verdicts]
    one, other, none = (v.errors(s)[1][1].free for v, s in zip(verdicts, states, strict=True))
    assert one < 1.0 < 100.0 < other and none < 1.0
    errors = [v.errors_in(s, FREE, s).error_percent() for v, s in zip(verdicts, states, strict=True)]
    assert errors[0] == errors[1] == pytest.approx(errors[2], rel=1e-9)
    assert errors[2] == pytest.approx(by_hand(verdicts[2].folds(states[2])), rel=1e-9)


def by_hand(folds):
    """E of the readings of each fold by a simulation of the fit to the others, percent."""
    tested = [(f.chosen or f.best, t) for f in folds for t in f.test]
    missed = [free_residuals(fitted.model, t, fitted.noise)["position"] for fitted, t in tested]
    around = [t["position"] - t["position"].mean() for _, t in tested]
    return 100.0 * sum(float(m @ m) for m in missed) / sum(float(a @ a) for a in around)


@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize("replaced", [True, False])
def test_a_lack_of_fit_by_either_estimator_stays(own, replaced):
    models = SimpleNamespace(library=SimpleNamespace(effects=()), refitted=None)
    verdict = RigVerdict(SimpleNamespace(models=models), ())

    def state(unexplained, before=None):
        left = Remainder(unexplained, 1e-6 if unexplained else 0.5, "rate" if unexplained else None)
        weighed = SimpleNamespace(lack_of_fit=left, random=(), no_noise=None, voluntary=None)
        return State(verdict, SimpleNamespace(without={}), weighed, {}, frozenset(), replaced=before)

    assert verdict.lack_of_fit(state(own, state(replaced))).unexplained is (own or replaced)
