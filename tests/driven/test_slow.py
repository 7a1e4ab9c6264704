"""A slow cause, which a filter follows and foretells for as long as a random effort lasts in its place."""

from types import SimpleNamespace

import pytest
from driven_rigs import laboratory
from driven_rigs.no_form import draw_no_form

import fes_pin as fp
from fes_pin.diagnosis import held_out
from fes_pin.infer.result import Gain

SHORT, LONG = 0.3, 1.16


@pytest.mark.parametrize(
    ("short", "long", "correlation_s", "ahead_s"),
    [(-1.0, 17.0, LONG, LONG), (-1.0, 17.0, 0.2, None), (-1.0, -2.0, LONG, None), (5.0, 17.0, LONG, None)],
    ids=["a spring", "a random effort as short as the horizon", "nothing at either", "at once"],
)
def test_a_cause_may_show_as_far_ahead_as_what_stands_for_it_lasts(short, long, correlation_s, ahead_s, monkeypatch):
    """Without a spring 0.3 s of a slow slide were foretold as well as with it, and it had been refused."""

    def gains_over(_folds, names, horizon_s, _seed):
        low = short if horizon_s == SHORT else long
        return dict.fromkeys(names, Gain(low + 1.0, low, low + 2.0))

    monkeypatch.setattr(held_out, "_gains_over", gains_over)
    without = SimpleNamespace(noise=SimpleNamespace(time={"effort": correlation_s}))
    found = SimpleNamespace(without={"parallel_stiffness": without})
    folds = [SimpleNamespace(test=[SimpleNamespace(duration=11.0)])]
    gain = held_out.gains_of(folds, found.without, SHORT, seed=0)["parallel_stiffness"]
    assert gain.ahead_s == ahead_s
    assert gain.low == (short if ahead_s is None else long)


def test_a_gain_says_how_far_ahead_it_looked():
    assert str(Gain(28.3, 17.2, 43.6)) == "28 % [17, 44]"
    assert str(Gain(28.3, 17.2, 43.6, 1.158)) == "28 % [17, 44], 1.2 s ahead"


def test_an_effort_that_wanders_is_no_spring_that_relaxes(tmp_path, monkeypatch):
    """It changes too seldom for one trial to tell it from an offset; six trials tell."""
    monkeypatch.setattr(laboratory, "LONGEST_S", 40.0)
    found = fp.diagnose(fp.read_study(draw_no_form(("wander",), 920, tmp_path).study))
    assert {c.name for c in found.causes} <= {"zero_by_trial"}
    (effort,) = found.random
    assert effort.time_constant_s > 0.2 * found.study.trials[0].duration
    assert found.why.estimator == "likelihood with slow process noise"
