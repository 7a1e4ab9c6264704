"""What each fold would have chosen without its trials, of all sets that were fitted."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis.hidden import study_of
from identify.rigs import as_likely

from fes_pin.diagnosis.decide.chosen_again import ChosenAgain, share_of
from fes_pin.identify.fit import fit_problem, rough_fit, under_own_noise
from fes_pin.identify.problem import Problem
from fes_pin.infer.distributions import chi2_tail
from fes_pin.infer.left_out import LeftOut
from fes_pin.infer.levels import PARAMETER_PENALTY
from fes_pin.infer.optimum import MAX_ITERATIONS
from fes_pin.infer.problem import normal_equations
from fes_pin.models.effects import effect_named
from fes_pin.models.nominal import nominal_model
from fes_pin.models.predictor import StateSpaceNoise
from fes_pin.prepare.measured import folds_of
from fes_pin.search.fit import fit

NAMES = ("coulomb_friction", "effort_offset", "quadratic_damping")


def improves(larger, smaller, gain, _explained):
    return len(NAMES) * float(chi2_tail(max(gain, 0.0), larger.degrees - smaller.degrees)) < 0.01


@pytest.fixture(scope="module")
def fits():
    """The nominal model and single causes on a joint that hides dry friction."""
    study = study_of("joint", ("coulomb_friction",))
    nominal = under_own_noise(rough_fit(nominal_model(study), study.trials), max_iterations=MAX_ITERATIONS)
    others = {(n,): fit(nominal.model + effect_named(n)(), study.trials, nominal.noise) for n in NAMES}
    return {(): nominal, **others}


@pytest.mark.parametrize("name", [(), *((n,) for n in NAMES)], ids=str)
def test_a_step_ends_where_a_fit_to_the_other_trials_does(fits, name):
    whole = fits[name]
    for held in folds_of(whole.trials):
        others = [t for i, t in enumerate(whole.trials) if i not in held]
        refitted = fit_problem(Problem(whole.model, others, whole.noise), whole.values)
        many = sum(map(len, whole.trials)) / sum(map(len, others))
        assert LeftOut(whole).cost(held) == pytest.approx(many * refitted.sse, abs=PARAMETER_PENALTY)


def test_the_true_cause_is_chosen_without_any_of_the_trials(fits):
    again = ChosenAgain(fits, improves)
    chosen = [again.without(held) for held in folds_of(fits[()].trials)]
    assert share_of(chosen, ["coulomb_friction"]) == (len(chosen), len(chosen))
    assert share_of(chosen, ["effort_offset"]) == (0, len(chosen))


def test_what_one_trial_alone_speaks_for_is_not_chosen_without_it(fits):
    """The innovations of one trial are moved along what an offset would do to it, and to no other."""
    nominal, offset = fits[()], fits["effort_offset",]
    odd = 0

    def moved(fitted):
        part = fitted.parts[odd]
        push = 8.0 * offset.std("effort_offset.offset") * len(offset.parts) ** 0.5
        along = offset.parts[odd].jacobian[:, offset.free.index("effort_offset.offset")]
        parts = [*fitted.parts]
        parts[odd] = replace(part, residual=part.residual + push * along)
        system = normal_equations(parts)  # the fit ends at the optimum of the moved readings
        step = np.linalg.solve(system.hessian, system.gradient)
        ends = zip(parts, system.local_steps(step), strict=True)
        parts = [replace(p, residual=p.residual - p.jacobian @ step - p.local @ own) for p, own in ends]
        return replace(fitted, parts=tuple(parts), sse=sum(float(p.residual @ p.residual) for p in parts))

    again = ChosenAgain({(): moved(nominal), ("effort_offset",): moved(offset)}, improves)
    others = [i for i in range(len(nominal.trials)) if i != odd]
    assert again.without([others[0]]).model.effects
    assert not again.without([odd]).model.effects


def test_without_folds_nothing_is_said():
    assert share_of([], ["coulomb_friction"]) is None


def test_what_all_trials_promise_together_and_no_step_has_kept_counts_for_no_fold(fits):
    """Slopes of a filter for gains as they are promise that."""
    offset = fits["effort_offset",]
    k, push = offset.free.index("effort_offset.offset"), 20.0 * offset.std("effort_offset.offset")
    parts = tuple(replace(p, residual=p.residual + push * p.jacobian[:, k]) for p in offset.parts)
    free = replace(offset, parts=parts)
    noise = StateSpaceNoise({"position": 1.0})

    def gained(fitted, held):
        left = LeftOut(fitted)
        others = [t for i, t in enumerate(left.each) if i not in held]
        many = sum(t.readings for t in left.each) / sum(t.readings for t in others)
        return many * sum(t.cost for t in others) - left.cost(held)

    for held in folds_of(offset.trials):
        same = gained(as_likely(offset, noise), held)
        assert gained(as_likely(free, noise), held) == pytest.approx(same, abs=1e-3)


def test_a_pair_is_chosen_of_which_neither_cause_is_significant_alone(fits):
    """A tilt and dry friction of a swing: the errors that either leaves are those of a model that is far away."""
    nominal, friction, pair = fits[()], fits["coulomb_friction",], ("coulomb_friction", "effort_offset")
    alone = {(n,): nominal for n in pair}
    again = ChosenAgain({(): nominal, **alone, pair: friction}, lambda larger, smaller, gain, explained: gain > 1.0)
    assert again.without([0]) is friction
