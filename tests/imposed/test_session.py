"""What tires in one trial is tired in the next: causes whose state runs on through a session."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from imposed_rigs.motion import drawn, wandering
from scipy.integrate import solve_ivp

from fes_pin.data.errors import InputError
from fes_pin.data.study import Study, read_study, write_study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.models.effects import Fatigue, Potentiation
from fes_pin.models.nominal import nominal_model
from fes_pin.models.session import PAST, past_of, session_of
from fes_pin.models.simulate import simulate
from fes_pin.models.store import load_model, save_model

DT, FORCE_N, TAU = 0.005, 20.0, 0.05
KNOWN = {"threshold_us": 100.0, "saturation_us": 500.0}
PAUSES = (0.0, 2.0, 6.0, 1.0, 12.0, 3.0, 1.5, 20.0, 2.0, 4.0)


def session(cause, kind, seed=0, size=0.3, told=True):
    """Ten trials of 2 s with pauses between; the hidden state is integrated through all of it by scipy.

    Both forms differ from the engine's: strength is lost in proportion to the square of what is made of it and comes
    back from a store; potentiation saturates.
    """
    rng = np.random.default_rng(seed)
    span, lost = 2.0, 0.0
    starts = np.cumsum(PAUSES) + span * np.arange(len(PAUSES))
    time, trials, state = np.arange(round(span / DT)) * DT, [], np.zeros(2)
    for k, begin in enumerate(starts):
        if k:
            state = _run(np.array([0.0, PAUSES[k]]), np.zeros(2), np.r_[0.0, state[1]], cause, size)[:, -1]
        width = np.where((time > 0.2) & (time % 1.0 < rng.uniform(0.4, 0.8)), rng.uniform(350.0, 480.0), 0.0)
        states = _run(time, np.clip((width - 100.0) / 400.0, 0.0, 1.0), np.r_[0.0, state[1]], cause, size)
        state = states[:, -1]
        act, lost = states
        share = {"fatigue": 1.0 - lost, "potentiation": 1.0 + size * np.tanh(2.0 * lost), "": 1.0}[cause]
        force = FORCE_N * act * share + wandering(len(time), DT, 0.03, 0.2, rng) + 0.05 * rng.standard_normal(len(time))
        columns = {"pulse_width_us": width, "force_n": force}
        if kind == "imposed":
            motion = drawn(0.05, 1e-3, 0.5, 2.0, rng)
            columns["length_m"] = motion.at(time) + 1e-6 * rng.standard_normal(len(time))
        trials.append(Trial(f"{k:02d}", kind, columns, time, {"start_s": float(begin)} if told else {}))
    return Study("session", "muscle", KNOWN, {"gain": 15.0, "time_constant_s": 0.06}, tuple(trials))


def _run(time, drive, state, cause, size):
    out = np.empty((2, len(time)))
    out[:, 0] = state
    edges = np.unique(np.r_[0, np.flatnonzero(np.diff(drive)) + 1, len(time) - 1])

    def rates(t, x, r):
        act = max(x[0], 0.0)
        memory = {
            "fatigue": 0.3 * size * act**2 * (0.8 - x[1]) - 0.02 * x[1] ** 0.9 if x[1] > 0 else 0.3 * size * act**2,
            "potentiation": (act - x[1]) / 8.0,
            "": 0.0,
        }[cause]
        return [(r - x[0]) / TAU, memory]

    for a, b in itertools.pairwise(edges):
        run = solve_ivp(rates, (time[a], time[b]), out[:, a], "LSODA", time[a : b + 1], args=(drive[a],), rtol=1e-7)
        out[:, a : b + 1] = run.y
    return out


@pytest.mark.parametrize(("cause", "kind"), [("fatigue", "isometric"), ("potentiation", "imposed")])
def test_a_cause_that_runs_through_the_session_is_named(tmp_path, cause, kind):
    """And the model foretells a trial from its inputs and its start, read again from the file that it was saved in."""
    write_study(session(cause, kind), tmp_path / "study")
    study = read_study(tmp_path / "study")
    found = diagnose_joint(study)
    assert cause in (found.causes[0].name, *found.causes[0].equivalents)
    assert found.extended_error[1] < 0.5 * found.nominal_error[1]
    save_model(found.model, tmp_path / "model.toml")
    last = study.trials[-1]
    again = simulate(load_model(tmp_path / "model.toml"), last.without("force_n"))
    assert np.array_equal(again["force_n"], simulate(found.model, last)["force_n"])


@pytest.mark.parametrize("kind", ["isometric", "imposed"])
def test_where_nothing_runs_through_the_session_nothing_is_named(kind):
    assert diagnose_joint(session("", kind, seed=1)).verdict == "adequate"


@pytest.mark.parametrize("one", [Fatigue(rate_per_s=0.08, recovery_s=20.0), Potentiation(gain=0.4, decay_s=6.0)])
def test_trials_one_by_one_are_the_session_in_one_piece(one):
    """Cut in ten, a long recording of stimulation and pauses is simulated as it is whole."""
    study = session("", "isometric")
    end = max(t.conditions["start_s"] + t.duration for t in study.trials) + 1.0
    time = np.arange(round(end / DT)) * DT
    width = np.zeros(len(time))
    for t in study.trials:
        first = round(t.conditions["start_s"] / DT)
        width[first : first + len(t)] = t["pulse_width_us"]
    model = nominal_model(study) + one
    whole = simulate(model, Trial("whole", "isometric", {"pulse_width_us": width}, time))["force_n"]
    missed, fresh = [], []
    for t in study.trials:
        first = round(t.conditions["start_s"] / DT)
        piece, settled = whole[first : first + len(t)], slice(60, None)  # force of the trial before has died away
        for out, conditions in ((missed, t.conditions), (fresh, {})):
            out.append(np.abs(simulate(model, replace(t, conditions=conditions))["force_n"] - piece)[settled].max())
    assert max(missed) < 0.01 * whole.max()
    assert max(fresh) > 5.0 * max(missed)


def test_a_trial_that_does_not_say_when_it_began_begins_fresh():
    study = session("", "isometric")
    rig = nominal_model(study).rig
    last = study.trials[-1]
    assert any(past_of(rig.session, last).values())
    assert not any(past_of(rig.session, replace(last, conditions={})).values())
    assert not any(past_of(rig.session, study.trials[0]).values())
    assert set(past_of((), last)) == set(PAST)


def test_trials_that_overlap_are_no_session():
    study = session("", "isometric")
    twice = [*study.trials, replace(study.trials[3], name="again")]
    assert session_of(study.trials, nominal_model(study).rig.recruited)
    assert session_of(twice, nominal_model(study).rig.recruited) == ()


def test_a_session_that_is_no_table_of_numbers_is_refused(tmp_path):
    save_model(nominal_model(session("", "isometric")), tmp_path / "model.toml")
    text = (tmp_path / "model.toml").read_text()
    begin = text.index("session = ")
    (tmp_path / "bad.toml").write_text(text[:begin] + 'session = [[1.0, 0.5, "x"]]\n' + text[text.index("\n[") :])
    with pytest.raises(InputError, match="session: expected rows"):
        load_model(tmp_path / "bad.toml")
