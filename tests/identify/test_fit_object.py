"""A fit says what it knows of its parameters, at bounds too; what it is given is checked, what it holds read-only."""

import copy
import math
import pickle
from dataclasses import replace

import numpy as np
import pandas
import pytest
from identify.rigs import WHITE, as_likely, measured, off, trials_of
from models.cases import RIGS, trial

import fes_pin as fp
from fes_pin.data.trial import Trial
from fes_pin.models.effects import CoulombFriction, SensorOffset
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.search.fit import fit

RISE, RISE_AT_A_BOUND = 3.8414588, 2.7055435
COPIES = [lambda x: x, copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]


def rubbing(torque_nm=0.0, seed=0):
    """A pendulum's trials, and its model with friction beside."""
    model, trials = trials_of("joint", np.random.default_rng(seed))
    started = model + CoulombFriction(torque_nm=0.02)
    rng = np.random.default_rng(seed + 1)
    true = model + CoulombFriction(torque_nm=torque_nm)
    return started, [measured(true, t.without("position"), rng) for t in trials] if torque_nm else trials


@pytest.fixture(scope="module")
def at_its_bound():
    """The first of some seeds whose noise looks like less than no friction."""
    fits = (fit(*rubbing(seed=k), WHITE) for k in range(20))
    return next(f for f in fits if "coulomb_friction.torque_nm" in f.at_bound)


def rises(fitted, name, value):
    held = fit(fitted.model, fitted.trials, fitted.noise, fixed={name: value})
    return held.sse - fitted.sse


def test_friction_that_is_not_there_has_a_one_sided_interval_and_no_deviation(at_its_bound):
    name, fitted = "coulomb_friction.torque_nm", at_its_bound
    low, high = fitted.interval(name)
    assert fitted.values[name] == low == 0.0 < high < 0.01
    assert math.isnan(fitted.std(name))
    assert rises(fitted, name, high) == pytest.approx(RISE_AT_A_BOUND, abs=0.03)
    assert fitted.interval(name, method="profile") == (low, high)
    assert name not in fitted.not_identified()


def test_a_value_at_its_bound_says_so_wherever_it_is_shown(at_its_bound):
    high = f"{at_its_bound.interval('coulomb_friction.torque_nm')[1]:.3g}"
    assert f"(at its bound, 95 % in [0, {high}])" in repr(at_its_bound)
    assert "[0, 0]" not in repr(at_its_bound)
    for shown in (str(at_its_bound), at_its_bound._repr_html_()):
        assert "at its bound" in shown
    row = at_its_bound.to_frame().loc["coulomb_friction.torque_nm"]
    assert row["note"] == "at its bound"
    assert math.isnan(row["std"])
    assert (row["low"], row["high"]) == at_its_bound.interval("coulomb_friction.torque_nm")


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rig", ["ankle", "joint", "muscle"])
def test_an_interval_by_profile_ends_where_the_fit_is_worse_by_its_quantile(rig, seed):
    model, trials = trials_of(rig, np.random.default_rng(seed))
    fitted = fit(off(model), trials, WHITE)
    for name in fitted.free:
        low, high = fitted.interval(name, method="profile")
        assert low < fitted.values[name] < high
        assert rises(fitted, name, low) == pytest.approx(RISE, abs=0.05)
        assert rises(fitted, name, high) == pytest.approx(RISE, abs=0.05)


def test_of_a_linear_parameter_both_intervals_are_one():
    model, trials = trials_of("muscle", np.random.default_rng(3))
    fitted = fit(off(model), trials, WHITE, fixed={"time_constant_s": 0.06})
    assert fitted.interval("gain", method="profile") == pytest.approx(fitted.interval("gain"), rel=1e-4)


@pytest.mark.filterwarnings("ignore:pulse_width_us is never above the threshold:fes_pin.InputWarning")
def test_a_profile_of_what_is_not_identified_reaches_its_bounds():
    model = Model(RIGS["muscle"])
    bare = Trial("rest", "isometric", {"pulse_width_us": np.zeros(300)}, np.arange(300) * 5e-3)
    fitted = fit(model, [measured(model, bare, np.random.default_rng(5))], WHITE)
    info = model.parameter_info()["gain"]
    assert fitted.interval("gain", method="profile") == (info.lower, info.upper)


def test_what_is_fixed_is_not_fitted():
    model, trials = trials_of("joint", np.random.default_rng(2))
    started = off(model)
    for fixed in (("damping",), "damping", ["damping"], iter(("damping",))):
        found = fit(started, trials, WHITE, fixed=fixed)
        assert "damping" not in found.free
        assert found.values["damping"] == started.parameters()["damping"]
    held = fit(started, trials, WHITE, fixed={"damping": 0.05, "gravity_scale": 1})
    assert (held.values["damping"], held.values["gravity_scale"]) == (0.05, 1.0)
    assert held.free == ("inertia_scale",)
    nothing = fit(started, trials, WHITE, fixed=started.fitted_parameters())
    assert nothing.values == started.parameters()


def test_bounds_that_are_asked_for_hold_and_are_said():
    model, trials = trials_of("joint", np.random.default_rng(2))
    free = fit(off(model), trials, WHITE)
    most = free.values["damping"] - 4.0 * free.std("damping")
    found = fit(off(model), trials, WHITE, bounds={"damping": (0.0, most)})
    assert found.values["damping"] == most == found.interval("damping")[1]
    assert found.at_bound == ("damping",)
    assert 0.0 < found.interval("damping")[0] < most
    wide = fit(off(model), trials, WHITE, bounds={"damping": [-5.0, 1e12]})
    assert wide.values == free.values
    narrow = fit(off(model), trials, bounds={"damping": (free.values["damping"] - 1e-4, 1.0)})
    assert narrow.interval("damping")[0] >= free.values["damping"] - 1e-4


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"fixed": ("gian",)}, "fixed: unknown; did you mean gain?"),
        ({"fixed": (3,)}, "fixed: unknown; expected one of gain, time_constant_s"),
        ({"fixed": {"gian": 1.0}}, "gian: unknown; did you mean gain?"),
        ({"fixed": {"gain": -1.0}}, "gain: expected a number above 0, found -1.0"),
        ({"bounds": {"gian": (0.0, 1.0)}}, "bounds: unknown; did you mean gain?"),
        (
            {"bounds": {"gain": (1.0, 0.0)}},
            "bounds: expected (lower, upper) of gain within 1e-06 to 100000, found (1.0, 0.0)",
        ),
        ({"bounds": {"gain": 1.0}}, "bounds: expected (lower, upper) of gain within 1e-06 to 100000, found 1.0"),
        (
            {"bounds": {"gain": (-2.0, -1.0)}},
            "bounds: expected (lower, upper) of gain within 1e-06 to 100000, found (-2.0, -1.0)",
        ),
        ({"bounds": {"gain": (0.0, 1.0)}, "fixed": ("gain",)}, "bounds: unknown; expected time_constant_s"),
    ],
)
def test_what_cannot_be_fixed_or_bounded_is_refused(given, told):
    model, trials = trials_of("muscle", np.random.default_rng(0), count=1)
    with pytest.raises(fp.InputError) as raised:
        fit(model, trials, WHITE, **given)
    assert str(raised.value) == told or str(raised.value).startswith(told)


@pytest.fixture(scope="module")
def plain():
    model, trials = trials_of("muscle", np.random.default_rng(0))
    return fit(off(model), trials)


@pytest.mark.parametrize("ask", ["std", "interval"])
def test_a_name_that_was_not_fitted_is_answered_with_one_that_was(plain, ask):
    with pytest.raises(fp.InputError, match=r"gian: unknown; did you mean gain\?"):
        getattr(plain, ask)("gian")
    with pytest.raises(fp.InputError, match="method: expected wald or profile, found 'bayes'"):
        plain.interval("gain", method="bayes")


@pytest.mark.parametrize("copied", COPIES)
def test_nothing_that_a_fit_holds_can_be_written_to(plain, copied):
    fitted = copied(plain)
    (noise,) = fitted.noise.values()
    arrays = [fitted.covariance]
    arrays += [array for part in fitted.parts for array in (part.residual, part.jacobian, part.local)]
    arrays += [t["force_n"] for t in fitted.trials]
    for array in arrays:
        assert not array.flags.writeable
    with pytest.raises(TypeError):
        fitted.noise["force_n"] = noise
    with pytest.raises(TypeError):
        fitted.unknowns[0]["initial_position"] = 0.0
    with pytest.raises(TypeError):
        fitted.bounds["gain"] = (0.0, 1.0)
    with pytest.raises(TypeError):
        fitted.model.rig.constants["threshold_us"] = 0.0


@pytest.mark.parametrize("copied", COPIES)
def test_a_copy_of_a_fit_says_the_same(plain, copied):
    fitted = copied(plain)
    assert fitted == plain and hash(fitted) == hash(plain)
    assert str(fitted) == str(plain)
    assert fitted.model == plain.model and fitted.noise == plain.noise
    np.testing.assert_array_equal(fitted.covariance, plain.covariance)
    assert fitted.interval("gain", method="profile") == plain.interval("gain", method="profile")


def test_fits_are_equal_by_what_they_say(plain, at_its_bound):
    model, trials = trials_of("muscle", np.random.default_rng(0))
    assert fit(off(model), trials) == plain != fit(off(model), trials[:1])
    assert plain != at_its_bound and plain != str(plain)
    likely = as_likely(at_its_bound, StateSpaceNoise({"position": 0.2}, {}, {}))
    assert copy.deepcopy(likely) == likely


def test_trials_may_be_one_or_come_one_after_another():
    model, trials = trials_of("muscle", np.random.default_rng(0))
    whole = fit(model, trials, WHITE)
    assert fit(model, (t for t in trials), WHITE).values == whole.values
    assert fit(model, trials[0], WHITE).values == fit(model, trials[:1], WHITE).values


def test_of_a_study_trials_that_it_holds_out_are_not_fitted():
    model, trials = trials_of("muscle", np.random.default_rng(0))
    roles = enumerate(("fit", None, "held_out"))
    trials = tuple(replace(t, name=str(k), role=role) for t, (k, role) in zip(trials, roles, strict=True))
    known = {n: model.rig.constants[n] for n in ("threshold_us", "saturation_us")}
    study = fp.Study("s", "muscle", known, {"gain": 30.0, "time_constant_s": 0.06}, trials)
    assert fit(model, study, WHITE).trials == trials[:2]
    assert fit(model, study.trials, WHITE).trials == trials
    held = replace(study, trials=trials[2:])
    assert fit(model, held.trials, WHITE).trials == trials[2:]
    with pytest.raises(fp.InputError, match="expected at least one trial to fit; all have role = held_out"):
        fit(model, held, WHITE)


def test_effects_of_each_trial_are_profiled_as_well():
    rng = np.random.default_rng(4)
    model = Model(RIGS["joint"]) + SensorOffset.of_each_trial()
    fitted = fit(model, [measured(Model(RIGS["joint"]), trial("joint", "motion", rng), rng) for _ in range(2)], WHITE)
    low, high = fitted.interval("damping", method="profile")
    assert low < fitted.values["damping"] < high
    assert rises(fitted, "damping", high) == pytest.approx(RISE, abs=0.05)


def test_a_fit_is_saved_and_loaded(at_its_bound, plain, tmp_path):
    for fitted in (at_its_bound, plain):
        fp.save_result(fitted, tmp_path / "fit.json")
        again = fp.load_result(tmp_path / "fit.json")
        assert again == fitted and fitted == again and hash(again) == hash(fitted)
        pandas.testing.assert_frame_equal(again.to_frame(), fitted.to_frame(), rtol=1e-5)
        assert str(again) == str(fitted)
        assert list(again.table["parameter"]) == list(fitted.free)
        assert again.found["parameters"]["damping" if "damping" in fitted.free else "gain"]["note"] == ""
    assert again != at_its_bound
    fp.save_result(at_its_bound, tmp_path / "fit.json")
    kept = fp.load_result(tmp_path / "fit.json").found["parameters"]["coulomb_friction.torque_nm"]
    assert kept["std"] is None and kept["note"] == "at its bound" and kept["low"] == 0.0 < kept["high"]


def test_a_fit_has_its_noise_and_its_old_name_says_that_it_ends(at_its_bound):
    """Of a fit by the likelihood: the process noise, and by column the noise of a reading."""
    noise = StateSpaceNoise({"position": 0.2}, {"effort": 1.0}, {"effort": 0.1}, ar={"position": (0.5,)})
    likely = as_likely(at_its_bound, noise)
    assert likely.noise is noise and likely.noise["position"].innovation_std == 0.2
    assert likely.noise["position"].std == pytest.approx(0.2 / 0.75**0.5)
    for one, old in ((likely, noise), (at_its_bound, None)):
        with pytest.warns(DeprecationWarning, match="Fit.noise"):
            assert one.doubt is old
    assert pickle.loads(pickle.dumps(likely)).noise == noise
    assert likely.to_json() != "" and likely._kind() == "Fit"
    with pytest.raises(fp.InputError, match="expected wald"):
        likely.interval("damping", method="profile")
