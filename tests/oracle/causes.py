"""What the contract means by each cause, on plain numbers; several have a second functional form beside the engine's.

`form` in a cause's parameters picks it. Parameters have the names of the engine's where they mean the same.
"""

import math

import numpy as np
from scipy.interpolate import CubicHermiteSpline


def effective_width(width, time, causes):
    """Pulse width that the nerve feels, sample by sample. Shape (n,) in and out."""
    felt = np.array(width, dtype=float)
    if "recruitment_hysteresis" in causes:
        p = causes["recruitment_hysteresis"]
        if p.get("form") == "two_plays":
            felt = 0.5 * (play(felt, 0.5 * p["half_width_us"]) + play(felt, 1.5 * p["half_width_us"]))
        else:
            felt = play(felt, p["half_width_us"])
    if "threshold_drift" in causes:
        p = causes["threshold_drift"]
        since = time - time[0]
        if p.get("form") == "settling":
            since = p["settling_s"] * (1.0 - np.exp(-since / p["settling_s"]))
        felt = felt - p["rate_us_per_s"] * since
    return felt - causes.get("threshold_shift", {}).get("shift_us", 0.0)


def play(signal, half_width, start=0.0):
    """A slack of +- half_width between a signal and what follows it."""
    out, follower = np.empty_like(signal), start
    for k, value in enumerate(signal):
        if follower > value + half_width:
            follower = value + half_width
        elif follower < value - half_width:
            follower = value - half_width
        out[k] = follower
    return out


def recruited(share, causes):
    """Recruitment from the share of the range between threshold and saturation. Shape (n,)."""
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    p = causes.get("recruitment_curvature")
    if p is None:
        return share
    form = p.get("form", "hill")
    if form == "hill":
        power = share ** math.exp(p["log_exponent"])
        bend = math.exp(p["log_bend"])
        return bend * power / (1.0 + (bend - 1.0) * power)
    if form == "ding":
        return (1.0 - np.exp(-p["steepness"] * share)) / (1.0 - math.exp(-p["steepness"]))
    if form == "gompertz":
        low, high = math.exp(-p["delay"]), math.exp(-p["delay"] * math.exp(-p["steepness"]))
        return (np.exp(-p["delay"] * np.exp(-p["steepness"] * share)) - low) / (high - low)
    if form == "sigmoid":
        low, high = (1.0 / (1.0 + math.exp(-p["steepness"] * (x - p["middle"]))) for x in (0.0, 1.0))
        return (1.0 / (1.0 + np.exp(-p["steepness"] * (share - p["middle"]))) - low) / (high - low)
    raise ValueError(form)


def time_constant(nominal, wanted, act, causes):
    """Activation's time constant, s."""
    p = causes.get("rise_fall_asymmetry")
    if p is None:
        return nominal
    ratio = math.exp(p["log_ratio"])
    if p.get("form") == "smooth":
        return nominal * (1.0 + (ratio - 1.0) / (1.0 + math.exp((wanted - act) / p["blur"])))
    return nominal * ratio if wanted < act else nominal


def force_factor(x, q, v, causes):
    """What scales the muscle's force, from states, angle and velocity."""
    factor = 1.0
    if "fatigue" in causes:
        factor *= 1.0 - x["lost"]
    if "potentiation" in causes:
        p = causes["potentiation"]
        level = math.tanh(2.0 * x["level"]) if p.get("form") == "saturating" else x["level"]
        factor *= 1.0 + p["gain"] * level
    if "force_length" in causes:
        factor *= _force_length(q, causes["force_length"])
    if "force_velocity" in causes:
        factor *= _force_velocity(v, causes["force_velocity"])
    return factor


def _force_length(q, p):
    if p.get("form") == "parabola":
        return max(1.0 - ((q - p["best_rad"]) / p["width_rad"]) ** 2, 0.0)
    if p.get("form") == "gaussian":
        return math.exp(-(((q - p["best_rad"]) / p["width_rad"]) ** 2))
    away = q - math.pi / 2
    return math.exp(p["slope_per_rad"] * away - p["curvature_per_rad2"] * away * away)


def _force_velocity(v, p):
    if p.get("form") == "hill":
        if v >= 0.0:
            return max((1.0 - v / p["fastest"]) / (1.0 + v / (p["roundness"] * p["fastest"])), 0.0)
        return 1.0 + 0.5 * math.tanh(-2.0 * v * (1.0 + 1.0 / p["roundness"]) / p["fastest"])
    x = p["slope_s_per_rad"] * v
    if p.get("form") == "exponential":
        return math.exp(-x)
    return 1.0 - x + p.get("bend", 0.0) * x * x


def fatigue_rate(lost, act, p):
    """Rate at which capacity is lost."""
    if p.get("form") == "linear":
        return p["rate_per_s"] * act - lost / p["recovery_s"]
    capacity = 1.0 - lost
    return -((1.0 - capacity) / p["recovery_s"] - p["rate_per_s"] * act * (capacity - 0.35))


def joint_torque(x, q, v, t, causes):
    """Torques (or forces) of everything that acts across the joint, from states, position, velocity and time."""
    total = 0.0
    if "coulomb_friction" in causes:
        p = causes["coulomb_friction"]
        more = 1.0 + p.get("stiction", 0.0) * math.exp(-((v / p.get("stribeck_speed", 1.0)) ** 2))
        if p.get("form") == "tanh":
            share = math.tanh(v / p["sharp"])
        else:
            share = max(-1.0, min(v / p.get("creep_speed", 0.004), 1.0))
        share *= 1.0 + p.get("asymmetry", 0.0) * math.copysign(1.0, v)
        total -= p["torque_nm"] * more * share
    if "cogging" in causes:
        p = causes["cogging"]
        angle = p["waves"] * q
        total += p["in_phase"] * math.sin(angle) + p.get("quadrature", 0.0) * math.cos(angle)
        total += p.get("second", 0.0) * math.sin(2.0 * angle + p.get("phase_rad", 0.0))
    if "quadratic_damping" in causes:
        p = causes["quadratic_damping"]
        total -= p["coefficient"] * math.copysign(abs(v) ** p.get("power", 2.0), v)
    if "joint_stop" in causes:
        p = causes["joint_stop"]
        depth = p.get("side", 1.0) * (q - p["angle_rad"])
        if depth > 0.0:
            total -= p.get("side", 1.0) * p["stiffness"] * depth ** p.get("power", 1.0)
    if "parallel_stiffness" in causes:
        p = causes["parallel_stiffness"]
        away = q - p["rest_angle_rad"]
        total -= p["stiffness_nm_per_rad"] * (away + p.get("hardening_per_rad2", 0.0) * away**3)
    if "passive_relaxation" in causes:
        p = causes["passive_relaxation"]
        total -= p["stiffness_nm_per_rad"] * (q - x["relaxed"])
        if p.get("form") == "two":
            total -= p["stiffness_nm_per_rad"] * (q - x["relaxed_too"])
    if "stretch_reflex" in causes and ("third" in x or "pade" in x):
        p = causes["stretch_reflex"]
        side = p.get("side", 1.0)
        late = x["third"] if "third" in x else _pade(x, p["delay_s"])
        total -= side * p["gain_nms"] * max(side * late, 0.0)
    if "periodic_torque" in causes:
        p = causes["periodic_torque"]
        phase = 2.0 * math.pi * p["frequency_hz"] * t
        total += p["in_phase"] * math.sin(phase) + p.get("quadrature", 0.0) * math.cos(phase)
        total += p.get("second_harmonic", 0.0) * math.sin(2.0 * phase)
    return total


def _pade(x, delay):
    """Pade's (2, 2) delay, (12 - 6 d s + d^2 s^2) / (12 + 6 d s + d^2 s^2), from its states: the input that makes
    the numerator of the filtered signal, whose second rate is the input's share less the rest."""
    pulled = x["v"] - x["pade"] - 0.5 * delay * x["pade_rate"]
    return x["pade"] - 0.5 * delay * x["pade_rate"] + pulled


def reading(value, rate, time, rest, causes):
    """The sensor's reading of an output, all samples at once, from its rate of change. Shape (n,) in and out.

    A first-order lag is a state of the rig and has been applied before; a shift in time is applied here.
    """
    out = np.array(value, dtype=float)
    since = time - time[0]
    if "backlash" in causes:
        out = play(out, causes["backlash"]["half_width"], start=out[0])
    p = causes.get("sensor_lag", {})
    if p.get("form") == "shift":
        out = _later(out, rate, since, p["lag_s"])
    p = causes.get("sensor_nonlinearity")
    if p:
        away = out - rest
        out = out + p["curvature"] * away**2 + p.get("cubic", 0.0) * away**3
    out = rest + (1.0 + causes.get("sensor_gain", {}).get("error", 0.0)) * (out - rest)
    out = out + causes.get("sensor_offset", {}).get("offset", 0.0)
    p = causes.get("sensor_drift")
    if p:
        settling = p.get("settling_s", math.inf)
        ramp = since if math.isinf(settling) else settling * (1.0 - np.exp(-since / settling))
        out = out + p["rate_per_s"] * ramp
    p = causes.get("mains_hum")
    if p:
        phase = 2.0 * math.pi * p.get("frequency_hz", 50.0) * since
        out = out + p["in_phase"] * np.sin(phase) + p.get("quadrature", 0.0) * np.cos(phase)
    return out


def _later(value, rate, since, lag):
    """A sampled signal some time later, by cubic Hermite interpolation; before the first sample it moved as fast."""
    past, known = since - lag, CubicHermiteSpline(since, value, rate)
    return np.where(past < 0.0, value[0] + rate[0] * past, known(np.maximum(past, 0.0)))
