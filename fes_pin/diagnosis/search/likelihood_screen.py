"""Score tests of every cause in a fit by the likelihood, from one linearization of each cause."""

import math

import numpy as np

from fes_pin.diagnosis.search.cause_sets import names_of
from fes_pin.diagnosis.search.library import Library, Probe
from fes_pin.diagnosis.search.score import Scores, score_test
from fes_pin.identify.likelihood import LikelihoodProblem, is_simulated
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.problem import completed
from fes_pin.models.model import Model
from fes_pin.models.stage import Effect
from fes_pin.workers import in_parallel


class LikelihoodScreen:
    """Scores of the causes of a library."""

    def __init__(self, library: Library) -> None:
        self._library = library
        self._scores: dict[int, tuple[LikelihoodFit, Scores]] = {}
        self._probing: dict[tuple, LikelihoodProblem] = {}

    def scores(self, base: LikelihoodFit) -> Scores:
        """Return score tests of every effect that a fit does not have, at its noise; none in a fit that diverges."""
        if not math.isfinite(base.sse):
            return Scores([], np.zeros((0, 0)), np.zeros(0), [])
        if id(base) not in self._scores:
            wanted = [e for e in self._library.effects if e.name not in names_of(base) and self._library.felt(e)]
            groups = in_parallel(lambda e: self._probes(e, base), wanted)
            self._scores[id(base)] = (base, score_test(base.parts, [p for g in groups for p in g]))
        return self._scores[id(base)][1]

    def _probes(self, effect: type[Effect], base: LikelihoodFit) -> list[Probe]:
        """Return the effect with every choice of its shapes, linearized at the nominal parameters of a fit.

        Causes of the fit are left out, except those of `screened_with`: the predictor follows the readings with or
        without them.
        """
        nominal = Model(base.model.rig, tuple(e for e in base.model.effects if e.name in effect.screened_with))
        out, simulated = [], is_simulated(base.noise, self._library.trials)
        for one in self._library.grid(effect):
            key = (*(nominal + one).structure(), *(nominal + one).unused_parameters().items(), simulated)
            if key not in self._probing:  # its columns are those of a fit, which shares the program
                self._probing[key] = LikelihoodProblem(nominal + one, self._library.trials, base.noise)
            problem = self._probing[key]
            places = [problem.free.index(f"{effect.name}.{n}") for n in effect.amplitudes()]
            problem.noise = base.noise
            unknowns = completed(problem.start_unknowns(), base.unknowns)
            parts = problem.linearize((nominal + one).parameters(), unknowns)
            out.append(Probe(one, np.nan_to_num(np.concatenate([p.jacobian[:, places] for p in parts]))))
        return out
