# ruff: noqa: E501  (tables, one case a line)
"""What is said of a study before anything is fitted."""

import functools
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from diagnosis.hidden import slide
from diagnosis.hidden import study_of as made

from fes_pin.data.errors import InputError
from fes_pin.data.plausibility import ToPredict
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import UNCHECKED, diagnose_joint
from fes_pin.diagnosis.testable import given_away
from fes_pin.models.nominal import nominal_model
from fes_pin.prepare.measured import check_study
from fes_pin.verdict.ask import check
from fes_pin.view.report import report_html
from fes_pin.workers import OutOfTime, time_limit

OUTPUTS = ("angle_rad", "force_n", "position", "velocity")
INPUTS = ("pulse_width_us", "stim", "effort")


@functools.cache
def study_of(rig):
    return made(rig)


def changed(study, names, change, only=None):
    """The study with some columns changed, in all trials or one."""
    trials = [
        t.with_columns(**{n: change(t[n]) for n in names if n in t}) if only is None or k == only else t
        for k, t in enumerate(study.trials)
    ]
    return replace(study, trials=tuple(trials))


def timed(study, factor):
    return replace(study, trials=tuple(replace(t, time=factor * t.time) for t in study.trials))


def loaded(study, change):
    """The study with other loads."""
    trials = [
        replace(t, conditions={n: change(v) if n == "load_kg" else v for n, v in t.conditions.items()})
        for t in study.trials
    ]
    return replace(study, trials=tuple(trials))


def shifted(study, by=100):
    """The study with one trial whose readings come later than those of the others."""
    late = lambda y: np.concatenate([y[:by][::-1], y[:-by]])  # noqa: E731
    return changed(study, OUTPUTS, late, 2)


def said(study):
    return check_study(study, nominal_model(study))


def dropout(values):
    out = values.copy()
    out[300:400] = out[300]
    return out


def coarse(values):
    """As an encoder of 0.01 rad reads it: equal neighbours are common then."""
    return 0.01 * np.rint(values / 0.01)


def to_and_fro(values):
    """As an encoder reads what moves by less than one of its counts, five samples here and five there."""
    return 0.01 * (np.arange(len(values)) // 5 % 2)


def free(position):
    """Joint studies that nobody drives, with these positions over time."""
    study = made("joint", driven=False)
    trials = [
        replace(t.without("velocity") if "velocity" in t else t, columns={"position": position(t.time)})
        for t in study.trials
    ]
    return replace(study, trials=tuple(trials))


REFUSED = {  # rig, what was done, words
    "never_stimulated": ("ankle", lambda s: changed(s, INPUTS, np.zeros_like), "never above the threshold of 180 us in all"),
    "faint": ("muscle", lambda s: changed(s, INPUTS, lambda u: 0.1 * u), "never above the threshold"),
    "constant": ("joint", lambda s: changed(s, OUTPUTS, lambda y: 0.0 * y + 1.0), "no output changes in any trial"),
    "hunting": ("joint", lambda s: changed(s, OUTPUTS, to_and_fro), "only goes to and fro between two counts"),
    "degrees": ("ankle", lambda s: changed(s, ("angle_rad",), np.degrees), "is it in degrees"),
    "pulse_widths_in_ms": ("ankle", lambda s: changed(s, INPUTS, lambda u: 1e-3 * u), "is it in ms"),
    "pulse_widths_in_ms_of_one_trial": ("ankle", lambda s: changed(s, INPUTS, lambda u: 1e-3 * u, 1), "is it in ms"),
    "milliseconds": ("ankle", lambda s: timed(s, 1e3), "is time_s in ms"),
    "milliseconds_of_a_swing": ("joint", lambda s: timed(s, 1e3), "is time_s in ms"),
    "pulse_widths_in_s": ("ankle", lambda s: changed(s, INPUTS, lambda u: 1e-6 * u), "is it in s"),
    "grams": ("ankle", lambda s: loaded(s, lambda load: 1e3 * load), "is it in g"),
    "few_rows": ("muscle", lambda s: replace(s, trials=tuple(t.first(3) for t in s.trials)), "at least 20 samples"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_no_verdict_could_follow_from_it(case):
    rig, change, words = REFUSED[case]
    with pytest.raises(InputError, match=words) as caught:
        diagnose_joint(change(study_of(rig)))
    assert len(str(caught.value).splitlines()) == 1


WARNED = {
    "one_without_stimulus": ("muscle", lambda s: changed(s, INPUTS, np.zeros_like, 2), "threshold of 180 us in trial 02"),
    "one_constant": ("ankle", lambda s: changed(s, OUTPUTS, lambda y: 0.0 * y + 1.0, 1), "does not change at all in trial 01"),
    "clipped": ("joint", lambda s: changed(s, OUTPUTS, lambda y: np.minimum(y, np.quantile(y, 0.8))), "(clipping?)"),
    "dropout": ("ankle", lambda s: changed(s, OUTPUTS, dropout, 0), "for 100 samples from 1.5 s on in trial 00"),
    "dropout_of_a_coarse_encoder": ("joint", lambda s: changed(s, OUTPUTS, lambda y: coarse(dropout(y)), 0), "and then jumps in trial 00: a dropout, its last value held?"),
    "counts": ("muscle", lambda s: changed(s, OUTPUTS, lambda y: np.rint(20.0 * y)), "are they an encoder's counts?"),
    "one_faint": ("ankle", lambda s: changed(s, INPUTS, lambda u: 0.1 * u, 1), "threshold of 180 us in trial 01"),
    "held": ("muscle", lambda s: changed(s, OUTPUTS, lambda y: np.repeat(y[::4], 4), 0), "changes only every 4 samples"),
    "force_in_mN": ("muscle", lambda s: changed(s, OUTPUTS, lambda y: 1e3 * y), "is it in mN"),
    "swing_in_degrees": ("joint", lambda s: changed(s, OUTPUTS, np.degrees), "is it in degrees"),
    "minutes": ("ankle", lambda s: timed(s, 1 / 600), "is time_s in another unit"),
    "not_driven": ("joint", lambda s: changed(s, INPUTS, np.zeros_like), "no trial is driven: effort is zero throughout"),
    "heavy": ("ankle", lambda s: loaded(s, lambda _: 150.0), "load_kg is above 100 kg"),
    "force_turned_round": ("muscle", lambda s: changed(s, OUTPUTS, np.negative), "force_n falls where it should rise in 5 trials"),
    "one_force_turned_round": ("ankle", lambda s: changed(s, ("force_n",), np.negative, 4), "force_n falls where it should rise in trial 04"),
    "angle_turned_round": ("ankle", lambda s: changed(s, ("angle_rad",), np.negative), "angle_rad falls where it should rise in"),
}  # fmt: skip


@pytest.mark.parametrize("case", WARNED)
def test_a_warning_says_what_is_odd(case):
    rig, change, words = WARNED[case]
    (found,) = said(change(study_of(rig)))
    assert words in found


@pytest.mark.parametrize("grows", [0.005, -0.005])
def test_a_reading_that_slows_down_before_it_stays_is_neither_clipped_nor_held(grows):
    """An encoder of 1 mrad at 1 kHz, whose joint sticks for 0.1 s where it turns first, as far out as ever or not."""
    time = np.arange(0.0, 8.0, 1e-3)
    phase = 2.0 * np.pi * (0.15 * time + 0.2 * time**2)
    first = np.argmax(phase > 0.5 * np.pi)
    phase = np.concatenate([phase[:first], np.full(100, 0.5 * np.pi), phase[first:-100]])
    swing = 3.0 * np.sin(phase) * (1.0 + grows * np.maximum(phase - 0.5 * np.pi, 0.0))

    def odd(position):
        columns = {"position": np.round(position / 1e-3) * 1e-3, "effort": np.sin(time)}
        found = said(replace(study_of("joint"), trials=(Trial("a", "motion", columns, time),)))
        return [one for one in found if "clipping" in one or "stays at" in one]

    assert odd(swing) == []
    assert len(odd(np.minimum(swing, 1.5))) == 1
    assert len(odd(np.where((time > 4.2) & (time < 4.26), 0.1234, swing))) == 1


def test_what_no_pendulum_does_by_itself():
    rng = np.random.default_rng(0)
    noise = lambda t: 1e-3 * rng.standard_normal(len(t))  # noqa: E731
    swing = free(lambda t: 20.0 * np.exp(-0.1 * t) * np.cos(6.0 * t) + noise(t))
    assert "position swings back by more than a turn, and nothing drives it, in trial 00: is it in degrees?" in said(
        swing
    )
    settled = free(lambda t: 1.2 + 0.5 * np.exp(-3.0 * t) * np.cos(6.0 * t) + noise(t))
    (words,) = (one for one in said(settled) if "comes to rest" in one)
    assert (
        "at 1.2 rad, and by the URDF it hangs at 0.3672, in" in words
        and "(zero in [columns], 47.7 of degrees)" in words
    )
    fine = free(lambda t: 0.5 * np.exp(-3.0 * t) * np.cos(6.0 * t) + noise(t))
    assert len(said(fine)) == 1  # that it is not driven


def test_all_trials_that_rest_elsewhere_are_named_with_where():
    settled = free(lambda t: 1.2 + 0.5 * np.exp(-3.0 * t) * np.cos(6.0 * t))
    lower = changed(settled, ("position",), lambda y: y - 0.1, 1)
    (words,) = (one for one in said(lower) if "comes to rest" in one)
    assert "at 1.1 to 1.2 rad, and by the URDF it hangs at" in words
    assert f"in {len(lower.trials)} trials ({lower.trials[0].name} to {lower.trials[-1].name})" in words


def test_a_force_before_the_first_pulse_is_said():
    lead, random = 40, np.random.default_rng(0)
    later = lambda y: np.concatenate([np.zeros(lead), y[:-lead]])  # noqa: E731
    study = changed(study_of("muscle"), INPUTS, later)
    noise = 1e-3 * max(float(t["force_n"].max()) for t in study.trials) * random.standard_normal(lead)
    study = changed(study, ("force_n",), lambda y: np.concatenate([noise, y[:-lead]]))
    assert said(study) == []
    rest = 0.1 * max(float(t["force_n"].max()) for t in study.trials)
    for only, where in ((None, f"{len(study.trials)} trials (00 to 04)"), (2, "trial 02")):
        (words,) = said(changed(study, ("force_n",), lambda y: y + rest, only))
        value, ending = re.fullmatch(r"the force is ([\d.]+)(?: to [\d.]+)? N before any pulse in (.*)", words).groups()
        assert float(value) == pytest.approx(rest, rel=0.01) and ending == where


@pytest.mark.parametrize("held", [0.0, 0.05, 0.5, -0.5])
def test_an_effort_that_neither_gravity_nor_friction_asks_for_is_said(held):
    """Dry friction of 0.1 N m holds 0.05 N m; it does not hold five times as much."""
    study = study_of("joint")
    c, random = nominal_model(study).rig.constants, np.random.default_rng(0)
    time = np.arange(0.0, 10.0, 0.01)
    q = 0.3 + np.where(time > 2.0, 0.4 * np.sin(2.0 * (time - 2.0)), 0.0)
    v = np.gradient(q, time)
    effort = c["inertia"] * np.gradient(v, time) + c["gravity_cos"] * np.cos(q) + c["gravity_sin"] * np.sin(q)
    effort += held + 0.1 * np.sign(v) + 1e-3 * random.standard_normal(len(time))
    turned = Trial(
        "turned", "imposed", {"position": q + 1e-4 * random.standard_normal(len(time)), "effort": effort}, time
    )
    words = [one for one in said(replace(study, trials=(turned,))) if "before anything moves" in one]
    expected = f"the effort differs from gravity's by {held:g} before anything moves (another zero of its sensor?) in"
    expected += " trial turned"
    assert words == [expected] * (abs(held) > 0.2)


def test_slides():
    study = slide(1, {})
    assert said(study) == []
    assert "is it in mm" in said(changed(study, ("position", "velocity"), lambda y: 1e3 * y))[0]
    assert "velocity is not the slope" in said(changed(study, ("velocity",), np.degrees))[0]
    assert "velocity has the other sign than the slope" in said(changed(study, ("velocity",), np.negative))[0]
    assert said(slide(1, {}, driven=False)) == [
        "no trial is driven: there is no column effort, and the motion is taken for free"
    ]


@pytest.mark.parametrize("rig", ["ankle", "joint", "muscle"])
def test_nothing_is_said_of_what_is_right(rig):
    assert said(study_of(rig)) == []
    assert said(made(rig, noise="process" if rig != "muscle" else "ar1", seed=1)) == []


def test_a_warning_stands_in_all_that_is_written():
    study = changed(study_of("muscle"), INPUTS, np.zeros_like, 2)
    diagnosis = diagnose_joint(study)
    words = "pulse_width_us is never above the threshold of 180 us in trial 02"
    assert words in diagnosis.warnings
    assert diagnosis.record()["warnings"] == list(diagnosis.warnings)
    assert f"warning: {words}" in str(diagnosis)
    assert words in report_html(diagnosis)


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_of_a_study_is_refused_of_trials_to_predict(case):
    """But for what only a fit needs: a number of samples, outputs that change, a muscle that is stimulated."""
    rig, change, words = REFUSED[case]

    def predicted():
        study = change(study_of(rig))
        return check_study(ToPredict(study.trials, study.schema, study.constants), nominal_model(study))

    if case in ("never_stimulated", "faint", "constant", "hunting", "few_rows"):
        predicted()
    else:
        with pytest.raises(InputError, match=words):
            predicted()


def test_trials_to_predict_need_no_outputs():
    study = study_of("ankle")
    bare = tuple(t.without(*(n for n in OUTPUTS if n in t)) for t in study.trials)
    assert check_study(ToPredict(bare, study.schema, study.constants), nominal_model(study)) == []
    still = tuple(t.with_columns(pulse_width_us=0.0 * t.time) for t in bare)
    (words,) = check_study(ToPredict(still, study.schema, study.constants), nominal_model(study))
    assert "nothing is stimulated" in words


def test_a_fitted_time_constant_that_is_short_is_no_slip_of_units():
    study = study_of("muscle")
    model = nominal_model(study).with_parameters({"time_constant_s": 1e-4})
    with pytest.raises(InputError, match="is time_s in ms"):
        check_study(study, model)
    (words,) = check_study(ToPredict(study.trials, study.schema, study.constants), model)
    assert "what happens between samples is lost" in words


def test_a_check_and_a_diagnosis_warn_of_the_same():
    """Also of what a fit gives away; of how few trials there are a diagnosis warns where it names causes."""
    study = replace(study_of("muscle"), trials=study_of("muscle").trials[:4])
    study = shifted(study)
    found, diagnosis = check(study), diagnose_joint(study)
    (odd,) = found.odd
    assert "trial 02 answers" in odd and "is it shifted in time?" in odd
    (few,) = found.limits
    assert few == "the names rest on 4 trials, fewer than 5: more may change them"
    assert diagnosis.warnings[0] == odd


def test_a_check_is_written_as_text_and_for_json():
    study = changed(study_of("muscle"), INPUTS, np.zeros_like, 2)
    found = check(study)
    told = json.loads(json.dumps(found.as_dict()))
    assert told["odd"] == list(found.odd) and told["limits"] == list(found.limits)
    assert "fatigue" in told["shown"] and all(0.0 < share <= 1.0 for share in told["shown"].values())
    for line in (
        *(f"odd: {one}" for one in found.odd),
        *found.limits,
        f"these trials can show {len(told['shown'])} causes",
    ):
        assert line in str(found)


def test_a_limit_of_time_ends_what_a_fit_gives_away():
    study = shifted(replace(study_of("muscle"), trials=study_of("muscle").trials[:4]))
    assert len(given_away(study)) == 1
    with time_limit(-1.0):
        assert given_away(study) == []
    assert not any("answers" in words for words in diagnose_joint(study, limit=0.0).warnings)


def test_a_check_that_a_limit_of_time_ended_is_said():
    study = shifted(replace(study_of("muscle"), trials=study_of("muscle").trials[:4]))
    assert UNCHECKED in diagnose_joint(study, limit=0.0).warnings
    whole = diagnose_joint(study, limit=1e3).warnings
    assert UNCHECKED not in whole and any("is it shifted in time?" in words for words in whole)


def test_what_was_found_before_a_limit_of_time_stays(monkeypatch):
    """Efforts of the opposite sign were found, then the time ended: nothing was said."""
    study = study_of("joint")
    turned = tuple(t.with_columns(effort=-t["effort"]) for t in study.trials)

    def out_of_time(*_):
        raise OutOfTime

    monkeypatch.setattr("fes_pin.diagnosis.testable._shifted", out_of_time)
    (found,) = given_away(replace(study, trials=turned))
    assert "with the opposite sign of the effort" in found
