"""What could be told of a study at most: by one who knows its noise, and that one cause at most is hidden in it.

The noise of a diagnosis is learned beside whatever is hidden; here it is given, as it is. Every cause of the library is
fitted alone, the true one from the truth as well, and the same rules decide.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from confusion_matrix.generator import Made, noise_as_it_is
from confusion_matrix.judge import known
from confusion_matrix.plan import DISTANCES, Item
from fes_pin.diagnosis.decide.rivals import alternatives
from fes_pin.diagnosis.search.score import Scored, best_by_effect
from fes_pin.diagnosis.search.simulation_fits import SimulationFits
from fes_pin.identify.fit import Fit, fit_multistart, fit_problem
from fes_pin.infer.optimum import MAX_ITERATIONS
from fes_pin.models.nominal import nominal_model

LEVEL = 0.05
"""Of false alarms, over the library: as many as the matrix allows."""


def asked(groups: Iterable[Sequence[Item]]) -> list[tuple[Item, ...]]:
    """Single causes of the smallest size, in noise that can be given."""
    small = [tuple(i for i in g if i.kind == "single" and i.distance == min(DISTANCES)) for g in groups]
    known = [tuple(i for i in g if noise_as_it_is(i) is not None) for g in small]
    return [g for g in known if g]


def oracle(made: Made) -> dict[str, Any]:
    """The answer to one study, as a record of the matrix."""
    model = nominal_model(made.study)
    sets = SimulationFits(model, made.study.trials)
    sets.set_noise(noise_as_it_is(made.item) or {})
    nominal = fit_multistart(sets.fitter.problem(model), model.parameters())
    scores = sets.scores(nominal)
    fits = {n: _fitted(sets, nominal, many, made) for n, many in best_by_effect(scores.scored).items()}
    name = min(fits, key=lambda n: fits[n].price)
    best = fits.pop(name)
    degrees = len(best.free) - len(nominal.free)
    claimed = scores.family(0).p_value(nominal.sse - best.sse, degrees) < LEVEL
    return {
        **known(made),
        "verdict": "causes_found" if claimed else "adequate",
        "sets": [[name, *alternatives(best, list(fits.values()), name)]] if claimed else [],
    }


def _fitted(sets: SimulationFits, nominal: Fit, scored: Sequence[Scored], made: Made) -> Fit:
    """The fit of one cause: from its linear estimates, and from the truth."""
    found = sets.fitter.go_on(sets.fitter.extend(nominal, scored), MAX_ITERATIONS)
    if found.model.effects[0].name not in made.item.causes or not made.truth:
        return found
    true = fit_problem(sets.fitter.problem(found.model), {**found.values, **made.truth}, None, MAX_ITERATIONS)
    return min((found, true), key=lambda f: f.price)
