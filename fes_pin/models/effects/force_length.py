"""Force depends on the muscle's length."""

from dataclasses import dataclass

from fes_pin.models.maths import exp
from fes_pin.models.stage import Bounds, Effect, Grids, Measured, Scalar, Signals, Stage, parameter, refinement, span


@dataclass(frozen=True)
class ForceLength(Effect):
    """Force depends on the muscle's length.

        F = F_M exp(slope x - curvature x^2 - skew x^3)

    x is how far the joint is from the angle of the largest lever, theta - pi/2, or the fibres of a muscle on a lever
    from the middle of the lengths that were imposed, where the factor is 1.

    Tell-tale: the force is right at one angle and wrong at others, in proportion to activation.
    Source: Zajac, Crit. Rev. Biomed. Eng. 17 (1989): the bell of the active force; a Gaussian centred anywhere. It is
    steeper on the short side: Gordon, Huxley and Julian, J. Physiol. 184 (1966).
    """

    slope_per_rad: float = parameter(0.2, unit="1/{q}", null=0.0, lower=-1e4, upper=1e4, scale=0.1)
    curvature_per_rad2: float = parameter(0.2, unit="1/{q}2", null=0.0, lower=-1e6, upper=1e7, scale=0.2)
    skew_per_rad3: float = refinement(
        0.0, unit="1/{q}3", lower=-1e9, upper=1e9, scale=0.2, rigs=("muscle",), words="steeper on one side"
    )

    name, stage, signal, rigs = "force_length", Stage.MUSCLE, "fibres", ("ankle", "muscle")

    @classmethod
    def grids(cls, measured: Measured) -> Grids:
        """A skew of either sign that shows at the ends of the imposed lengths."""
        way = span(measured, "length_m")
        return {**super().grids(measured), "skew_per_rad3": (2.0 / way**3, -2.0 / way**3) if way > 0.0 else ()}

    def limits(self, measured: Measured) -> Bounds:
        """A joint: within a radian by no more than 10 e-folds up, 30 down; a muscle: as much within the lengths."""
        way = span(measured, "length_m") if "length_m" in measured else 1.0
        return {"slope_per_rad": (-10.0 / way, 10.0 / way), "curvature_per_rad2": (-10.0 / way**2, 30.0 / way**2)}

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        x = getattr(s, "bent", 0.0)
        return value * exp((self.slope_per_rad - (self.curvature_per_rad2 + self.skew_per_rad3 * x) * x) * x)
