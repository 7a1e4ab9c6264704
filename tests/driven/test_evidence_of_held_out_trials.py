"""What trials held out say of the causes of a driven rig, and what a cause that they refuse says of the rig."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from driven_rigs.draw import draw
from driven_rigs.laboratory import draw_laboratory
from harness.generators import generator_of
from harness.never_worse import withheld
from scipy.signal import lfilter

from fes_pin.data.study import read_study
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.diagnosis.errors_ahead import Ahead, RandomPart, are_large
from fes_pin.diagnosis.rejected import with_rejected_causes
from fes_pin.diagnosis.verdict import RigVerdict
from fes_pin.infer.result import Evidence, Gain, Remainder
from fes_pin.infer.verdict import Rejected, State, Weighed

NOTHING = Remainder(False, 0.5, None)
LITTLE = (RandomPart("effort", 0.1, 0.1, 0.01),)


class Judged(RigVerdict):
    """A verdict with given errors of free simulation, percent, of the nominal model and of what folds choose."""

    held_out = 1.0, 0.5

    def weigh(self, found):
        return Weighed({}, {}, NOTHING)

    def errors(self, state):
        return [tuple(Ahead(e, e, e) for e in (1.0, 0.1)), tuple(Ahead(e, e, e) for e in self.held_out)]


def unsupported(evidence, low, random, held_out=Judged.held_out):
    """What is refused of a friction with the low end of its gain."""
    sets = SimpleNamespace(is_claimed=lambda name: True)
    models = SimpleNamespace(judged_s=None, library=SimpleNamespace(effects=()), refitted=None)
    verdict = Judged(SimpleNamespace(models=models), ())
    verdict.held_out = held_out
    gains = {"coulomb_friction": Gain(low + 1.0, low, low + 2.0)}
    fit = SimpleNamespace(sse=0.0)
    found = SimpleNamespace(
        without=dict.fromkeys(gains, fit), p_values=dict.fromkeys(gains, 0.0), nominal=fit, best=fit
    )
    verdict.search = SimpleNamespace(result=lambda names: SimpleNamespace(without={}), sets=sets)
    known = {"gains": gains, "evidence": evidence, "lack_of_fit": NOTHING, "is_random": are_large(random)}
    own = {"over_unrepeated": {}, "folds": (None,), "random": random, "no_noise": None, "voluntary": None}
    weighed = SimpleNamespace(**known, **own, is_robust=False)
    state = State(verdict, found, weighed, {}, frozenset(gains))
    claims = verdict.drop_errors_of_form, verdict.drop_unsupported, verdict.drop_that_predict_no_better
    return [claim.__name__ for claim in claims if claim(state) is not None]


@pytest.mark.parametrize(
    ("p_value", "share", "percent", "unexplained"),
    [(1e-9, 0.3, 5.0, True), (1e-9, 0.02, 5.0, False), (1e-3, 0.3, 5.0, False), (1e-9, 0.3, -1.0, False)],
    ids=["certain", "another's error of form", "not certain", "nothing over the horizon"],
)
def test_a_refused_cause_is_something_where_it_is_certain_and_no_error_of_form(p_value, share, percent, unexplained):
    refused = Rejected(p_value, share, Gain(percent, percent, percent))
    left = with_rejected_causes(NOTHING, LITTLE, {"sensor_lag": refused}, {"sensor_lag": "sensor"})
    assert left.unexplained == unexplained
    assert left.where == ("sensor" if unexplained else None)


def test_a_large_random_effort_is_something_whatever_was_refused():
    left = with_rejected_causes(NOTHING, (RandomPart("effort", 1.0, 0.1, 0.4),), {}, {})
    assert left.unexplained and left.where == "effort"


@pytest.mark.parametrize(("low", "refused"), [(2.0, True), (5.9, True), (6.5, False)])
def test_beside_what_no_cause_explains_a_cause_is_more_than_an_error_of_form(low, refused):
    """A torque of 3 % was named dry friction where positions had been stored in degrees, and a frame that swings where
    the effort had been stuck."""
    large = (RandomPart("effort", 1.0, 1.1, 0.32),)
    evidence = {"coulomb_friction": Evidence(500.0, 500.0)}
    assert (unsupported(evidence, low, large) != []) is refused
    assert unsupported(evidence, low, LITTLE) == []


@pytest.mark.parametrize(("extended", "refused"), [(0.9, False), (1.0, True), (1.2, True)])
def test_beside_a_lack_of_fit_the_sets_that_folds_choose_predict_better(extended, refused):
    """A stop of a gain of 23 % was named for a detent: with the choice of each fold its error had grown."""
    evidence, large = {"coulomb_friction": Evidence(500.0, 500.0)}, (RandomPart("effort", 1.0, 1.1, 0.32),)
    assert (unsupported(evidence, 20.0, large, (1.0, extended)) != []) is refused
    assert unsupported(evidence, 20.0, LITTLE, (1.0, extended)) == []


def test_one_trial_unlike_the_others_silences_no_cause(tmp_path):
    """Another torque acts in it: learned without it, what is random made it too unlikely for the offset to show."""
    study = read_study(draw(("coulomb_friction", "effort_offset"), 0.3, 33, tmp_path, recorded=True).study)
    first, *others = study.trials
    lasts = np.exp(-first.dt / 0.02)
    torque = lfilter([np.sqrt(1.0 - lasts**2)], [1.0, -lasts], np.random.default_rng(0).normal(size=len(first)))
    unlike = first.with_columns(effort=first["effort"] + 0.1 * np.std(first["effort"]) * torque)
    found = diagnose_joint(replace(study, trials=(unlike, *others)))
    assert {c.name for c in found.causes} == {"coulomb_friction", "effort_offset"}, str(found)
    assert all(c.evidence.low > 0.0 for c in found.causes)


def test_a_stop_that_one_of_two_trials_reaches_is_named(tmp_path):
    """Errors of a model without it are those of what is random in the other trial, which has no stop to follow."""
    found = diagnose_joint(read_study(draw_laboratory(("joint_stop",), 1601016, tmp_path).study))
    assert [c.name for c in found.causes] == ["joint_stop"], str(found)
    assert not found.remainder.unexplained


def test_free_motion_refutes_no_cause_of_a_rig_that_falls_by_itself(tmp_path):
    """A pendulum about its unstable rest: a free simulation falls to either side, whichever model is right."""
    item = next(one for one in generator_of("driven").plan(73020000) if one.key == "plain-73020056")
    shown, _ = withheld(generator_of("driven").make(item, tmp_path)[0])
    found = diagnose_joint(shown)
    assert item.hidden == ("coulomb_friction", "parallel_stiffness") and found.is_falling
    friction, other = found.causes
    assert friction.name == "coulomb_friction"
    assert "parallel_stiffness" in {other.name, *other.equivalents}
