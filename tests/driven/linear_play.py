"""A cause of somebody's own: a play that does not say what it follows, so that a filter takes it for linear."""

from dataclasses import dataclass

from fes_pin.models.effects import Backlash


@dataclass(frozen=True)
class LinearPlay(Backlash):
    """Of its memory the filter knows slopes and spreads alone; its likelihood jumps by hundreds."""

    def slack(self, s):
        return {}
