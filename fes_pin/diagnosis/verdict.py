"""The verdict on what a search among the causes of a rig found.

Every set of causes is judged by the likelihood of its one-step predictions (`identify.likelihood`), and by its errors
on trials held out: over a horizon where a controller answers, as errors come back as input there (`identify.feedback`)
and a free simulation of the best of models runs away; else of free simulations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.decide.chosen_again import ChosenAgain, is_chosen, share_of
from fes_pin.diagnosis.decide.rivals import alternatives
from fes_pin.diagnosis.errors_ahead import (
    Ahead,
    RandomPart,
    are_large,
    errors_ahead,
    random_parts,
)
from fes_pin.diagnosis.estimators import found_with_white_process_noise, judged_again, least_error
from fes_pin.diagnosis.held_out import (
    Again,
    Fold,
    as_random_as_in_all,
    evidence_of,
    folds_of,
    gains_of,
    held_errors_ahead,
    make_folds,
    refit,
    with_choices,
)
from fes_pin.diagnosis.rejected import UNMOVED, is_moved_by_what_is_recorded, no_noise, with_rejected_causes
from fes_pin.diagnosis.remainder.lack_of_fit import lack_of_fit
from fes_pin.diagnosis.search.cause_sets import names_of
from fes_pin.diagnosis.search.likelihood_models import Found, LikelihoodModels, LikelihoodSearch
from fes_pin.identify.ahead import falls
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.levels import FORM_SHARE
from fes_pin.infer.result import Remainder
from fes_pin.infer.verdict import State, Verdict, Weighed


@dataclass(frozen=True)
class RigWeighed(Weighed):
    """What trials say of a set of causes; gains are over the horizon.

    Attributes
    ----------
    folds
        Trials that are held out, and fits without them; none where none can be.
    random
        What acts at random beside the set.
    no_noise
        Why the error of a simulation is no noise of a reading, if it is none.
    """

    lack_of_fit: Remainder
    folds: Sequence[Fold]
    random: tuple[RandomPart, ...]
    no_noise: str | None


RigState = State[LikelihoodFit, LikelihoodModels, RigWeighed]


class RigVerdict(Verdict[LikelihoodFit, LikelihoodModels, RigWeighed]):
    """How it is judged what a search by the likelihood found.

    Trials that took no part support a cause, or not, by `is_supported`, with errors over the horizon: several forms
    together, none of them quite right, come near to anything one sample ahead.

    Parameters
    ----------
    search
        That has run.
    test
        Trials that the study itself holds out.
    seed
        Of critical values.
    """

    def __init__(self, search: LikelihoodSearch, test: Sequence[Trial], seed: int) -> None:
        super().__init__(search)
        self.models, self.test, self.seed = search.models, tuple(test), seed
        self.refitted, self._alike = Again(refit), Again(as_random_as_in_all)
        self._chosen: dict[int, tuple[Found, list[LikelihoodFit]]] = {}
        self._unmoved: set[int] = set()
        self._with_white_noise: LikelihoodFit | None = None

    def weigh(self, found: Found) -> RigWeighed:
        """What held-out trials, and the tests of lack of fit, say of a set."""
        folds = make_folds(found, self.models.trials, self.test, self.refitted)
        within = folds or [Fold(found.nominal, found.best, found.without, self.models.trials)]
        return RigWeighed(
            gains=gains_of(within, found.without, self.models.judged_s, self.seed),
            evidence=evidence_of(folds, found, self._alike) if folds else {},
            lack_of_fit=lack_of_fit(found.best, self.seed),
            folds=folds,
            random=random_parts(found.best),
            no_noise=no_noise(found.best),
        )

    def of(self, found: Found, search: LikelihoodSearch | None = None, replaced: RigState | None = None) -> RigState:
        """The state that no claim objects to; one without causes where something else moves the rig."""
        search = search or self.search
        if not is_moved_by_what_is_recorded(found.best):
            self._unmoved.add(id(search))
            found = search.result(())
        return super().of(found, search, replaced)

    def unsupported(self, state: RigState) -> list[str]:
        """Causes that trials which took no part do not support.

        Where something acts that no cause explains, one that explains no more than an error of form may be of that.
        """
        gains = state.weighed.gains
        if are_large(state.weighed.random) and (form := [n for n in gains if gains[n].low < 100.0 * FORM_SHARE]):
            return form
        return super().unsupported(state)

    def lack_of_fit(self, state: RigState) -> Remainder:
        """Lack of fit: by the features, or a random effort that is too large, or a cause that was rejected."""
        stages = {e.name: str(e.stage) for e in self.models.library.effects}
        left = with_rejected_causes(state.weighed.lack_of_fit, state.weighed.random, state.rejected, stages)
        wrong = not left.unexplained and state.weighed.no_noise is not None
        return replace(left, unexplained=True, where="time") if wrong else left

    def is_rarely_chosen(self, state: RigState, name: str) -> bool:
        """Whether most folds choose neither a cause nor what cannot be told from it."""
        return not is_chosen(share_of(self.chosen(state), alike_in(state.found, name)))

    def by_another_estimator(self, state: RigState) -> RigState | None:
        """The verdict with efforts that are new in every sample, or by the least error where a lack of fit remains."""
        self._with_white_noise = white = found_with_white_process_noise(state.search, state.found)
        other = None if white is None else judged_again(state.search, state.found, white)
        if other is None and self.lack_of_fit(state).unexplained:
            other = least_error(state.search)
        if other is None:
            return None
        search, found = other
        return self.of(found, search, replaced=state)

    def prediction_error(self, state: RigState) -> float:
        """E of a set on the fitted trials, percent, each predicted by a fit to the others.

        Of a single trial, E of the fit itself. A rig that a controller drives is judged by errors over the horizon,
        others by those of free simulations.
        """
        best, train = state.found.best, self.models.trials
        folds = self.folds(state)
        if folds and folds[0].within:
            pairs = [(f.chosen or f.best, f.best, f.test) for f in folds]
        else:
            held = folds_of(train) if len(train) > 1 else []
            others = self.refitted([(best, [t for i, t in enumerate(best.trials) if i not in out]) for out in held])
            pairs = [(f, f, tuple(train[i] for i in out)) for f, out in zip(others, held, strict=True)]
        error = errors_ahead(pairs or [(best, best, train)], self.models.horizon_s, self._falls(state))
        return error.horizon if error.free is None or self.models.judged_s is not None else error.free

    def chosen(self, state: RigState) -> list[LikelihoodFit]:
        """For each fold, the fit to all trials of the set that is chosen without its own; none where none are made."""
        found, folds = state.found, state.weighed.folds
        if not folds or not folds[0].within or id(state.search) in self._unmoved:
            return []
        if id(found) not in self._chosen:
            fits = {**state.search.possible(), names_of(found.best): found.best}
            choose = ChosenAgain(fits, state.search.improves)
            self._chosen[id(found)] = found, [choose.without(out) for out in folds_of(self.models.trials)]
        return self._chosen[id(found)][1]

    def folds(self, state: RigState) -> Sequence[Fold]:
        """Trials that are held out, with fits without them, and what each fold chooses again."""
        chosen, folds = self.chosen(state), state.weighed.folds
        return with_choices(folds, chosen, self.refitted) if chosen and state.names else folds

    def errors(self, state: RigState) -> tuple[Ahead, Ahead]:
        """Errors of the nominal and of the extended model on the trials that were fitted."""
        found, train = state.found, self.models.trials
        nominal, best = (
            errors_ahead([(f, found.best, train)], self.models.horizon_s, self._falls(state))
            for f in (found.nominal, found.best)
        )
        return nominal, best

    def held_out_errors(self, state: RigState) -> tuple[Ahead, Ahead] | None:
        """The same on trials held out; None where none could be."""
        return held_errors_ahead(self.folds(state), self.models.horizon_s, self._falls(state))

    def remainder(self, state: RigState) -> tuple[Remainder, str | None]:
        """Lack of fit of a set, and its reason if no test says so; else of that by the estimator that was replaced.

        With efforts that are new in every sample little lack of fit stands out: it is not what these say is random.
        """
        left = self.lack_of_fit(state)
        if state.replaced is not None and not left.unexplained:
            return self.remainder(state.replaced)
        if id(state.search) in self._unmoved:
            return left, UNMOVED
        untested = left.unexplained and left.where == "time" and not state.weighed.lack_of_fit.unexplained
        return left, state.weighed.no_noise if untested else None

    def by_the_other(self, state: RigState) -> LikelihoodFit | None:
        """The same set fitted by another estimator; None where none was asked, or where that has another set."""
        other = self._with_white_noise if state.replaced is None else state.replaced.found.best
        return other if other is not None and names_of(other) == names_of(state.found.best) else None

    def _falls(self, state: RigState) -> bool:
        return self.models.answered and falls(state.found.best.model, self.models.trials)


def alike_in(found: Found, name: str) -> tuple[str, ...]:
    """A cause, and what cannot be told from it."""
    return (name, *alternatives(found.best, found.rivals[name], name))
