"""Score tests of every cause in a fit by the likelihood, from one linearization of each cause."""

import math
from collections.abc import Sequence

import numpy as np

from fes_pin.diagnosis.search.cause_sets import names_of
from fes_pin.diagnosis.search.library import Library
from fes_pin.diagnosis.search.score import Scores, score_test
from fes_pin.identify.likelihood import LikelihoodProblem, is_simulated
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.problem import Unknowns, completed
from fes_pin.models.model import Model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel


class LikelihoodScreen:
    """Scores of the causes of a library."""

    def __init__(self, library: Library) -> None:
        self._library = library
        self._scores: dict[LikelihoodFit, Scores] = {}
        self._probing: dict[tuple, LikelihoodProblem] = {}

    def scores(self, base: LikelihoodFit) -> Scores:
        """Return score tests of every effect that a fit does not have, at its noise; none in a fit that diverges."""
        if not math.isfinite(base.sse):
            return Scores([], np.zeros((0, 0)), [])
        if base not in self._scores:
            wanted = [e for e in self._library.effects if e.name not in names_of(base) and self._library.felt(e)]
            groups = in_parallel(lambda e: self._probes(e, base), wanted)
            self._scores[base] = score_test(base.parts, [p for g in groups for p in g])
        return self._scores[base]

    def _probes(self, effect: type[Effect], base: LikelihoodFit) -> list[tuple[Effect, np.ndarray]]:
        """Return the effect with every choice of its shapes, linearized at the nominal parameters of a fit."""
        forms, at = self._library.grid(effect), (base.model, base.noise, base.unknowns)
        return [(one, np.nan_to_num(np.concatenate(self.sensitivities(one, *at)))) for one in forms]

    def sensitivities(
        self, one: Effect, model: Model, noise: StateSpaceNoise, unknowns: Unknowns
    ) -> Sequence[np.ndarray]:
        """Return the whitened sensitivities of each trial to the amplitudes of a cause, shape (m, amplitudes).

        Causes of the model are left out, except those of `screened_with`: the predictor follows the readings with or
        without them.
        """
        extended = Model(model.rig, tuple(e for e in model.effects if e.name in one.screened_with)) + one
        key = (*extended.structure(), *extended.unused_parameters().items(), is_simulated(noise, self._library.trials))
        if key not in self._probing:  # its columns are those of a fit, which shares the program
            self._probing[key] = LikelihoodProblem(extended, self._library.trials, noise)
        problem = self._probing[key]
        places = [problem.free.index(f"{one.name}.{n}") for n in one.amplitudes()]
        problem.noise = noise
        parts = problem.linearize(extended.parameters(), completed(problem.start_unknowns(), unknowns))
        return [p.jacobian[:, places] for p in parts]
