"""The ratios k1, k2, k3 of eq. (1) from motion trials, by the least error E of eq. (2).

    k1 = a / J,  k2 = l / J  (1/(kg m)),  k3 = xi / J  (1/s)
    E  = 100 integral (theta_model - theta_actual)^2 / integral (theta_actual - mean theta_actual)^2

Source: Dombre, Fournier and Coiffet, section II-3-2, tables 1 and 2. All of it runs on logarithms of the ratios.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import shortened, whole
from fes_pin.data.show import Tabulated
from fes_pin.data.trial import Trial
from fes_pin.infer.held_out import percent_of_spread
from fes_pin.models.model import Model
from fes_pin.models.rigs import Ankle
from fes_pin.models.simulate import Simulator, max_step
from paper_ankle.twin import AnkleTwin

RATIOS = ("k1", "k2", "k3")
UNITS = {"k1": "1/(kg m)", "k2": "1/(kg m)", "k3": "1/s"}
OUTPUT = "angle_rad"
REACH = 20.0
"""Farthest that a ratio is followed from its start, as a factor; the integration step resolves a damping so large."""


def error_percent(measured: Sequence[np.ndarray], simulated: Sequence[np.ndarray]) -> float:
    """E of eq. (2) in percent, pooled over trials.

    Parameters
    ----------
    measured, simulated
        One array of shape (n,) for each trial.
    """
    wrong = [float(np.sum((m - s) ** 2)) for m, s in zip(measured, simulated, strict=True)]
    return percent_of_spread(wrong, [float(np.sum((m - m.mean()) ** 2)) for m in measured])


def ankle_of(twin: AnkleTwin) -> Model:
    """The nominal model that knows all of a twin that eq. (1) has: its truth, where nothing else acts."""
    rig = Ankle(
        constants=twin.constants(),
        gain=twin.gain,
        time_constant_s=twin.time_constant_s,
        inertia_kgm2=twin.inertia_kgm2,
        damping_nms=twin.damping_nms,
    )
    return Model(rig)


class RatioProblem:
    """E of a model on motion trials as a function of the ratios, with exact sensitivities.

    The muscle (gain, time constant) and F_ANT are known from other trials, as in the paper. Moving k1, k2 and k3 moves
    the model's gain, inertia and damping: gain = K (k1 / k2) (l / a), inertia = l / k2, damping = k3 l / k2.

    Parameters
    ----------
    model
        An ankle, with effects or without; its parameters hold the known muscle, and the start of the ratios.
    trials
        Motion trials.
    known_gain
        K, if the model's own gain is not it but a start.

    Raises
    ------
    InputError
        For another rig, or trials that hold the joint.
    """

    def __init__(self, model: Model, trials: Sequence[Trial], known_gain: float | None = None) -> None:
        if not isinstance(model, Model):
            raise InputError(f"expected a model, found {shortened(model)}", column="model")
        if not isinstance(model.rig, Ankle):
            raise InputError(f"k1, k2 and k3 belong to the rig ankle, found {model.rig.name}")
        if not trials or any(t.kind != "motion" for t in trials):
            raise InputError("expected one or more motion trials to find k1, k2 and k3 from")
        self.model, self.trials = model, tuple(trials)
        self.known = model.parameters()
        start_gain, self.known["gain"] = self.known["gain"], known_gain or self.known["gain"]
        self.boost = start_gain / self.known["gain"]
        constants = model.rig.constants
        self.lever, self.arm = float(constants["com_distance_m"]), float(constants["moment_arm_m"])
        # RK4 is stable to 2.78 (Hairer and Wanner, Solving ODEs II, IV.2); the fastest decay is k3
        step = min(max_step(model), 2.0 / (REACH * float(np.exp(self.start[2]))))
        self.simulator = Simulator(model, self.trials, ("gain", "inertia_kgm2", "damping_nms"), step)
        self.spread = sum(float(np.sum((t[OUTPUT] - t[OUTPUT].mean()) ** 2)) for t in self.trials)

    @property
    def start(self) -> np.ndarray:
        """Logarithms of the ratios of the model as given."""
        v = self.known
        return np.log(np.array([self.arm * self.boost, self.lever, v["damping_nms"]]) / v["inertia_kgm2"])

    def values(self, x: np.ndarray) -> dict[str, float]:
        """The model's parameters at log-ratios x, shape (3,)."""
        k1, k2, k3 = np.exp(x)
        inertia = self.lever / k2
        return {
            **self.known,
            "gain": float(self.known["gain"] * k1 * inertia / self.arm),
            "inertia_kgm2": float(inertia),
            "damping_nms": float(k3 * inertia),
        }

    def model_at(self, x: np.ndarray) -> Model:
        """The model with these log-ratios."""
        return self.model.with_parameters(self.values(x))

    def residual(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Measured minus simulated angle, shape (n,), and its derivative by the log-ratios, shape (n, 3)."""
        values = self.values(x)
        # by rows: d gain, d inertia, d damping over d log k1, d log k2, d log k3
        gain, inertia, damping = values["gain"], values["inertia_kgm2"], values["damping_nms"]
        chain = np.array([[gain, -gain, 0.0], [0.0, -inertia, 0.0], [0.0, -damping, damping]])
        r, s = [], []
        for trial, simulated in zip(self.trials, self.simulator.run(values), strict=True):
            r.append(trial[OUTPUT] - simulated.readings[:, 0])
            s.append(simulated.sensitivities[:, 0] @ chain)
        return np.concatenate(r), -np.concatenate(s)

    def error(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """E in percent and its gradient, shape (3,)."""
        r, s = self.residual(x)
        scale = 100.0 / self.spread
        return scale * float(r @ r), 2.0 * scale * (s.T @ r)

    def curvature(self, x: np.ndarray) -> np.ndarray:
        """Gauss-Newton Hessian of E, shape (3, 3)."""
        _, s = self.residual(x)
        return 200.0 / self.spread * (s.T @ s)


@dataclass(frozen=True, eq=False)
class Optimum(Tabulated):
    """The point of least E.

    Attributes
    ----------
    x
        Logarithms of the ratios, shape (3,).
    error_percent
        E there.
    curvature
        Gauss-Newton Hessian of E there, shape (3, 3).
    gradient_norm
        Largest part of E that a Newton step of one ratio alone still predicts, percent.
    """

    x: np.ndarray
    error_percent: float
    curvature: np.ndarray
    gradient_norm: float

    @property
    def ratios(self) -> dict[str, float]:
        """k1, k2, k3 by name."""
        return dict(zip(RATIOS, (float(v) for v in np.exp(self.x)), strict=True))


def least_error(problem: RatioProblem, starts: int = 5, seed: int = 0) -> Optimum:
    """The ratios of least E, the best of one or more starts within a factor of two of the problem's own.

    Raises
    ------
    InputError
        For fewer starts than one.
    """
    starts = whole(starts, "starts", least=1)
    rng = np.random.default_rng(seed)
    best = None
    for k in range(starts):
        begin = problem.start + (0.0 if k == 0 else rng.uniform(-np.log(2.0), np.log(2.0), 3))
        found = scipy.optimize.least_squares(
            lambda x: problem.residual(x)[0],
            begin,
            jac=lambda x: problem.residual(x)[1],
            bounds=(problem.start - np.log(REACH), problem.start + np.log(REACH)),
            xtol=1e-12,
            ftol=1e-12,
            gtol=1e-12,
        )
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    error, gradient = problem.error(best.x)
    curvature = problem.curvature(best.x)
    return Optimum(best.x, error, curvature, float(np.max(0.5 * gradient**2 / np.diag(curvature))))
