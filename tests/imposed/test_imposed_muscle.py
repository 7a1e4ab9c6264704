"""A muscle on a lever against an independent integration, and what a study of one must not hold."""

import numpy as np
import pytest
from imposed_rigs import muscle
from imposed_rigs.motion import wandering
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fes_pin.data.errors import InputError
from fes_pin.data.plausibility import implausible
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.diagnosis import diagnose_joint
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import maximise
from fes_pin.identify.process_noise import first_guess
from fes_pin.models.catalogue import Catalogue, shipped
from fes_pin.models.effects import ForceLength, ForceVelocity, ParallelStiffness, PulseSummation, SeriesElasticity
from fes_pin.models.model import Model
from fes_pin.models.rigs import Muscle
from fes_pin.models.simulate import Simulator, simulate

MUSCLE = Muscle(12.0, 0.04, constants={"threshold_us": 0.0, "saturation_us": 1.0, "length_m": 0.05})
DT, RNG = 1e-3, np.random.default_rng(5)
TIME = np.arange(800) * DT
ON = np.where((TIME > 0.1) & (TIME < 0.55), 1.0, 0.0)


def on_a_lever(length):
    return Trial("lever", "imposed", {"pulse_width_us": ON, "length_m": length}, TIME)


def sine(t, order=0):
    w = 2.0 * np.pi * 3.0
    return 0.05 * (order == 0) + 2e-3 * w**order * np.sin(w * t + 0.5 * np.pi * order)


def activation():
    act = np.zeros(len(TIME))
    for k in range(1, len(TIME)):  # the first-order lag answers a held input exactly
        act[k] = ON[k - 1] + (act[k - 1] - ON[k - 1]) * np.exp(-DT / 0.04)
    return act


def test_without_causes_length_changes_nothing():
    assert np.abs(simulate(Model(MUSCLE), on_a_lever(sine(TIME)))["force_n"] - 12.0 * activation()).max() < 1e-6


def test_each_cause_is_its_equation():
    act, x, v = activation(), sine(TIME) - 0.05, -sine(TIME, 1)
    bell = ForceLength(slope_per_rad=60.0, curvature_per_rad2=2e4)
    seen = simulate(Model(MUSCLE) + bell, on_a_lever(sine(TIME)))["force_n"]
    assert np.abs(seen - 12.0 * act * np.exp(60.0 * x - 2e4 * x**2)).max() < 1e-4
    hill = ForceVelocity(slope_s_per_rad=20.0, hill=4.0, plateau=2.0)
    seen = simulate(Model(MUSCLE) + hill, on_a_lever(sine(TIME)))["force_n"]
    u = 20.0 * v
    factor = np.where(
        u > 0, (1.0 - u / 5.0) / (1.0 + 0.8 * np.maximum(u, 0.0)), 1.0 - u / (1.0 - 2.0 * np.minimum(u, 0.0))
    )
    assert np.abs(seen - 12.0 * act * factor).max() < 0.01
    bound = act**2
    summed = simulate(Model(MUSCLE) + PulseSummation(saturation=3.0, cooperation=1.0), on_a_lever(sine(TIME)))[
        "force_n"
    ]
    assert np.abs(summed - 12.0 * 4.0 * bound / (1.0 + 3.0 * bound)).max() < 0.01
    passive = ParallelStiffness(stiffness_nm_per_rad=200.0, rest_angle_rad=0.05, hardening_per_rad2=6e5)
    alone = simulate(Model(MUSCLE) + passive, on_a_lever(sine(TIME)))["force_n"] - 12.0 * act
    rate = np.sqrt(6.0 * 6e5)
    assert np.abs(alone - 200.0 * np.expm1(rate * np.maximum(x, 0.0)) / rate).max() < 1e-3


@pytest.mark.parametrize("plateau", [0.0, 2.0])
def test_the_tendon_is_a_hill_type_muscle(plateau):
    """Against the usual form: the fibres' speed from the inverted force-velocity curve, by an implicit integrator.

    The tendon's damping time of half a millisecond and the held input make the difference.
    """
    compliance, slope, hill = 1e-4, 20.0, 4.0
    curve = ForceVelocity(slope_s_per_rad=slope, hill=hill, plateau=plateau)
    model = Model(MUSCLE) + curve + SeriesElasticity(compliance=compliance) + ForceLength(30.0, 1e4)

    def rates(t, y):
        act, tension = y
        x = float(sine(t)) - 0.05 - compliance * tension
        capacity = 12.0 * act * np.exp(30.0 * x - 1e4 * x * x)
        drive = float(t - 1e-9 > 0.1 and t - 1e-9 < 0.55)

        def left(u):  # damped as little as makes a resting muscle's speed finite
            return capacity * float(curve.factor(u)) - 2.0 * u - tension

        u = brentq(left, -20.0, 20.0)
        return [(drive - act) / 0.04, (u + float(sine(t, 1))) / compliance]

    run = solve_ivp(rates, (0.0, TIME[-1]), [0.0, 0.0], "Radau", TIME, rtol=1e-6, atol=1e-6, max_step=5e-3)
    seen = simulate(model, on_a_lever(sine(TIME)))["force_n"]
    strong = (TIME > 0.2) & (TIME < 0.55)
    assert np.abs(seen - run.y[1])[strong].max() < 0.05 * run.y[1].max()


def test_a_quick_release_is_felt_as_the_tendon_is_stiff():
    """The drop, within a few milliseconds, is the released way over the compliance."""
    way, compliance = 2e-4, 1.2e-4
    length = 0.05 - way * np.clip((TIME - 0.4) / 2e-3, 0.0, 1.0)
    model = Model(MUSCLE) + ForceVelocity(slope_s_per_rad=20.0, hill=4.0) + SeriesElasticity(compliance=compliance)
    force = simulate(model, on_a_lever(length))["force_n"]
    drop = force[398] - force[400:410].min()
    assert drop == pytest.approx(way / compliance, rel=0.25)


def test_sensitivities_of_a_tendon_beside_force_velocity():
    model = Model(MUSCLE) + ForceVelocity(20.0, hill=4.0, plateau=1.0) + SeriesElasticity(compliance=1e-4)
    names, values, trial = model.fitted_parameters(), model.parameters(), on_a_lever(sine(TIME))
    exact = Simulator(model, [trial], names).run(values)[0].sensitivities[:, 0]
    for j, name in enumerate(names):
        step = 1e-5 * abs(values[name])
        up, down = (Simulator(model, [trial]).run({**values, name: values[name] + d})[0] for d in (step, -step))
        difference = (up.readings[:, 0] - down.readings[:, 0]) / (2.0 * step)
        assert np.abs(difference - exact[:, j]).max() < 1e-3 * np.abs(exact[:, j]).max(), name


def study_of(**columns):
    trial = on_a_lever(columns.pop("length_m", sine(TIME))).with_columns(force_n=12.0 * activation(), **columns)
    start = {"gain": 1.0, "time_constant_s": 0.05}
    return Study("lever", "muscle", {"threshold_us": 0.0, "saturation_us": 1.0}, start, (trial,))


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"length_m": 1e3 * sine(TIME)}, "is it in mm"),
        ({"length_m": sine(TIME) - 0.05}, "expected the whole length"),
        ({"length_m": np.full(len(TIME), 0.05)}, "never moves"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(columns, words):
    with pytest.raises(InputError, match=words) as told:
        implausible(study_of(**columns))
    assert "\n" not in str(told.value)


def test_a_muscle_without_a_stimulus_is_passive():
    said = implausible(study_of(pulse_width_us=np.zeros(len(TIME))))
    assert any("the muscle is passive" in words for words in said)


def test_a_length_is_read_in_imposed_trials_only(tmp_path):
    from fes_pin.data.trial_files import read_trial

    (tmp_path / "a.csv").write_text("time_s,stim,length_m,force_n\n0,1,0.05,0\n0.1,0,0.05,1\n0.2,0,0.05,1\n")
    with pytest.raises(InputError, match="read in trials of kind imposed"):
        read_trial(tmp_path / "a.csv", rig="muscle")
    assert read_trial(tmp_path / "a.csv", rig="muscle", kind="imposed").kind == "imposed"
    (tmp_path / "b.csv").write_text("time_s,stim,force_n\n0,1,0\n0.1,0,1\n0.2,0,1\n")
    with pytest.raises(InputError, match="has its motion there"):
        read_trial(tmp_path / "b.csv", rig="muscle", kind="imposed")


def test_a_random_force_acts_on_a_muscle_on_a_lever():
    """Without it whatever wanders counts against the causes, and some are named where there are none."""
    study = study_of()
    trial = study.trials[0].with_columns(force_n=12.0 * activation() + wandering(len(TIME), DT, 0.1, 0.05, RNG))
    problem = LikelihoodProblem(Model(MUSCLE), [trial], first_guess(Model(MUSCLE), [trial]))
    found = maximise(problem).noise
    assert found.std["force"] == pytest.approx(0.1, rel=0.4) and found.white["force_n"] < 0.02


def test_no_motion_is_proposed():
    """What separates causes on a lever would be a motion, and none is made up."""
    assert Muscle.conditions_to_try(study_of()) == set()


def test_beside_a_form_that_is_not_right_no_trial_was_misread(tmp_path):
    """Of a muscle whose force falls with its length otherwise than the library's, one trial is always the oddest."""
    made = muscle.study(("force_length",), 0.3, np.random.default_rng(995013), tmp_path)
    known = shipped()
    found = diagnose_joint(made, library=Catalogue((known.effect("force_length"),), known.rigs))
    assert [c.name for c in found.causes] == ["force_length"]
    assert found.remainder.unexplained
