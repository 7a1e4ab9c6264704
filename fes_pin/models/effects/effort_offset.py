"""A constant effort added to the commanded one."""

from dataclasses import dataclass

from fes_pin.models.stage import Effect, Scalar, Signals, Stage, parameter


@dataclass(frozen=True)
class EffortOffset(Effect):
    """A constant effort in addition to the commanded one.

        effort + offset

    Tell-tale: the joint drifts or rests to one side though nothing is commanded.
    Source: Khalil and Dombre, Modeling, Identification and Control of Robots, 2002: the offset of a drive's current
    loop.
    """

    offset: float = parameter(0.01, unit="{effort}", null=0.0, lower=-1e6, upper=1e6, scale=0.01)

    name, stage, signal, rigs = "effort_offset", Stage.JOINT, "effort", ("joint",)
    of_record = True

    def apply(self, value: Scalar, s: Signals) -> Scalar:
        return value + self.offset
