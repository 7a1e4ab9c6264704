"""Candidate causes of a fitted model: sensitivities to each effect at its null, over its shapes, and score tests."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood import LikelihoodProblem, is_simulated
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.problem import answered_columns, measured_columns
from fes_pin.infer.problem import Unknowns, completed
from fes_pin.infer.scoring import LITTLE
from fes_pin.models.catalogue import installed
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.stage import Effect, Stage
from fes_pin.search.score import Scores, score_test
from fes_pin.search.starts import near_null
from fes_pin.workers import in_parallel


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
        self.model, self.trials = model, tuple(trials)
        self.measured = (answered_columns if answered else measured_columns)(model, trials)
        self._scores: list[tuple[LikelihoodFit, Scores]] = []
        self._probing: dict[tuple, LikelihoodProblem] = {}

    def grid(self, effect: type[Effect]) -> list[Effect]:
        """Return the effect at its null with every combination of its shapes, in every form that a screen tries."""
        grids = effect.bounded(effect.grids(self.measured))
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

    def scores(self, base: LikelihoodFit) -> Scores:
        """Return score tests of every effect that a fit does not have, at its noise; none in a fit that diverges.

        A fit that is as likely as one before, in the same form, has its scores.
        """
        known = next((scores for one, scores in self._scores if is_as_likely(base, one)), None)
        if known is None:
            finite = math.isfinite(base.sse)
            wanted = [e for e in self.effects if finite and e.name not in base.names and self.felt(e)]
            groups = in_parallel(lambda e: self._probes(e, base), wanted)
            known = score_test(base.parts, [p for g in groups for p in g])
            self._scores.append((base, known))
        return known

    def _probes(self, effect: type[Effect], base: LikelihoodFit) -> list[tuple[Effect, np.ndarray]]:
        """Return the effect with every choice of its shapes, linearized at the nominal parameters of a fit."""
        forms, at = self.grid(effect), (base.model, base.noise, base.unknowns)
        return [(one, np.nan_to_num(np.concatenate(self.sensitivities(one, *at)))) for one in forms]

    def sensitivities(
        self, one: Effect, model: Model, noise: StateSpaceNoise, unknowns: Unknowns
    ) -> Sequence[np.ndarray]:
        """Return the whitened sensitivities of each trial to the amplitudes of a cause, shape (m, amplitudes).

        Other causes of the model are left out, except those of `screened_with`: the predictor follows the readings with
        or without them. A cause of the reading has them all, as their torques change with the reading.
        """
        kept = tuple(e for e in model.effects if one.stage is Stage.SENSOR or e.is_fault or e.name in one.screened_with)
        extended = Model(model.rig, kept) + one
        key = (*extended.structure(), *extended.unused_parameters().items(), is_simulated(noise, self.trials))
        if key not in self._probing:  # its columns are those of a fit, which shares the program
            self._probing[key] = LikelihoodProblem(extended, self.trials, noise)
        problem = self._probing[key]
        places = [problem.free.index(f"{one.name}.{n}") for n in one.amplitudes()]
        problem.noise = noise
        parts = problem.linearize(extended.parameters(), completed(problem.start_unknowns(), unknowns))
        return [p.jacobian[:, places] for p in parts]


def is_as_likely(one: LikelihoodFit, other: LikelihoodFit) -> bool:
    """Return whether two fits of the same data in the same form differ by less than any test sees."""
    if one is other:
        return True
    forms = [
        (f.names, f.free, f.noise.correlation_s, [*f.noise.time], f.noise.timed, f.noise.slowest_s)
        for f in (one, other)
    ]
    orders = [{n: len(a) for n, a in f.noise.ar.items()} for f in (one, other)]
    near = abs(one.sse - other.sse) < LITTLE and forms[0] == forms[1] and orders[0] == orders[1]
    return near and one.trials == other.trials
