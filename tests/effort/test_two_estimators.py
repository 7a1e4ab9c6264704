"""Two estimators of a joint whose effort was recorded: the likelihood, and inverse dynamics."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bench import study, trial
from driven_rigs.laboratory import draw_laboratory
from driven_rigs.swing_up import draw_swing_up
from harness.never_worse import errors_against, withheld
from harness.voluntary import Voluntary

import fes_pin as fp
from fes_pin.data.errors import InputError
from fes_pin.diagnosis import by_effort, likelihood_models
from fes_pin.diagnosis.by_effort import ValuesOfInverseDynamics, named_by_one
from fes_pin.diagnosis.likelihood_models import LikelihoodModels, LikelihoodSearch
from fes_pin.diagnosis.verdict import RigVerdict
from fes_pin.diagnosis.weighed import RigWeighed
from fes_pin.effort import search
from fes_pin.infer.estimators import CHOICE
from fes_pin.infer.result import Evidence
from fes_pin.infer.search import FITTED
from fes_pin.infer.verdict import State
from fes_pin.models.effects import CoulombFriction, EffortOffset
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.search import likelihood_fits
from fes_pin.search.likelihood_fits import LikelihoodFits


def test_a_cause_that_effort_alone_shows_is_named_where_it_lessens_both_errors(tmp_path):
    """One trial of an arm with a spring and friction: held-out motion confirms friction alone.

    Efforts do not tell the spring from a tilt.
    """
    drawn = draw_laboratory(("coulomb_friction", "parallel_stiffness"), 20291150, tmp_path)
    found = fp.diagnose(fp.read_study(drawn.study))
    friction, other = sorted(found.causes, key=lambda c: c.name != "coulomb_friction")
    assert friction.name == "coulomb_friction"
    assert {"parallel_stiffness", "base_tilt"} <= {other.name, *other.equivalents}
    assert any("is named by effort, not by motion" in one for one in found.warnings)
    step = next(one for one in found.why.steps if one.claim == CHOICE)
    assert "low-passed effort" in str(step) and "predictions" in str(step)


def arm(folder, **hidden):
    return study(folder, [trial(seed, **hidden) for seed in range(3)])


def test_both_estimators_agree_on_an_arm(tmp_path):
    found = fp.diagnose(arm(tmp_path, friction=0.1, drag=0.05))
    assert {c.name for c in found.causes} == {"coulomb_friction", "quadratic_damping"}
    assert not [w for w in found.warnings if "is named by" in w]


def test_an_estimate_is_compared_with_the_maximum_near_it(tmp_path):
    """A search of efforts that stays at half the waves says nothing of the error of the right ones."""
    teeth = arm(tmp_path, teeth=(0.05, 20.0))
    found = search.searched(fp.nominal_model(teeth).rig, teeth.trials, 0)
    names, sets = ("cogging",), found.models
    far = {"cogging.in_phase": 0.0, "cogging.quadrature": 0.01, "cogging.waves": 10.0}
    sets.fits[names] = sets.fit(names, far, {})
    right = {"cogging.in_phase": 0.05, "cogging.quadrature": 0.0, "cogging.waves": 20.0}
    other = found.near(SimpleNamespace(names=names, free=(*right,), values=right))
    assert abs(sets.fits[names].values["cogging.waves"] - 20.0) > 3.0
    assert other.values["cogging.waves"] == pytest.approx(20.0, abs=0.2)
    assert other.values["cogging.in_phase"] == pytest.approx(0.05, rel=0.1)


def test_a_set_that_lessens_the_error_of_effort_alone_is_no_answer(tmp_path, monkeypatch):
    """Inverse dynamics is made to name a cause that is not there: the motion contradicts it, and a warning says so."""
    original = by_effort.searched

    def too_much(rig, trials, seed):
        found = original(rig, trials, seed)
        sets = found.models
        sets.fitted_set(("cogging",))
        return replace(found, state=replace(found.state, found=found.state.search.result(("cogging",))))

    monkeypatch.setattr(by_effort, "searched", too_much)
    found = fp.diagnose(arm(tmp_path))
    assert found.verdict == "adequate"
    assert "cogging is named by effort, not by motion; it is not in the answer" in found.warnings


def test_values_of_inverse_dynamics_answer_where_the_likelihood_tells_little(tmp_path, monkeypatch):
    """A swing-up that rests for most of the time.

    Efforts name dry friction and an offset. Their values predict better in motion and in effort, on the fitted trials.
    They are not asked where the likelihood of held-out data refutes one of the two.
    """
    drawn = draw_swing_up(("coulomb_friction", "effort_offset"), 65220028, tmp_path)
    shown, _ = withheld(fp.read_study(drawn.study))
    usual, asked = ValuesOfInverseDynamics.state, []
    monkeypatch.setattr(ValuesOfInverseDynamics, "state", lambda own, first: asked.append(first) or usual(own, first))
    found = fp.diagnose(shown)
    assert {c.name for c in found.causes} == {"coulomb_friction", "effort_offset"}
    assert "effort_offset is named by effort, not by motion" in found.warnings
    for name in ("coulomb_friction.torque_nm", "effort_offset.offset"):
        low, high = found.extended.interval(name)
        assert low <= drawn.truth[name.partition(".")[0]] <= high
    monkeypatch.setattr(RigWeighed, "evidence", {"effort_offset": Evidence(-73.0, 0.0)})
    assert usual(ValuesOfInverseDynamics(), asked[0]) is None


def test_a_set_has_the_values_of_inverse_dynamics_where_they_predict_the_motion_better(tmp_path):
    """Friction by bristles takes up a way to begin, which the model of the library has not, in a trial mostly at rest.

    The likelihood takes that for process noise. Its own values stay those under which faults of the log are tested.
    """
    drawn = draw_swing_up(("coulomb_friction", "effort_offset"), 70020118, tmp_path)
    shown, unseen = withheld(fp.read_study(drawn.study))
    found = fp.diagnose(shown)
    assert {c.name for c in found.causes} == {"coulomb_friction", "effort_offset"}
    assert "least squares of the low-passed effort predicts better" in str(found.why.steps[-1])
    assert found.why.estimator.endswith("values by least squares of the low-passed effort")
    assert all(one.shortfall > -1e-6 for many in found.ranking.values() for one in many)
    by_motion = Model(found.model.rig, found.model.effects).with_parameters(found.likeliest.values)
    both = [errors_against(shown, SimpleNamespace(model=one), unseen) for one in (found.model, by_motion)]
    own, theirs = (one["0.3 s, unseen"][0] for one in both)
    assert 10.0 * own < theirs
    for name, truth in (("coulomb_friction.torque_nm", "coulomb_friction"), ("effort_offset.offset", "effort_offset")):
        assert found.extended.values[name] == pytest.approx(drawn.truth[truth], rel=0.15)
        assert abs(found.likeliest.values[name] / drawn.truth[truth] - 1.0) > 0.2
        low, high = found.extended.interval(name)
        assert low <= drawn.truth[truth] <= high


@pytest.mark.parametrize(
    "by_motion", [("coulomb_friction", "effort_offset"), ("base_tilt",), ("effort_offset", "cogging")]
)
def test_values_of_inverse_dynamics_replace_no_cause(by_motion):
    """They add to the causes of the likelihood, or are not asked."""
    models = SimpleNamespace(by_effort=SimpleNamespace(names=("coulomb_friction", "effort_offset")))
    first = SimpleNamespace(search=SimpleNamespace(models=models, was_stopped=False), names=frozenset(by_motion))
    assert ValuesOfInverseDynamics().state(first) is None


def test_values_of_inverse_dynamics_name_no_effort_of_a_subject(tmp_path):
    """A subject holds an effort that wanders: a tilt lessens every error, and explains no more than a hold."""
    item = next(Voluntary().plan(650411))
    study, _ = Voluntary().make(item, tmp_path)
    found = fp.diagnose(study)
    assert not item.hidden and not found.causes
    assert found.verdict == "unexplained" and "voluntary effort is likely" in found.reason


def test_two_sets_are_compared_by_their_own_fits_without_each_fold(tmp_path):
    """Folds choose friction again in either case: what they choose says nothing of the set that lacks it."""
    right, wrong = ("coulomb_friction",), ("effort_offset",)
    shown = arm(tmp_path, friction=0.1)
    models = LikelihoodModels(nominal_model(shown), shown.trials, [CoulombFriction, EffortOffset])
    models.nominal()
    models.extend(())
    search = LikelihoodSearch(models, lambda share, words: None)
    verdict, error = RigVerdict(search, ()), {}
    for names in (right, wrong):
        found = search.result(names)
        state = State(verdict, found, verdict.weigh(found), {}, frozenset(names))
        assert {f.names for f in verdict.chosen(state)} == {right}
        errors = verdict.errors_in(state, verdict.currencies[0], state)
        error[names] = errors.squares.sum() / errors.spread.sum()
    assert error[right] < 0.5 * error[wrong]


def test_a_fit_in_its_best_form_is_asked_for_a_better_one_once(tmp_path, monkeypatch):
    asked, original = [], likelihood_models.refined_form
    monkeypatch.setattr(likelihood_models, "refined_form", lambda *given: asked.append(given) or original(*given))
    shown = arm(tmp_path)
    models = LikelihoodModels(nominal_model(shown), shown.trials, [EffortOffset])
    models.nominal()
    models.extend(())
    (fitted,) = (f for names, f in models.fits.items() if names)
    assert [models.better_form(fitted) for _ in range(3)] == [None] * 3
    assert len(asked) == 1


def test_a_thorough_search_has_no_set_to_begin_with(tmp_path, monkeypatch):
    """It finds the same on an arm; the set of inverse dynamics is fitted for the comparison alone."""
    begun = []
    original = by_effort.begun_by_effort

    def noted(models, trials, thorough=False):
        policy = original(models, trials, thorough)
        begun.append((models.proposed, policy.fitted_first))
        return policy

    monkeypatch.setattr("fes_pin.diagnosis.diagnosis.begun_by_effort", noted)
    found = fp.diagnose(arm(tmp_path, friction=0.1), thorough=True)
    assert [c.name for c in found.causes] == ["coulomb_friction"]
    low, high = found.causes[0].parameters["torque_nm"].interval
    assert low < 0.1 < high
    assert begun and all(one == (None, None) for one in begun)


def test_the_search_that_begins_there_fits_few_sets_and_the_nominal_model_once(tmp_path, monkeypatch):
    """The candidates of largest score are fitted, instead of all: the set itself is a proposal.

    Those of less than a sixteenth of the largest score are not.
    """
    once, begun = [], []
    nominal, begin = likelihood_fits.with_new_noise, LikelihoodFits.begin

    def fitted(*asked):
        once.append(asked)
        return nominal(*asked)

    def noted(sets, base, starts):
        begun.append((base.names, len(starts)))
        return begin(sets, base, starts)

    monkeypatch.setattr(likelihood_fits, "with_new_noise", fitted)
    monkeypatch.setattr(LikelihoodFits, "begin", noted)
    found = fp.diagnose(arm(tmp_path, friction=0.1, drag=0.05))
    assert {c.name for c in found.causes} == {"coulomb_friction", "quadratic_damping"}
    assert len(once) == 1
    assert max(count for _, count in begun) < FITTED


@pytest.mark.parametrize(
    ("near", "seconds", "efforts", "horizons"),
    [
        (0.3, 5.0, True, (0.3, 1.0)),
        (0.3, 0.8, True, (0.3,)),
        (0.3, 5.0, False, (0.3,)),
        (2.0, 5.0, True, (2.0,)),
        (None, 5.0, True, (None,)),
    ],
)
def test_a_joint_with_efforts_is_judged_a_second_ahead_too(near, seconds, efforts, horizons):
    """Where its trials are that long, and its own horizon is shorter."""
    models = SimpleNamespace(judged_s=near, by_effort=object() if efforts else None)
    models.trials = [SimpleNamespace(duration=seconds), SimpleNamespace(duration=9.0)]
    verdict = SimpleNamespace(models=models)
    assert tuple(RigVerdict.ahead.fget(verdict).values()) == horizons


def test_a_joint_without_efforts_has_one_estimator(tmp_path):
    time = np.arange(500) * 0.01
    swing = fp.Trial("a", "motion", {"position": 0.5 * np.exp(-0.2 * time) * np.cos(3.8 * time)}, time)
    models = type("Models", (), {"by_effort": None, "refusal": ""})
    first = type("State", (), {"search": type("Search", (), {"models": models})})
    assert named_by_one(first, first) == []
    assert not by_effort.has_efforts(arm(tmp_path), [swing])


@pytest.mark.parametrize("problem", [InputError("not above the noise"), np.linalg.LinAlgError("singular")])
def test_why_efforts_name_no_cause_is_said(tmp_path, monkeypatch, problem):
    """The likelihood searches alone, and all of its library."""

    def raises(*_):
        raise problem

    monkeypatch.setattr(by_effort, "searched", raises)
    found = fp.diagnose(arm(tmp_path, friction=0.1))
    assert [c.name for c in found.causes] == ["coulomb_friction"]
    assert f"efforts name no cause: {problem}" in found.warnings


def test_an_inertia_that_moves_between_bands_is_no_answer(tmp_path, monkeypatch):
    monkeypatch.setattr(search, "_moves", lambda final, fitted, others: True)
    found = fp.diagnose(arm(tmp_path, friction=0.1))
    assert f"efforts name no cause: {search.NOT_CARRIED}" in found.warnings
    assert [c.name for c in found.causes] == ["coulomb_friction"]
