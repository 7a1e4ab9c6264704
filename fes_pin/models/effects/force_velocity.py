"""Force depends on the shortening velocity, in proportion to activation."""

from dataclasses import dataclass

from fes_pin.models.maths import sqrt, where
from fes_pin.models.stage import Bounds, Effect, Grids, Measured, Scalar, Signals, Stage, parameter, refinement

PLATEAU = 2.0
"""1 / (1.5 - 1): a stretched muscle bears half more than its isometric force at most, until data show another: van
Soest and Bobbert, Biol. Cybern. 69 (1993)."""
SMALL = 1e-30
"""Keeps the quadratic's second form finite where the hyperbola is a straight line."""


@dataclass(frozen=True)
class ForceVelocity(Effect):
    """Force depends on the shortening velocity, in proportion to activation.

        F = F_M (1 - x + bend x^2)      a joint that is free, on ankle
        F = F_M (1 - x / (1 + hill)) / (1 + hill x / (1 + hill)),   x > 0      imposed motion
        F = F_M (1 - x / (1 - plateau x)),   x < 0      imposed motion
        x = slope v,   v > 0   shortens the muscle

    Hill's hyperbola with the slope at rest as its measure: it ends at the speed (1 + hill) / slope, and a muscle that
    is stretched comes to bear 1 + 1 / plateau of its isometric force. Each branch is a straight line at 0.

    Tell-tale: fast motion under stimulation is damped, the same motion without it is not.
    Source: Hill, Proc. R. Soc. B 126 (1938), hill = F_0 / a about 4; lengthening: Katz, J. Physiol. 96 (1939). On a
    free joint the hyperbola near rest, with bend about hill: what the muscle moves is slow.
    """

    slope_s_per_rad: float = parameter(0.05, unit="s/{q}", null=0.0, lower=-100.0, upper=1e4, scale=0.05)
    bend: float = refinement(
        0.0, lower=-20.0, upper=20.0, scale=0.5, grid=(0.5,), rigs=("ankle",), words="along a curve"
    )
    hill: float = refinement(0.0, lower=0.0, upper=20.0, scale=1.0, words="along Hill's hyperbola")
    plateau: float = refinement(
        PLATEAU, lower=0.0, upper=20.0, scale=1.0, words="with another limit where the muscle is stretched"
    )

    name, stage, signal, rigs = "force_velocity", Stage.MUSCLE, "fibres", ("ankle", "muscle")

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """Hill's branches where the motion is imposed, which may be fast; else the bend."""
        if not {"length_m", "torque_nm"} & set(measured):
            return super().grids(measured)
        return {**super().grids(measured), "bend": (), "hill": (4.0,), "plateau": (1.0, 4.0)}

    def limits(self, measured: Measured) -> Bounds:
        """Return bounds, for a joint down to half a radian a second; in imposed motion a muscle is damped only."""
        if "length_m" in measured:
            return {"slope_s_per_rad": (0.0, 1e4)}
        return {"slope_s_per_rad": (0.0 if "torque_nm" in measured else -0.5, 2.0)}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        """Return the effort of a joint; a muscle on a lever has its fibres' speed from `balanced`, and v = 0 here."""
        if s.kind == "imposed":
            return value * self.factor(s.v)
        x = self.slope_s_per_rad * s.v
        return value * (1.0 - x + self.bend * x * x)

    def factor(self, speed: Scalar) -> Scalar:
        """Share of the isometric force at a shortening speed."""
        x, rest = self.slope_s_per_rad * speed, 1.0 / (1.0 + self.hill)
        shortening = (1.0 - rest * x) / (1.0 + self.hill * rest * where(x > 0.0, x, 0.0))
        return where(x > 0.0, shortening, 1.0 - x / (1.0 - self.plateau * where(x < 0.0, x, 0.0)))

    def balanced(self, force: Scalar, at_rest: Scalar, slope: Scalar) -> Scalar:
        """The shortening speed u at which force * factor(u) = at_rest + slope u: roots of two quadratics."""
        k, rest = self.slope_s_per_rad, 1.0 / (1.0 + self.hill)
        lack = force - at_rest
        up = where(lack > 0.0, lack, 0.0)
        faster = _root(slope * self.hill * rest * k, slope + rest * k * (force + self.hill * at_rest), up)
        down = where(lack < 0.0, -lack, 0.0)
        slower = _root(
            slope * self.plateau * k, slope - at_rest * self.plateau * k + force * (self.plateau + 1.0) * k, down
        )
        return where(lack > 0.0, faster, -slower)


def _root(a: Scalar, b: Scalar, c: Scalar) -> Scalar:
    """The positive root of a u^2 + b u = c, for a and c not below 0."""
    size = sqrt(b * b + 4.0 * a * c + SMALL)
    return where(b > 0.0, 2.0 * c / (size + where(b > 0.0, b, 0.0)), (size - b) / (2.0 * a + SMALL))
