"""A model with all of its effects, as a controller meets it that believes eq. (1): linear about a posture, and running.

The equations are the model's own (`models.compile.equations`); their derivatives are CasADi's. A delay is carried as
past pulses.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import scipy.linalg
import scipy.optimize

from fes_pin.control.dynamics import ANGLES_RAD, PULSE_S, AnkleDynamics
from fes_pin.data.errors import InputError
from fes_pin.models.compile.equations import Tangents
from fes_pin.models.compile.layout import make_layout
from fes_pin.models.effects.coulomb_friction import CoulombFriction
from fes_pin.models.least_squares import least_squares
from fes_pin.models.model import Model
from fes_pin.models.simulate import max_step, total_delay

MOVING = (0.0, 0.3, -0.3)
"""Rates in rad/s that the joint is linear about: at rest, and as it follows a sine of 15 degrees at 0.5 Hz, where what
acts one way only, and dry friction, are others."""
ASIDE = 0.05
"""Share by which the activation is behind the recruitment there: what rises and what falls differs."""
NEWTON_STEPS = 4
HANDLED = ("recruitment_hysteresis", "frame_vibration", "fatigue")
"""Effects that the controller compensates, is tuned for, or watches."""
Sampled = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Transition (n, n) over a pulse, what recruitment adds in it (n,), and what the sensor reads of the state (n,)."""


def held(f: np.ndarray, g: np.ndarray, time_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition (n, n) over a time, and what an input that is held adds in it, (n,), for rates f x + g u."""
    whole = scipy.linalg.expm(np.pad(np.column_stack([f, g]), ((0, 1), (0, 0))) * time_s)
    return whole[:-1, :-1], whole[:-1, -1]


class GivenAnkle:
    """The ankle of a model under one load, with all effects but play, which is undone, and fatigue, which is watched.

    Attributes
    ----------
    names
        Of the effects that eq. (1) of the controller leaves out.

    Raises
    ------
    InputError
        If with its effects the joint rests nowhere.
    """

    def __init__(self, model: Model, dynamics: AnkleDynamics) -> None:
        self.names = tuple(e.name for e in model.effects if e.name not in HANDLED)
        self.dynamics, self.delay_s = dynamics, total_delay(model, model.parameters())
        kept = (e for e in model.effects if e.signal != "delay" and e.name not in ("recruitment_hysteresis", "fatigue"))
        # what gives before it slips is taken as friction that does not: its memory follows the angle within a pulse
        plain = (replace(e, presliding=0.0) if isinstance(e, CoulombFriction) else e for e in kept)
        self.model = Model(model.rig, tuple(plain))
        self.layout = make_layout(self.model, "motion", ("pulse_width_us",), ())
        d = Tangents(self.model, self.layout)
        into = ca.mtimes(ca.jacobian(d.rates, d.m), ca.jacobian(d.after, d.u))
        ins = [d.x, d.m, d.u, d.t, d.since, d.into, d.p, d.c]
        self.rates = ca.Function("rates", ins, [d.rates])
        self.after = ca.Function("after", ins, [d.after])
        self.slopes = ca.Function("slopes", ins, [ca.densify(s) for s in (ca.jacobian(d.rates, d.x), into)])
        self.reading = ca.Function("reading", ins, [d.readings, ca.densify(ca.jacobian(d.readings, d.x))])
        trial: Any = SimpleNamespace(kind="motion", columns={}, conditions={"load_kg": dynamics.load_kg})
        self.pieces = math.ceil(PULSE_S / max_step(self.model))
        timing = {"t0": 0.0, "dt": PULSE_S, "step": PULSE_S / self.pieces, "shift": 0.0}
        self.constants = dict.fromkeys(self.layout.constants, 0.0) | model.rig.trial_constants(trial) | timing
        self.values = self._values()
        balance = ca.Function("balance", [d.z, d.p, d.c], [d.g])
        ends = [float(balance(q, *self.values)) for q in ANGLES_RAD]
        if not ends[0] * ends[1] < 0.0:
            raise InputError(f"with {', '.join(self.names)} the joint rests nowhere between {ANGLES_RAD} rad")
        rest = scipy.optimize.brentq(lambda q: float(balance(q, *self.values)), *ANGLES_RAD)
        begun = ca.Function("begun", [d.z, d.p, d.c], [ca.densify(d.x0), ca.densify(d.m0)])(rest, *self.values)
        self.x0, self.m0 = (np.array(each)[:, 0] for each in begun)

    def _values(self, gain: float = 1.0, slow: float = 1.0, stiff: float = 1.0) -> tuple[list[float], list[float]]:
        """Parameters and constants, with gain, time constant and stiffness times factors."""
        p, c = self.model.parameters(), dict(self.constants)
        p["gain"] *= gain
        p["time_constant_s"] *= slow
        c["f1_per_rad"] *= stiff
        return [p[n] for n in self.layout.values], [c[n] for n in self.layout.constants]

    def moved(self, q: float, factors: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Iterator[Sampled]:
        """What moves at an angle, still and moving, with gain, time constant and stiffness times factors; where the
        stimulus recruits nothing there is no loop, and nothing is given."""
        values = self._values(*factors)
        for v in MOVING:
            slope, into, seen = self._linear(q, v, values)
            if into.any():
                yield self._sampled(slope, into, seen)

    def _linear(self, q: float, v: float, values: tuple[list[float], list[float]]) -> Sampled:
        low, high = self.constants["threshold_us"], self.constants["saturation_us"]
        r = min(max(self.dynamics.activation_for(q), ASIDE), 1.0 - 2.0 * ASIDE)
        u, at = low + r * (high - low), (0.0, 0.0, 0.0, *values)
        x, m, others = self.x0.copy(), self.m0, [k for k in range(len(self.x0)) if k not in (1, 2)]
        x[:3] = r, q, v
        for _ in range(NEWTON_STEPS):
            slope = np.array(self.slopes(x, m, u, *at)[0])
            x[others] -= least_squares(slope[np.ix_(others, others)], np.array(self.rates(x, m, u, *at))[others, 0])
            m = np.array(self.after(x, m, u, *at))[:, 0]
        x[0] *= 1.0 - ASIDE * (v > 0.0) + ASIDE * (v < 0.0)
        slope, into = (np.array(each) for each in self.slopes(x, m, u, *at))
        return slope, (high - low) * into[:, 0], np.array(self.reading(x, m, u, *at)[1])[0]

    def _sampled(self, f: np.ndarray, g: np.ndarray, seen: np.ndarray) -> Sampled:
        """Over a pulse, where each pulse acts later by some whole ones and a part of one."""
        n, whole, late = len(f), *self._late()
        (moved, before), (then, now) = (held(f, g, t) for t in (late, PULSE_S - late))
        a, b = np.zeros((n + whole + 1, n + whole + 1)), np.zeros(n + whole + 1)
        a[:n, :n], a[:n, -1] = then @ moved, then @ before  # states beyond n are past pulses, the latest first
        if whole:
            a[:n, -2] = now
        else:
            b[:n] = now
        b[n], a[n + 1 :, n:-1] = 1.0, np.eye(whole)
        return a, b, np.r_[seen, np.zeros(whole + 1)]

    def _late(self) -> tuple[int, float]:
        whole = math.floor(self.delay_s / PULSE_S + 1e-9)
        return whole, max(self.delay_s - whole * PULSE_S, 0.0)


class RunningAnkle:
    """The model at work, pulse by pulse, from its rest.

    Attributes
    ----------
    angle_rad
        As its sensor reads it.
    """

    def __init__(self, given: GivenAnkle) -> None:
        self.given, self.x, self.m, self.time = given, given.x0, given.m0, 0.0
        self.whole, self.late = given._late()
        self.past = [0.0] * (self.whole + 1)
        self.angle_rad = self._read()

    def _at(self) -> tuple[Any, ...]:
        return self.time, 0.0, 0.0, *self.given.values

    def _read(self) -> float:
        return float(self.given.reading(self.x, self.m, self.past[-1], *self._at())[0])

    def step(self, pulse_width_us: float, dt: float) -> float:
        """Hold a pulse width for `dt` seconds; the reading at the end."""
        self.past.append(pulse_width_us)
        before, now = self.past[:2]
        del self.past[0]
        for width, span in ((before, self.late), (now, dt - self.late)):
            if span > 0.0:
                self._hold(width, span)
        self.angle_rad = self._read()
        return self.angle_rad

    def _hold(self, width: float, span: float) -> None:
        self.m = np.array(self.given.after(self.x, self.m, width, *self._at()))[:, 0]
        count = math.ceil(self.given.pieces * span / PULSE_S)
        h = span / count

        def rates(x: np.ndarray) -> np.ndarray:
            return np.array(self.given.rates(x, self.m, width, *self._at()))[:, 0]

        for _ in range(count):
            k1 = rates(self.x)
            k2 = rates(self.x + 0.5 * h * k1)
            k3 = rates(self.x + 0.5 * h * k2)
            k4 = rates(self.x + h * k3)
            self.x = self.x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            self.time += h
