"""The effort is scaled."""

from dataclasses import dataclass

from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class EffortGain(Effect):
    """The effort is scaled.

        (1 + error) effort

    At error -2 the effort is turned round, which is tried by itself: half-way there nothing acts. Divided by 1 + error
    the equation of motion is that of another inertia, damping and gravity: only where gravity, a spring or the inertia
    is known does the gain show.

    Tell-tale: the joint answers every effort too strongly or too weakly, though it swings by itself as modelled.
    Source: Khalil and Dombre, Modeling, Identification and Control of Robots, 2002: drive gains, which a known load
    calibrates.
    """

    error: float = parameter(
        0.1,
        null=0.0,
        lower=-11.0,
        upper=9.0,
        scale=0.05,
        grid=(-2.0,),
        words=lambda v: "with the wrong sign" * (v < -1.0),
    )

    name, stage, signal, rigs = "effort_gain", Stage.RIG, "effort", ("joint",)
    of_record = True
    scales = True

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return (1.0 + self.error) * value
