"""Random studies around the paper's rig, with causes hidden in the data and noise on top."""

import math
import tempfile
from pathlib import Path

import numpy as np

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from oracle.simulate import simulate

RATE_HZ, DURATION_S = 200.0, 8.0
ANGLE_NOISE_RAD, FORCE_NOISE_N = 2e-3, 0.2
AR1 = 0.6
PROCESS_TORQUE_NM = 4e-3
THRESHOLD_US, SATURATION_US = 180.0, 1000.0

TYPICAL = {
    "threshold_shift": {"shift_us": 20.0},
    "recruitment_curvature": {"log_exponent": 0.2, "log_bend": 0.5},
    "recruitment_hysteresis": {"half_width_us": 15.0},
    "threshold_drift": {"rate_us_per_s": 2.5},
    "antagonist_spillover": {"share": 0.2, "onset_us": 500.0},
    "fatigue": {"rate_per_s": 0.04, "recovery_s": 30.0},
    "potentiation": {"gain": 0.1, "decay_s": 2.0},
    "electromechanical_delay": {"delay_s": 0.0217},
    "second_order_activation": {"second_s": 0.02},
    "pulse_summation": {"saturation": 1.0},
    "rise_fall_asymmetry": {"log_ratio": 0.4},
    "force_length": {"slope_per_rad": 0.3, "curvature_per_rad2": 0.6},
    "force_velocity": {"slope_s_per_rad": 0.1},
    "coulomb_friction": {"torque_nm": 0.02},
    "quadratic_damping": {"coefficient": 0.02},
    "joint_stop": {"stiffness": 1.0, "angle_rad": 1.95},
    "parallel_stiffness": {"stiffness_nm_per_rad": 0.15, "rest_angle_rad": 1.8},
    "passive_relaxation": {"stiffness_nm_per_rad": 0.15, "relaxation_s": 0.3},
    "load_inertia": {"share": 0.8},
    "stretch_reflex": {"gain_nms": 0.02, "delay_s": 0.045},
    "base_tilt": {"tilt_rad": 0.3},
    "frame_vibration": {"coupling": 0.15, "frequency_hz": 9.0, "damping_ratio": 0.04},
    "load_error": {"error": 0.03},
    "periodic_torque": {"in_phase": 0.015, "frequency_hz": 0.4},
    "effort_offset": {"offset": 0.03},
    "effort_gain": {"error": 0.1},
    "cogging": {"in_phase": 0.02, "quadrature": 0.01, "waves": 12.0},
    "backlash": {"half_width": 0.01},
    "sensor_offset": {"offset": 0.02},
    "sensor_gain": {"error": 0.06},
    "sensor_drift": {"rate_per_s": 0.003},
    "sensor_lag": {"lag_s": 0.02},
    "sensor_nonlinearity": {"curvature": 0.3},
    "mains_hum": {"in_phase": 0.003, "quadrature": 0.001, "frequency_hz": 50.0},
}
"""A size of every cause that shows in a study of this noise, in the engine's own form."""


def make_study(
    rng,
    rig="ankle",
    causes=None,
    noise="white",
    n_motion=8,
    n_isometric=3,
    wrong_start=True,
    duration_s=DURATION_S,
    driven=True,
    folder=None,
):
    """A study whose data hide `causes`.

    Parameters
    ----------
    rng
        numpy's Generator: draws the rig, the stimuli and the noise.
    rig
        "ankle", "joint" or "muscle".
    causes : dict of str to dict, or a function of a trial's number that gives one
        Parameters by canonical name, see `oracle.simulate`; `TYPICAL` has some.
    noise
        "white", "ar1" (first-order autoregressive sensor noise) or "process" (white, and a random torque).
    n_motion, n_isometric
        Number of trials of each kind; a joint has the first, a muscle the second.
    wrong_start
        Start values that are not the true ones; else the true ones.
    driven
        For a joint: with a commanded effort, or swinging free.
    folder
        Where a joint's URDF is written; by default a new temporary folder.

    Returns
    -------
    Study
    """
    causes = causes or {}
    if noise not in ("white", "ar1", "process"):
        raise ValueError(noise)
    constants, nominal, start = {"ankle": ankle_rig, "joint": joint_rig, "muscle": muscle_rig}[rig](rng)
    kinds = ["motion"] * (n_motion if rig != "muscle" else 0) + ["isometric"] * (n_isometric if rig != "joint" else 0)
    trials = []
    for number, kind in enumerate(kinds):
        bare = _inputs(rng, rig, kind, number, duration_s, driven)
        disturbance = rng.normal(0.0, PROCESS_TORQUE_NM, len(bare)) if noise == "process" and kind == "motion" else None
        hidden = causes(number) if callable(causes) else causes
        columns = simulate(constants, nominal, hidden, bare, disturbance)
        noisy = {n: y + _noise(rng, len(bare), n, "ar1" if noise == "ar1" else "white") for n, y in columns.items()}
        if rig == "joint":
            del noisy["velocity"]
        conditions = {n: v for n, v in bare.conditions.items() if n not in ("position0", "velocity0")}
        trials.append(Trial(bare.name, kind, {**bare.columns, **noisy}, bare.time, conditions))
    start = start if wrong_start else {n: nominal[n] for n in start}
    files = {}
    if rig == "joint":
        folder = Path(folder or tempfile.mkdtemp(prefix="oracle"))
        files["urdf"] = folder / "rig.urdf"
        files["urdf"].write_text(pendulum_urdf(constants))
        constants = {}
    return Study("oracle", rig, constants, start, tuple(trials), files=files)


def _near(rng, value, share=0.15):
    return value * math.exp(rng.uniform(-share, share))


def ankle_rig(rng):
    constants = {
        "foot_mass_kg": _near(rng, 0.12),
        "com_distance_m": _near(rng, 0.08, 0.08),
        "moment_arm_m": _near(rng, 0.034),
        "force_scale_n": _near(rng, 56.0, 0.1),
        "threshold_us": THRESHOLD_US,
        "saturation_us": SATURATION_US,
        "f0_n": _near(rng, 4.0),
        "f1_per_rad": _near(rng, 2.2, 0.1),
        "theta_r_rad": _near(rng, 1.2, 0.08),
    }
    true = {
        "gain": _near(rng, 0.65),
        "time_constant_s": _near(rng, 0.05, 0.2),
        "inertia_kgm2": max(_near(rng, 1e-3), constants["foot_mass_kg"] * constants["com_distance_m"] ** 2),
        "damping_nms": _near(rng, 0.07, 0.25),
    }
    return constants, true, {"gain": 0.5, "time_constant_s": 0.07, "inertia_kgm2": 1.3e-3, "damping_nms": 0.05}


def muscle_rig(rng):
    constants = {"threshold_us": THRESHOLD_US, "saturation_us": SATURATION_US}
    true = {"gain": _near(rng, 35.0), "time_constant_s": _near(rng, 0.05, 0.2)}
    return constants, true, {"gain": 25.0, "time_constant_s": 0.08}


def joint_rig(rng):
    mass, length = _near(rng, 0.6), _near(rng, 0.18)
    own = 0.1 * mass * length**2
    turned = rng.uniform(-0.4, 0.4)
    weight = mass * 9.81 * length
    constants = {
        "inertia": own + mass * length**2,
        "gravity_cos": weight * math.sin(turned),
        "gravity_sin": weight * math.cos(turned),
        "revolute": 1.0,
        "mass": mass,
        "length": length,
        "own": own,
        "turned": turned,
    }
    true = {"inertia_scale": _near(rng, 1.0, 0.1), "damping": _near(rng, 0.02)}
    return constants, true, {"inertia_scale": 1.0, "damping": 0.03}


def pendulum_urdf(k):
    """A pendulum about x whose rest is turned by `turned`: g(q) = m g l sin(q + turned)."""
    return f"""<?xml version="1.0"?>
<robot name="pendulum">
  <link name="base"/>
  <link name="arm"><inertial>
    <origin xyz="0 0 {-k["length"]!r}"/><mass value="{k["mass"]!r}"/>
    <inertia ixx="{k["own"]!r}" ixy="0" ixz="0" iyy="{k["own"]!r}" iyz="0" izz="{k["own"]!r}"/>
  </inertial></link>
  <joint name="pivot" type="continuous">
    <origin rpy="{k["turned"]!r} 0 0"/><parent link="base"/><child link="arm"/><axis xyz="1 0 0"/>
  </joint>
</robot>
"""


def _inputs(rng, rig, kind, number, duration_s, driven):
    n = round(duration_s * RATE_HZ)
    time = np.arange(n) / RATE_HZ
    name = f"{number:02d}"
    if rig == "joint":
        conditions = {"position0": rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.2), "velocity0": rng.uniform(-1.0, 1.0)}
        effort = 0.4 * stimulus(rng, time, number) if driven else None
        return Trial(name, kind, {} if effort is None else {"effort": effort}, time, conditions)
    level = stimulus(rng, time, number)
    width = np.where(level > 0.0, THRESHOLD_US + level * (SATURATION_US - THRESHOLD_US), 0.0)
    conditions = {}
    if rig == "ankle":
        conditions = {"load_kg": (1.0, 1.5)[number % 2]} if kind == "motion" else {"angle_rad": 1.9}
    return Trial(name, kind, {"pulse_width_us": np.round(width, 1)}, time, conditions)


def stimulus(rng, time, number):
    """Levels between 0 and 1, zero for the first 0.4 s: steps, ramps, staircases, sines, random trains in turn."""
    n, dt = len(time), time[1] - time[0]
    level, begin = np.zeros(n), round(0.4 / dt)
    active = time[begin:] - time[begin]
    span = active[-1]
    shape = ("step", "train", "staircase", "sine", "ramp")[number % 5]
    if shape == "step":
        level[begin : begin + round(rng.uniform(0.4, 0.7) * n)] = rng.uniform(0.4, 0.9)
    elif shape == "ramp":
        top = rng.uniform(0.7, 1.0)
        level[begin:] = np.clip(top * (1.0 - np.abs(2.0 * active / span - 1.0)) * 1.1, 0.0, 1.0)
    elif shape == "staircase":
        steps = int(rng.integers(4, 7))
        climb = np.minimum(np.floor(active / span * 2 * steps), 2 * steps - 1)
        level[begin:] = (steps - np.abs(climb + 0.5 - steps) + 0.5) / (steps + 1.0)
    elif shape == "sine":
        frequency = rng.uniform(0.3, 1.5)
        level[begin:] = 0.45 - 0.4 * np.cos(2.0 * math.pi * frequency * active)
    else:
        k = begin
        while k < n:
            length = round(rng.uniform(0.1, 0.9) / dt)
            level[k : k + length] = rng.choice([0.0, 1.0], p=[0.35, 0.65]) * rng.uniform(0.15, 1.0)
            k += length
    return level


def _noise(rng, n, column, kind):
    size = FORCE_NOISE_N if column == "force_n" else ANGLE_NOISE_RAD
    white = rng.normal(0.0, size, n)
    if kind == "white":
        return white
    out = np.empty(n)
    out[0] = white[0]
    for k in range(1, n):
        out[k] = AR1 * out[k - 1] + math.sqrt(1.0 - AR1**2) * white[k]
    return out
