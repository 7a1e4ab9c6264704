"""Small diagnoses put together by hand: two fits and a claimed outcome, without the search."""

from functools import cache
from pathlib import Path

import numpy as np
from identify.rigs import as_likely

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.diagnosis.experiment import NextExperiment
from fes_pin.diagnosis.result import Diagnosis
from fes_pin.identify.fit import rough_fit, under_own_noise
from fes_pin.infer.optimum import MAX_ITERATIONS
from fes_pin.infer.result import CROSS_VALIDATED, Cause, Gain, ParameterEstimate, Ranked, Remainder
from fes_pin.models.describe import fitted_equation, fitted_sentence
from fes_pin.models.effects import effect_named
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import simulated_trial
from fes_pin.search.fit import fit

NASTY = '<script>alert("x")</script> & $a_b$'
ANKLE = {
    **{"foot_mass_kg": 0.12, "com_distance_m": 0.08, "moment_arm_m": 0.034, "force_scale_n": 58.0},
    **{"threshold_us": 180.0, "saturation_us": 1000.0, "f0_n": 3.9, "f1_per_rad": 2.25, "theta_r_rad": 1.22},
}
PENDULUM = """<robot name="p"><link name="base"/><link name="bar"><inertial><origin xyz="0 0 -0.1"/><mass value="0.1"/>
<inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial></link>
<joint name="j" type="{kind}"><parent link="base"/><child link="bar"/><axis xyz="0 1 0"/>
<limit lower="-9" upper="9" effort="9" velocity="99"/></joint></robot>"""


def ankle_study(seconds: float = 3.0, step: float = 0.01) -> Study:
    time = np.arange(0.0, seconds, step)
    width = np.where((time > 0.2 * seconds) & (time < 0.7 * seconds), 640.0, 0.0)
    trials = (
        Trial(f"up {NASTY}", "motion", {"pulse_width_us": width, "angle_rad": 0.0 * time}, time, {"load_kg": 1.0}),
        Trial("held", "isometric", {"pulse_width_us": width, "force_n": 0.0 * time}, time, {"angle_rad": 1.9}),
    )
    start = {"gain": 0.65, "time_constant_s": 0.05, "inertia_kgm2": 1e-3, "damping_nms": 0.06}
    return Study(NASTY, "ankle", ANKLE, start, trials)


def muscle_study(column: str = "pulse_width_us") -> Study:
    time = np.arange(0.0, 2.0, 0.005)
    pulses = (np.arange(len(time)) % 8 == 0).astype(float)
    given = pulses if column == "stim" else np.where((time > 0.3) & (time < 1.5), 700.0, 0.0)
    trials = tuple(Trial(f"{k}", "isometric", {column: given, "force_n": 0.0 * time}, time, {}) for k in range(2))
    known = {} if column == "stim" else {"threshold_us": 180.0, "saturation_us": 1000.0}
    return Study("muscle", "muscle", known, {"gain": 30.0, "time_constant_s": 0.05}, trials)


def joint_study(folder: Path, kind: str = "revolute") -> Study:
    path = folder / f"{kind}.urdf"
    path.write_text(PENDULUM.format(kind=kind))
    time = np.arange(0.0, 3.0, 0.01)
    columns = {"effort": 0.02 * np.sin(3.0 * time), "position": 0.3 + 0.0 * time, "velocity": 0.0 * time}
    trials = tuple(Trial(f"{k}", "motion", columns, time, {}, role) for k, role in enumerate(("fit", "held_out")))
    start = {"inertia_scale": 1.0, "damping": 2e-3}
    return Study("joint", "joint", {}, start, trials, files={"urdf": path})


def measured(study: Study, names: tuple[str, ...], noise: float = 1e-3, seed: int = 5) -> Study:
    """The study with outputs as its nominal model with some effects gives them, and noise."""
    model, rng = _extended(study, names), np.random.default_rng(seed)
    trials = []
    for trial in study.trials:
        made = simulated_trial(model, trial)
        outputs = model.rig.outputs(trial.kind)
        trials.append(trial.with_columns(**{n: made[n] + noise * rng.standard_normal(len(trial)) for n in outputs}))
    return Study(study.name, study.rig, study.constants, study.start, tuple(trials), study.folder, study.files)


def _extended(study: Study, names: tuple[str, ...]):
    model = nominal_model(study)
    for name in names:
        model = model + effect_named(name)()
    return model


def diagnosed(
    study: Study, names: tuple[str, ...] = (), unexplained: bool = False, rivals: tuple[str, ...] = ()
) -> Diagnosis:
    """A diagnosis that claims these causes, whatever the data say."""
    data = measured(study, names)
    train = [t for t in data.trials if t.role != "held_out"]
    nominal = under_own_noise(rough_fit(nominal_model(data), train), max_iterations=MAX_ITERATIONS)
    extended = fit(_extended(data, names), train, nominal.noise) if names else nominal
    causes = tuple(_cause(extended, n, rivals) for n in names)
    plan = None
    if rivals:
        trial = data.trials[0].without(*extended.model.rig.outputs(data.trials[0].kind))
        plan = NextExperiment("they differ most on this trial", (names[0], rivals[0]), trial)
    return Diagnosis(
        study=data,
        verdict="causes_found" if names else "unexplained" if unexplained else "adequate",
        causes=causes,
        remainder=Remainder(unexplained, 1e-5 if unexplained else 0.4, "rate" if unexplained else None),
        absorbed=("sensor_offset",),
        nominal=as_likely(nominal),
        extended=as_likely(extended),
        nominal_error=(9.1, 9.8),
        extended_error=(1.8, None),
        ceiling_percent=1.7,
        next_experiment=plan,
        ranking={n: tuple(Ranked(tuple({*names} - {n} | {r}), 0.5 + k) for k, r in enumerate(rivals)) for n in names},
        held_out_by=CROSS_VALIDATED,
        left_out={},
        wall_s=1.0,
    )


def _cause(extended, name: str, rivals: tuple[str, ...]) -> Cause:
    kind, (one,) = effect_named(name), (e for e in extended.model.effects if e.name == name)
    info, values = extended.model.parameter_info(), extended.values
    estimates = {
        n: ParameterEstimate(values[f"{name}.{n}"], 0.1, info[f"{name}.{n}"].unit)
        for n, i in kind.parameters().items()
        if not i.optional
    }
    return Cause(
        name=name,
        stage=str(kind.stage),
        sentence=fitted_sentence(one, extended.model.rig),
        equation=fitted_equation(one, extended.model.rig),
        parameters=estimates,
        equivalents=rivals,
        p_value=1e-9,
        gain_fit=80.0,
        gain_held_out=Gain(79.5, 74.0, 84.1),
    )


@cache
def ankle_diagnosis() -> Diagnosis:
    return diagnosed(ankle_study(), ("coulomb_friction",), rivals=("quadratic_damping",))
