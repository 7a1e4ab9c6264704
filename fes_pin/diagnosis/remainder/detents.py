"""Test for torque that is periodic in the angle over short distances, as of detents: a scan over its wave number."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fes_pin.identify.fit import Fit
from fes_pin.identify.problem import Problem
from fes_pin.infer.distributions import chi2_quantile, chi2_tail
from fes_pin.infer.projection import Projection
from fes_pin.models.maths import cos, sin
from fes_pin.models.model import Model
from fes_pin.models.parameters import parameter
from fes_pin.models.simulate import Simulator
from fes_pin.models.stage import Effect, Stage

TURN = 2.0 * np.pi
"""rad."""
FEWEST, MOST = 3.0, 30.0
"""Waves within the range of motion: fewer are smooth enough for the library and the polynomials in the angle, more
would be about a degree long on a joint that moves by half a radian."""
STEP = 0.75
"""Between two wave numbers of the scan, waves within the range: three quarters of what the range can resolve."""
AT_ONCE = 4
"""Wave numbers that one simulation carries."""


def _amplitude() -> Any:
    return parameter(0.0, unit="N m", null=0.0, scale=0.01)


@dataclass(frozen=True)
class Ripple(Effect):
    """Torque of four neighbouring wave numbers; a probe, not a cause.

    torque + sum_j  a_j sin((k + j step) q) + b_j cos((k + j step) q)
    """

    a0: float = _amplitude()
    b0: float = _amplitude()
    a1: float = _amplitude()
    b1: float = _amplitude()
    a2: float = _amplitude()
    b2: float = _amplitude()
    a3: float = _amplitude()
    b3: float = _amplitude()
    wave: float = parameter(10.0, unit="1/rad", lower=0.0)
    step: float = parameter(1.0, unit="1/rad", lower=0.0)
    origin: float = parameter(0.0, unit="rad")

    name: ClassVar[str] = "ripple"
    stage: ClassVar[Stage] = Stage.JOINT
    signal: ClassVar[str] = "torque"

    def apply(self, value: Any, s: Any) -> Any:
        for j in range(AT_ONCE):
            phase = (self.wave + j * self.step) * (s.q - self.origin)
            value = value + getattr(self, f"a{j}") * sin(phase) + getattr(self, f"b{j}") * cos(phase)
        return value


def detent_p_value(fitted: Fit, projection: Projection) -> float:
    """Return the p-value of the strongest short wave of torque in the angle; 1 where no joint moves.

    The score of each wave number, in a model whose fitted parameters are free too, is chi-square of two degrees. All
    are divided by their median over its expectation, since noise that is not quite whitened raises them all.
    """
    rig = fitted.model.rig
    moving = ["torque" in rig.signals(t.kind) for t in fitted.trials]
    if not any(moving):
        return 1.0
    low, high = _range(fitted, moving)
    if not high > low:
        return 1.0
    unit = TURN / (high - low)
    model = Model(rig, (Ripple(step=STEP * unit, origin=0.5 * (low + high)),))
    problem = Problem(model, fitted.trials, fitted.noise, tuple(f"{Ripple.name}.{n}" for n in Ripple.amplitudes()))
    values = {n: fitted.values.get(n, v) for n, v in model.parameters().items()}
    scores: list[float] = []
    for wave in np.arange(FEWEST, MOST, STEP * AT_ONCE):
        parts = problem.linearize({**values, f"{Ripple.name}.wave": wave * unit}, fitted.unknowns)
        columns = projection(np.concatenate([p.jacobian for p in parts]))
        scores += [_two(columns[:, 2 * j : 2 * j + 2], projection.residual) for j in range(AT_ONCE)]
    half = float(chi2_quantile(0.5, 2))
    inflation = max(1.0, float(np.median(scores)) / half)
    return min(1.0, len(scores) * float(chi2_tail(max(scores) / inflation, 2)))


def _range(fitted: Fit, moving: list[bool]) -> tuple[float, float]:
    trials = [t for t, m in zip(fitted.trials, moving, strict=True) if m]
    unknowns = [u for u, m in zip(fitted.unknowns, moving, strict=True) if m]
    q = np.concatenate([s.readings[:, 0] for s in Simulator(fitted.model, trials).run(fitted.values, unknowns)])
    return float(np.quantile(q, 0.01)), float(np.quantile(q, 0.99))


def _two(columns: np.ndarray, residual: np.ndarray) -> float:
    """Return the drop in the sum of squares by two columns together."""
    norms = np.linalg.norm(columns, axis=0)
    if not (np.isfinite(norms).all() and norms.min() > 0):
        return 0.0
    x, c = columns.T @ residual / norms, float(columns[:, 0] @ columns[:, 1] / norms.prod())
    return float((x[0] ** 2 + x[1] ** 2 - 2.0 * c * x[0] * x[1]) / max(1.0 - c * c, 1e-6))
