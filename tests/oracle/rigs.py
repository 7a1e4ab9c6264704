"""The three rigs as first-order systems of plain numbers: names of states, rest, rates, outputs."""

import math

import numpy as np
from scipy.optimize import brentq

from fes_pin.paper.equation_1 import static_torque_nm
from oracle.causes import fatigue_rate, force_factor, joint_torque, time_constant


def _summed(act, p):
    """What pulses come to together."""
    if p is None:
        return act
    bound = act * math.sqrt(act * act + 1e-6) ** p.get("cooperation", 0.0)
    return (1.0 + p["saturation"]) * bound / (1.0 + p["saturation"] * bound)


class _Muscle:
    """Activation and what follows it, for any rig that has a muscle."""

    def muscle_names(self):
        c = self.causes
        names = ["act"]
        names += ["second"] if "second_order_activation" in c else []
        names += ["lost"] if "fatigue" in c else []
        names += ["level"] if "potentiation" in c else []
        return names + (["spill"] if c.get("antagonist_spillover", {}).get("lag_s") else [])

    def muscle_rates(self, x, q, v, held, strength):
        """Rates of the muscle's states and its force."""
        c, act, wanted = self.causes, x["act"], held["r"]
        tau = time_constant(self.nominal["time_constant_s"], wanted, act, c)
        rates = {"act": (wanted - act) / tau}
        drive = summed = _summed(act, c.get("pulse_summation"))
        if "second_order_activation" in c:
            drive = x["second"]
            rates["second"] = (summed - drive) / c["second_order_activation"]["second_s"]
        if "fatigue" in c:
            rates["lost"] = fatigue_rate(x["lost"], act, c["fatigue"])
        if "potentiation" in c:
            rates["level"] = (act - x["level"]) / c["potentiation"]["decay_s"]
        if "spill" in x:
            rates["spill"] = (held["spilt"] - x["spill"]) / c["antagonist_spillover"]["lag_s"]
        return rates, strength * drive * force_factor(x, q, v, c)


class _Moving:
    """What a joint has beside its own position and velocity."""

    def joint_names(self):
        c = self.causes
        names = ["q", "v"]
        relaxes = c.get("passive_relaxation")
        names += ["relaxed"] if relaxes else []
        names += ["relaxed_too"] if relaxes and relaxes.get("form") == "two" else []
        reflex = c.get("stretch_reflex")
        names += (
            {None: ["pade", "pade_rate"], "lags": ["first", "middle", "third"], "pure": []}[reflex.get("form")]
            if reflex
            else []
        )
        names += ["frame", "frame_rate"] if "frame_vibration" in c else []
        return names + (["read"] if self.lags() else [])

    def lags(self):
        """True if the sensor is a first-order low pass."""
        return "sensor_lag" in self.causes and self.causes["sensor_lag"].get("form") != "shift"

    def joint_rates(self, x, t, torque, inertia, moved=0.0):
        """Rates of the joint's states from its torque, its inertia and a mass that moves with l sin(q)."""
        c, q, v = self.causes, x["q"], x["v"]
        rates = {"q": v}
        torque += joint_torque(x, q, v, t, c) + self.late_reflex(t)
        torque -= moved * math.sin(q) * math.cos(q) * v * v
        acceleration = torque / (inertia + moved * math.sin(q) ** 2)
        if "frame_vibration" in c:
            p = c["frame_vibration"]
            omega = 2.0 * math.pi * p["frequency_hz"]
            pull = -(omega**2) * x["frame"] - 2.0 * p["damping_ratio"] * omega * x["frame_rate"]
            frame = pull - p["coupling"] * acceleration
            rates |= {"frame": x["frame_rate"], "frame_rate": frame}
            acceleration -= frame
        rates["v"] = acceleration
        if "passive_relaxation" in c:
            p = c["passive_relaxation"]
            rates["relaxed"] = (q - x["relaxed"]) / p["relaxation_s"]
            if "relaxed_too" in x:
                rates["relaxed_too"] = (q - x["relaxed_too"]) / (8.0 * p["relaxation_s"])
        if "pade" in x:
            delay = c["stretch_reflex"]["delay_s"]
            rates["pade"] = x["pade_rate"]
            rates["pade_rate"] = (v - x["pade"] - 0.5 * delay * x["pade_rate"]) * 12.0 / delay**2
        if "third" in x:
            third = c["stretch_reflex"]["delay_s"] / 3.0
            rates["first"] = (v - x["first"]) / third
            rates["middle"] = (x["first"] - x["middle"]) / third
            rates["third"] = (x["middle"] - x["third"]) / third
        if "read" in x:
            rates["read"] = (q - x["read"]) / c["sensor_lag"]["lag_s"]
        return rates

    def late_reflex(self, t):
        """Torque of a reflex with a pure delay, from the velocities that have been."""
        p = self.causes.get("stretch_reflex")
        if not p or p.get("form") != "pure":
            return 0.0
        past = np.interp(t - p["delay_s"], self.times, self.speeds, left=0.0)
        side = p.get("side", 1.0)
        return -side * p["gain_nms"] * max(side * past, 0.0)

    def passed(self, t, x):
        """Remember the velocity at the end of a piece."""
        self.times.append(t)
        self.speeds.append(x[self.names.index("v")])

    def joint_outputs(self, x, column):
        read = x.get("read", x["q"])
        return {column: (read, x["v"], x["q"][0], True)}


class Ankle(_Muscle, _Moving):
    """Equation (1) of the paper; held still in an isometric trial."""

    def __init__(self, constants, nominal, causes, trial):
        self.k, self.nominal, self.causes = constants, nominal, causes
        self.moves = trial.kind == "motion"
        self.held_at = None if self.moves else trial.conditions["angle_rad"]
        error = causes.get("load_error", {}).get("error", 0.0)
        self.load = trial.conditions["load_kg"] * (1.0 + error) if self.moves else 0.0
        self.names = self.muscle_names() + (self.joint_names() if self.moves else [])
        self.times, self.speeds = [0.0], [0.0]

    def static(self, q, force):
        """Torque of cable, antagonist and gravity."""
        tilt = self.causes.get("base_tilt", {}).get("tilt_rad", 0.0)
        return static_torque_nm(self.k, q, force, self.load, tilt)

    def rest(self):
        if not self.moves:
            return [0.0] * len(self.names)

        def torque(q):
            still = dict.fromkeys(self.names, 0.0) | {"relaxed": q, "relaxed_too": q}
            return self.static(q, 0.0) + joint_torque(still, q, 0.0, 0.0, self.causes)

        q = brentq(torque, 0.2, 3.0, xtol=1e-14, rtol=1e-14)
        still = dict.fromkeys(self.names, 0.0)
        still |= {n: q for n in ("q", "relaxed", "relaxed_too", "read") if n in still}
        return [still[n] for n in self.names]

    def rates(self, t, vector, held):
        x = dict(zip(self.names, vector.tolist(), strict=True))
        q, v = (x["q"], x["v"]) if self.moves else (self.held_at, 0.0)
        strength = self.nominal["gain"] * self.k["force_scale_n"]
        rates, force = self.muscle_rates(x, q, v, held, strength)
        if self.moves:
            antagonist = x.get("spill", held.get("spilt", 0.0))
            force -= self.causes.get("antagonist_spillover", {}).get("share", 0.0) * strength * antagonist
            torque = self.static(q, force) - self.nominal["damping_nms"] * v + held.get("disturbance", 0.0)
            share = self.causes.get("load_inertia", {}).get("share", 0.0)
            moved = share * self.load * self.k["com_distance_m"] ** 2
            rates |= self.joint_rates(x, t, torque, self.nominal["inertia_kgm2"], moved)
        return [rates[n] for n in self.names]

    def passed(self, t, x):
        if self.moves:
            super().passed(t, x)

    def outputs(self, x):
        if self.moves:
            return self.joint_outputs(x, "angle_rad")
        force = self.nominal["gain"] * self.k["force_scale_n"] * x.get("second", x["act"])
        factors = [
            force_factor({n: v[k] for n, v in x.items()}, self.held_at, 0.0, self.causes) for k in range(len(force))
        ]
        return {"force_n": (force * np.array(factors), None, 0.0, False)}


class Joint(_Moving):
    """A body on one joint: `inertia`, `gravity_cos`, `gravity_sin` as of a pendulum, or a slide (`revolute` 0)."""

    def __init__(self, constants, nominal, causes, trial):
        self.k, self.nominal, self.causes = constants, {"gravity_scale": 1.0} | nominal, causes
        self.start = (trial.conditions["position0"], trial.conditions["velocity0"])
        self.names = self.joint_names()
        self.times, self.speeds = [0.0], [self.start[1]]

    def rest(self):
        q, v = self.start
        values = dict.fromkeys(self.names, 0.0) | {"q": q, "v": v}
        values |= {n: q for n in ("relaxed", "relaxed_too") if n in values}
        if "read" in values:
            values["read"] = q - self.causes["sensor_lag"]["lag_s"] * v  # it moved as fast before
        return [values[n] for n in self.names]

    def rates(self, t, vector, held):
        x = dict(zip(self.names, vector.tolist(), strict=True))
        tilt = self.causes.get("base_tilt", {}).get("tilt_rad", 0.0)
        angle = (x["q"] if self.k["revolute"] else 0.0) + tilt
        weight = self.k["gravity_cos"] * math.cos(angle) + self.k["gravity_sin"] * math.sin(angle)
        effort = held.get("effort", 0.0) + self.causes.get("effort_offset", {}).get("offset", 0.0)
        effort *= 1.0 + self.causes.get("effort_gain", {}).get("error", 0.0)
        torque = effort - self.nominal["gravity_scale"] * weight - self.nominal["damping"] * x["v"]
        torque += held.get("disturbance", 0.0)
        rates = self.joint_rates(x, t, torque, self.nominal["inertia_scale"] * self.k["inertia"])
        return [rates[n] for n in self.names]

    def outputs(self, x):
        return self.joint_outputs(x, "position") | {"velocity": (x["v"], None, 0.0, False)}


class Muscle(_Muscle):
    """An isometric muscle."""

    def __init__(self, constants, nominal, causes, trial):
        self.k, self.nominal, self.causes = constants, nominal, causes
        lag = causes.get("sensor_lag")
        self.lagged = bool(lag) and lag.get("form") != "shift"
        self.names = self.muscle_names() + (["read"] if self.lagged else [])

    def rest(self):
        return [0.0] * len(self.names)

    def rates(self, t, vector, held):
        x = dict(zip(self.names, vector.tolist(), strict=True))
        rates, force = self.muscle_rates(x, 0.0, 0.0, held, self.nominal["gain"])
        if self.lagged:
            rates["read"] = (force - x["read"]) / self.causes["sensor_lag"]["lag_s"]
        return [rates[n] for n in self.names]

    def passed(self, t, x):
        """Nothing to remember."""

    def outputs(self, x):
        force = np.array(
            [
                self.nominal["gain"]
                * one.get("second", _summed(one["act"], self.causes.get("pulse_summation")))
                * force_factor(one, 0.0, 0.0, self.causes)
                for one in ({n: v[k] for n, v in x.items()} for k in range(len(x["act"])))
            ]
        )
        return {"force_n": (x.get("read", force), np.gradient(force), 0.0, True)}
