"""The engine against slow re-implementations that share nothing with it, for every effect on every rig."""

import dataclasses

import numpy as np
import oracle
import pytest
from models.cases import ANKLE, CASES, JOINT, MUSCLE, RIGS, name_of, trial

from fes_pin.data.study import read_study, write_study
from fes_pin.models.effects import effect_named
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import Simulator
from fes_pin.search.fit import fit

CONSTANTS = {"ankle": ANKLE, "joint": JOINT, "muscle": MUSCLE}
ANGLE_RAD, FORCE_N = 1e-5, 3e-4
LOOSER = {"coulomb_friction": 20.0}
"""A joint that comes to rest does so within a step: the engine errs in proportion to it, by at most 2e-4 rad."""

FORMS = {
    "recruitment_curvature": [
        {"form": "ding", "steepness": 1.5},
        {"form": "gompertz", "delay": 3.0, "steepness": 4.0},
        {"form": "sigmoid", "steepness": 6.0, "middle": 0.4},
    ],
    "recruitment_hysteresis": [{"form": "two_plays", "half_width_us": 20.0}],
    "threshold_drift": [{"form": "settling", "rate_us_per_s": 6.0, "settling_s": 3.0}],
    "antagonist_spillover": [{"form": "smooth", "share": 0.2, "onset_us": 500.0}],
    "fatigue": [{"form": "linear", "rate_per_s": 0.02, "recovery_s": 30.0}],
    "potentiation": [{"form": "saturating", "gain": 0.1, "decay_s": 2.0}],
    "rise_fall_asymmetry": [{"form": "smooth", "log_ratio": 0.4, "blur": 0.05}],
    "force_length": [
        {"form": "gaussian", "best_rad": 1.8, "width_rad": 1.0},
        {"form": "parabola", "best_rad": 1.8, "width_rad": 1.2},
    ],
    "force_velocity": [
        {"form": "hill", "fastest": 10.0, "roundness": 0.3},
        {"form": "exponential", "slope_s_per_rad": 0.1},
    ],
    "coulomb_friction": [{"form": "tanh", "torque_nm": 0.02, "sharp": 0.0005}],
    "quadratic_damping": [{"coefficient": 0.02, "power": 1.7}],
    "joint_stop": [{"stiffness": 3.0, "angle_rad": 1.9, "power": 1.5}],
    "parallel_stiffness": [{"stiffness_nm_per_rad": 0.1, "rest_angle_rad": 1.8, "hardening_per_rad2": 5.0}],
    "passive_relaxation": [{"form": "two", "stiffness_nm_per_rad": 0.1, "relaxation_s": 0.2}],
    "stretch_reflex": [
        {"form": "pure", "gain_nms": 0.02, "delay_s": 0.045},
        {"form": "lags", "gain_nms": 0.02, "delay_s": 0.045},
    ],
    "periodic_torque": [{"in_phase": 0.015, "frequency_hz": 0.4, "second_harmonic": 0.006}],
    "sensor_drift": [{"rate_per_s": 0.01, "settling_s": 2.0}],
    "sensor_lag": [{"form": "shift", "lag_s": 0.013}],
    "sensor_nonlinearity": [{"curvature": 0.3, "cubic": 0.5}],
}
"""Second functional forms: a real rig never follows the engine's equation."""


def nominal(rig):
    return {n: getattr(RIGS[rig], n) for n in RIGS[rig].parameters()}


def trials(rig, kind, dt=5e-3, duration=2.0):
    rng = np.random.default_rng(7)
    return [trial(rig, kind, rng, round(duration / dt), dt) for _ in range(2)]


def typical(one, rig):
    if rig == "joint" and one.name == "joint_stop":
        return {"stiffness": 1.0, "angle_rad": 0.4}
    return oracle.TYPICAL[one.name]


def worst(model, causes, rig, some, max_step_s=None):
    """Largest difference of engine and oracle in any column, and what the causes change at all."""
    error, change = 0.0, 0.0
    answers = Simulator(model, some, max_step_s=max_step_s).run(model.parameters())
    for one, answer in zip(some, answers, strict=True):
        expected = oracle.simulate(CONSTANTS[rig], nominal(rig), causes, one)
        without = oracle.simulate(CONSTANTS[rig], nominal(rig), {}, one)
        for k, name in enumerate(RIGS[rig].outputs(one.kind)):
            error = max(error, np.abs(answer.readings[:, k] - expected[name]).max() if name != "velocity" else 0.0)
            change = max(change, np.abs(expected[name] - without[name]).max())
    return error, change


@pytest.mark.parametrize(("one", "rig", "kind"), CASES, ids=name_of)
def test_every_effect_means_what_the_oracle_means(one, rig, kind):
    parameters = typical(one, rig)
    tolerance = (FORCE_N if RIGS[rig].outputs(kind)[0] == "force_n" else ANGLE_RAD) * LOOSER.get(one.name, 1.0)
    error, change = worst(Model(RIGS[rig]) + one(**parameters), {one.name: parameters}, rig, trials(rig, kind))
    assert error <= tolerance
    can_be_felt = kind == "motion" or one.name != "force_velocity"  # held still, nothing shortens
    assert not can_be_felt or change > 30.0 * tolerance or change > 1e-3


@pytest.mark.parametrize(("rig", "kind"), [("ankle", "motion"), ("joint", "motion")])
def test_the_nominal_model_is_exact_at_1_khz(rig, kind):
    error, _ = worst(Model(RIGS[rig]), {}, rig, trials(rig, kind, dt=1e-3, duration=2.0))
    assert error <= 1e-6


@pytest.mark.filterwarnings("ignore:force_n is cut off:fes_pin.InputWarning")
@pytest.mark.parametrize("second_s", [0.001, 0.002, 0.004])
def test_a_short_lag_is_told_from_a_delay(second_s):
    """What the engine's steps do to a lag shorter than they are is small beside what makes it a lag and no delay."""
    some, causes = trials("muscle", "isometric"), {"second_order_activation": {"second_s": second_s}}
    wanted = [oracle.simulate(MUSCLE, nominal("muscle"), causes, t)["force_n"] for t in some]
    made = [dataclasses.replace(t, columns={**t.columns, "force_n": y}) for t, y in zip(some, wanted, strict=True)]
    as_lag = fit(Model(RIGS["muscle"]) + effect_named("second_order_activation")(second_s=second_s), made)
    as_delay = fit(Model(RIGS["muscle"]) + effect_named("electromechanical_delay")(delay_s=second_s), made)
    assert as_lag.noise["force_n"].std < 0.5 * as_delay.noise["force_n"].std
    assert as_lag.values["second_order_activation.second_s"] == pytest.approx(second_s, rel=0.02)


REFINED = [
    ("coulomb_friction", "ankle", {"torque_nm": 0.02, "asymmetry": 0.4}),
    ("coulomb_friction", "ankle", {"torque_nm": 0.02, "asymmetry": -0.7}),
    ("cogging", "joint", {"in_phase": 0.02, "quadrature": 0.01, "waves": 9.0, "second": 0.02, "phase_rad": 0.7}),
]


@pytest.mark.parametrize(("name", "rig", "parameters"), REFINED)
def test_refined_forms_mean_what_the_oracle_means(name, rig, parameters):
    some = trials(rig, "motion")
    error, _ = worst(Model(RIGS[rig]) + effect_named(name)(**parameters), {name: parameters}, rig, some)
    plain = {n: v for n, v in parameters.items() if n not in ("asymmetry", "second", "phase_rad")}
    unrefined, _ = worst(Model(RIGS[rig]) + effect_named(name)(**plain), {name: parameters}, rig, some)
    assert error <= ANGLE_RAD * LOOSER.get(name, 1.0) < 0.1 * unrefined


def test_friction_converges_to_its_law():
    one = oracle.TYPICAL["coulomb_friction"]
    model, some = Model(RIGS["ankle"]) + effect_named("coulomb_friction")(**one), trials("ankle", "motion")
    coarse, _ = worst(model, {"coulomb_friction": one}, "ankle", some)
    fine, _ = worst(model, {"coulomb_friction": one}, "ankle", some, max_step_s=6.25e-5)
    assert fine <= 0.25 * coarse


@pytest.mark.parametrize(("name", "form"), [(n, f) for n, forms in FORMS.items() for f in forms])
def test_second_forms_are_other_forms(name, form):
    (some, _) = trials("ankle", "motion")
    answer = oracle.simulate(ANKLE, nominal("ankle"), {name: form}, some)["angle_rad"]
    without = oracle.simulate(ANKLE, nominal("ankle"), {}, some)["angle_rad"]
    assert np.isfinite(answer).all()
    assert np.abs(answer - without).max() > 1e-3


@pytest.mark.parametrize("rig", ["ankle", "joint", "muscle"])
@pytest.mark.parametrize("noise", ["white", "ar1", "process"])
def test_the_nominal_fit_recovers_a_random_rig(rig, noise, tmp_path):
    """From wrong starts, within four standard deviations where the noise is as assumed."""
    rng = np.random.default_rng([11, len(rig)])
    study = oracle.make_study(rng, rig, noise=noise, n_motion=3, n_isometric=2, duration_s=4.0, folder=tmp_path)
    rng = np.random.default_rng([11, len(rig)])
    true = oracle.make_study(
        rng, rig, noise=noise, n_motion=3, n_isometric=2, duration_s=4.0, wrong_start=False, folder=tmp_path
    )
    assert all(np.array_equal(a.time, b.time) for a, b in zip(study.trials, true.trials, strict=True))
    fitted = fit(nominal_model(study), study.trials)
    assert fitted.converged
    for name, value in true.start.items():
        assert study.start[name] != value
        allowed = 4.0 * fitted.std(name) if noise != "process" else 0.05 * value
        assert abs(fitted.values[name] - value) <= allowed + 1e-4 * value


@pytest.mark.parametrize("rig", ["ankle", "joint", "muscle"])
def test_studies_of_the_oracle_are_studies(rig, tmp_path):
    study = oracle.make_study(
        np.random.default_rng(12), rig, n_motion=2, n_isometric=2, duration_s=1.0, folder=tmp_path
    )
    write_study(study, tmp_path / "written")
    again = read_study(tmp_path / "written")
    assert [len(t) for t in again.trials] == [len(t) for t in study.trials]
    assert dict(again.start) == dict(study.start)


def test_the_same_seed_makes_the_same_study():
    causes = {"fatigue": oracle.TYPICAL["fatigue"]}
    one, other = (
        oracle.make_study(np.random.default_rng(5), "ankle", causes, n_motion=1, n_isometric=1, duration_s=1.0)
        for _ in range(2)
    )
    assert all(np.array_equal(a[c], b[c]) for a, b in zip(one.trials, other.trials, strict=True) for c in a.columns)
