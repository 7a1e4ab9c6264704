"""The rigs' equations of motion in plain numpy: many trials side by side, fixed-step Runge-Kutta of order 4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from confusion_matrix.form import Form
from confusion_matrix.stimuli import DT
from fes_pin.paper.equation_1 import static_torque_nm

HOOKS = ("time_constant", "activation", "force", "net_force", "torque", "accelerate")


@dataclass(frozen=True)
class Lanes:
    """Trials that run side by side, L of them.

    Attributes
    ----------
    rig
        The same for all.
    k
        Numbers that the equations read, each of shape (L,): see `Plant.numbers`, and conditions.
    input
        Pulse width or effort at the samples, shape (n, L).
    moving
        False where the joint is held, shape (L,).
    torque
        Random torque at the samples, shape (n, L); or None.
    """

    rig: str
    k: dict[str, np.ndarray]
    input: np.ndarray
    moving: np.ndarray
    torque: np.ndarray | None = None


def simulate(lanes: Lanes, forms: Sequence[Form], steps: int) -> np.ndarray:
    """Noiseless readings at the samples, shape (n, L): angle where the joint moves, else force.

    Parameters
    ----------
    steps
        Integration steps per sample.
    """
    return Run(lanes, forms, steps).readings()


def recruitment(lanes: Lanes, forms: Sequence[Form]) -> np.ndarray:
    """Recruitment at the samples, shape (n, L)."""
    width, k = lanes.input, lanes.k
    time = np.arange(len(width)) * DT
    for form in forms:
        width = form.width(width, time, lanes)
    share = np.clip((width - k["threshold_us"]) / (k["saturation_us"] - k["threshold_us"]), 0.0, 1.0)
    for form in forms:
        share = form.recruit(share)
    return share


class Run:
    """One integration of all lanes."""

    def __init__(self, lanes: Lanes, forms: Sequence[Form], steps: int) -> None:
        self.lanes, self.forms, self.steps, self.h = lanes, forms, steps, DT / steps
        self.s = SimpleNamespace(k=lanes.k, rig=lanes.rig, moving=lanes.moving, h=self.h, t=0.0, x={})
        self.muscled = lanes.rig != "joint"
        self.lates = [late for form in forms for late in form.delays()]
        self.s.tilt = self.s.offset = np.zeros(len(lanes.moving))
        self.s.effort = lanes.input
        self.s.load = lanes.k.get("load_kg")
        for form in forms:
            form.begin(self.s, lanes)
        self.drive = recruitment(lanes, forms) if self.muscled else self.s.effort
        self.names = [(form, name) for form in forms for name in form.states]
        self._rates_of = [form for form in forms if form.states]
        self._passed = self.hooked("passed")
        for hook in HOOKS:
            setattr(self, f"_{hook}", self.hooked(hook))

    def hooked(self, name: str) -> list[Form]:
        """The forms that do something at a place of the path."""
        return [f for f in self.forms if getattr(type(f), name) is not getattr(Form, name)]

    def readings(self) -> np.ndarray:
        n, count = self.drive.shape
        x = self._start(count)
        out = {"y": np.empty((n, count)), "v": np.empty((n, count))}
        for i in range(n):
            self._mark(x, i)
            y = np.where(self.lanes.moving, self.s.q, self.s.force)
            out["y"][i], out["v"][i] = self._sensed(y), self.s.v
            if i + 1 < n:
                for j in range(self.steps):
                    x = self._step(x, i, j)
        return self._read(out["y"], out["v"])

    def _sensed(self, y: np.ndarray) -> np.ndarray:
        for form in self.forms:
            y = form.sensed(y, self.s)
        return y

    def _read(self, y: np.ndarray, v: np.ndarray) -> np.ndarray:
        time, rest = np.arange(len(y)) * DT, y[0].copy()
        bare = y.copy()
        for form in self.forms:
            y = form.reading(y, v, time, rest)
        if self.lanes.rig == "ankle":
            y = np.where(self.lanes.moving, y, bare)
        return y

    def _start(self, count: int) -> np.ndarray:
        k, s = self.lanes.k, self.s
        x = np.zeros((3 + len(self.names), count))
        s.act = s.r = np.zeros(count)
        if self.lanes.rig == "joint":
            x[1], x[2] = k["position0"], k["velocity0"]
        elif self.lanes.rig == "ankle":
            x[1] = np.where(self.lanes.moving, self.equilibrium(count), k["angle_rad"])
        for row, (form, name) in enumerate(self.names, start=3):
            x[row] = form.rest(name, x[1])
        return x

    def equilibrium(self, count: int, activation: float = 0.0) -> np.ndarray:
        """Angle at which the joint rests under its load and an activation, by bisection."""
        low, high = np.full(count, 0.3), np.full(count, 3.0)
        for _ in range(60):
            middle = 0.5 * (low + high)
            x = np.zeros((3 + len(self.names), count))
            x[0], x[1] = activation, middle
            for row, (form, name) in enumerate(self.names, start=3):
                x[row] = form.rest(name, middle)
            self._rates(x, 0.0, np.zeros(count), 0.0)
            up = self.s.joint_torque > 0
            low, high = np.where(up, middle, low), np.where(up, high, middle)
        return 0.5 * (low + high)

    def _held(self, i: int, j: int) -> np.ndarray:
        """The input over one integration step, late where there is a delay: its exact mean."""
        if not self.lates:
            return self.drive[i]
        out = np.zeros(self.drive.shape[1])
        for weight, delay in self.lates:
            whole = np.floor(delay / self.h).astype(int)
            part = delay / self.h - whole
            for share, back in ((1.0 - part, whole), (part, whole + 1)):
                row = (i * self.steps + j - back) // self.steps
                value = self.drive[np.maximum(row, 0), np.arange(len(row))]
                out += weight * share * np.where(row >= 0, value, 0.0)
        return out

    def _mark(self, x: np.ndarray, i: int) -> None:
        self._rates(x, i * DT, self._held(i, 0), 0.0)

    def _step(self, x: np.ndarray, i: int, j: int) -> np.ndarray:
        t, h, r = i * DT + j * self.h, self.h, self._held(i, j)
        push = 0.0 if self.lanes.torque is None else self.lanes.torque[i]
        self.s.sample = i
        for form in self._passed:
            form.passed(x[2], i * self.steps + j)
        a = self._rates(x, t, r, push)
        b = self._rates(x + 0.5 * h * a, t + 0.5 * h, r, push)
        c = self._rates(x + 0.5 * h * b, t + 0.5 * h, r, push)
        d = self._rates(x + h * c, t + h, r, push)
        return x + (h / 6.0) * (a + 2.0 * (b + c) + d)

    def _rates(self, x: np.ndarray, t: float, r: np.ndarray, push: np.ndarray | float) -> np.ndarray:
        s, out = self.s, np.empty_like(x)
        s.act, s.q, s.v, s.r, s.t = x[0], x[1], x[2], r, t
        for row, (form, name) in enumerate(self.names, start=3):
            s.x[form.cause, name] = x[row]
        out[0] = self._muscle(r) if self.muscled else 0.0
        if self.lanes.rig == "muscle":
            s.force_or_angle = s.force
            out[1:3] = 0.0
        else:
            out[1], out[2] = self._joint(push)
        row = 3
        for form in self._rates_of:
            rates = form.rates(s)
            for name in form.states:
                out[row] = rates[name]
                row += 1
        return out

    def _muscle(self, r: np.ndarray) -> np.ndarray:
        s = self.s
        tau = s.k["time_constant"]
        for form in self._time_constant:
            tau = form.time_constant(tau, s)
        drive = s.act
        for form in self._activation:
            drive = form.activation(drive, s)
        s.force = s.k["strength"] * drive
        for form in self._force:
            s.force = form.force(s.force, s)
        return (r - s.act) / tau

    def _joint(self, push: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        s = self.s
        torque = (self._ankle_torque() if self.muscled else self._pendulum_torque()) - s.k["damping"] * s.v + push
        for form in self._torque:
            torque = form.torque(torque, s)
        s.joint_torque = torque
        s.acceleration = torque / s.k["inertia"]
        for form in self._accelerate:
            s.acceleration = form.accelerate(s.acceleration, s)
        if not self.muscled:
            s.force, s.force_or_angle = s.q, s.q
            return s.v, s.acceleration
        s.force_or_angle = s.q
        return s.v * s.moving, s.acceleration * s.moving

    def _ankle_torque(self) -> np.ndarray:
        """Equation (1) of the paper without damping; `load_kg` and `tilt` as the forms left them in `begin`."""
        s, k = self.s, self.s.k
        pull = s.force
        for form in self._net_force:
            pull = form.net_force(pull, s)
        return static_torque_nm(k, s.q, pull, s.load, s.tilt)

    def _pendulum_torque(self) -> np.ndarray:
        s, k = self.s, self.s.k
        weight = k["gravity_cos"] * np.cos(s.q + s.tilt) + k["gravity_sin"] * np.sin(s.q + s.tilt)
        return s.r + s.offset - weight
