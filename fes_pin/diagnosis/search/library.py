"""Candidate causes of a fitted model: sensitivities to each effect at its null, over its shapes."""

import itertools
from collections.abc import Sequence
from typing import Any

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.search.starts import near_null
from fes_pin.identify.problem import answered_columns, measured_columns
from fes_pin.models.catalogue import installed
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect


class Library:
    """The causes that a rig can have, ready to be linearized on trials.

    Parameters
    ----------
    effects
        The causes that are searched; by default all that are known for the rig.
    answered
        Whether the rig is in closed loop: its effort follows its reading; see `answered_columns`.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        effects: Sequence[type[Effect]] | None = None,
        answered: bool = False,
    ) -> None:
        self.effects = tuple(installed().effects_for(model.rig) if effects is None else effects)
        self.model, self.trials = Model(model.rig), tuple(trials)
        self.measured = (answered_columns if answered else measured_columns)(model, trials)

    def grid(self, effect: type[Effect]) -> list[Effect]:
        """Return the effect at its null with every combination of its shapes, in every form that a screen tries."""
        grids = effect.grids(self.measured)
        shapes = effect.shapes()
        start: dict[str, Any] = {n: near_null(effect, n) for n in effect.amplitudes()}
        return [
            effect(**{**start, **dict(zip(shapes, values, strict=True)), **form})
            for form in effect.forms(self.measured)
            for values in itertools.product(*(grids[n] for n in shapes))
        ]

    def not_excited(self) -> tuple[str, ...]:
        """Return the effects that act in none of the trials, as those of a joint where all trials are isometric."""
        return tuple(e.name for e in self.effects if not self.felt(e))

    def felt(self, effect: type[Effect]) -> list[int]:
        """Return the trials in which an effect acts."""
        rig = self.model.rig
        return [i for i, t in enumerate(self.trials) if effect.signal in rig.changeable(t.kind, rig.input_columns(t))]
