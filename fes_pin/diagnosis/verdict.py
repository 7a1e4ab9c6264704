"""The verdict on what a search among the causes of a rig found.

Every set of causes is judged by the likelihood of its one-step predictions (`identify.likelihood`), and by its errors
on held-out trials. For a rig in closed loop these are errors over a horizon: errors come back as an input
(`identify.feedback`), and a free simulation of even the best model diverges. For others they are those of free
simulations.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.decide.chosen_again import ChosenAgain, is_chosen, share_of
from fes_pin.diagnosis.errors_ahead import Ahead, Pairs, errors_ahead, squared_errors
from fes_pin.diagnosis.held_out import Fold, folds_that_tell, make_folds
from fes_pin.diagnosis.likelihood_models import Found, LikelihoodModels, LikelihoodSearch
from fes_pin.diagnosis.rejected import with_rejected_causes
from fes_pin.diagnosis.weighed import RigWeighed
from fes_pin.identify.error_measures import FREE
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.infer.held_out import Errors
from fes_pin.infer.result import Remainder
from fes_pin.infer.scatter import as_wide_as_trials_differ, with_honest_intervals
from fes_pin.infer.verdict import State, Verdict

LATER_S = 1.0
"""Later horizon by which two estimators are compared, s: a slow cause, as a spring, shows there."""
EFFORT = "the low-passed effort"
"""What inverse dynamics predicts."""
RigState = State[LikelihoodFit, LikelihoodModels, RigWeighed]


class RigVerdict(Verdict[LikelihoodFit, LikelihoodModels, RigWeighed]):
    """The verdict on what a search by the likelihood found.

    Errors are those over the horizon or of free simulations: one sample ahead several wrong forms together predict
    nearly anything.

    Parameters
    ----------
    search
        That has run.
    test
        Trials that the study itself holds out.
    """

    def __init__(self, search: LikelihoodSearch, test: Sequence[Trial]) -> None:
        super().__init__(search)
        self.models, self.test = search.models, tuple(test)
        self.refitted = self.models.refitted
        self._chosen: dict[int, tuple[Found, list[LikelihoodFit]]] = {}

    def of_search(self, search: LikelihoodSearch) -> "RigVerdict":
        """Return the same verdict on another search of the same trials."""
        return type(self)(search, self.test)

    def weigh(self, found: Found) -> RigWeighed:
        """Return the evidence of held-out trials and of the tests of lack of fit on a set."""
        return RigWeighed(self.models, found, self.test, self.refitted)

    def with_intervals(self, fitted: LikelihoodFit) -> LikelihoodFit:
        """Return a fit of a set with the intervals of its estimator."""
        return with_honest_intervals(fitted)

    def estimated(self, state: RigState) -> LikelihoodFit:
        """Return the fit of a set with intervals that include the differences between folds."""
        again = [f.best for f in state.weighed.folds if f.within]
        return as_wide_as_trials_differ(self.with_intervals(state.found.best), again)

    def errors_chosen(self, state: RigState) -> tuple[float, float] | None:
        """See `Verdict.errors_chosen`; None without trials that are held out."""
        if not state.weighed.folds:
            return None
        nominal, chosen = map(self._judged, self.errors(state)[-1])
        return nominal, chosen

    def lack_of_fit(self, state: RigState) -> Remainder:
        """Return the lack of fit: by its tests, process noise that is too large, or a cause that was rejected.

        A set without one has that of the estimator that was replaced: with white process noise tests of lack of fit
        have little power.
        """
        weighed, stages = state.weighed, {e.name: str(e.stage) for e in self.models.library.effects}
        if weighed.voluntary is not None:
            return replace(weighed.lack_of_fit, unexplained=True, where="effort", reason=weighed.voluntary.words)
        left = with_rejected_causes(weighed.lack_of_fit, weighed.random, state.rejected, stages)
        if not left.unexplained and weighed.no_noise is not None:
            return replace(left, unexplained=True, where="time", reason=weighed.no_noise)
        before = state.replaced
        return left if left.unexplained or before is None else before.verdict.lack_of_fit(before)

    def is_rarely_chosen(self, state: RigState, name: str) -> bool:
        """Return whether most folds choose neither a cause nor one of its equivalents."""
        return not is_chosen(share_of(self.chosen(state), self.alike(state, name)))

    def alike(self, state: RigState, name: str) -> tuple[str, ...]:
        """Return a cause and its equivalents."""
        known = self.models.alike(state.found, name)
        return name, *sorted({*known[1:], *filter(None, [state.tied.get(name)])})

    @property
    def ahead(self) -> dict[str, float | None]:
        """Horizons, s, of the errors of motion by currency; None of free simulations.

        Of a joint whose effort was recorded there is a later horizon too, where trials are that long.
        """
        if (near := self.models.judged_s) is None:
            return {FREE: None}
        shortest = min(t.duration for t in self.models.trials)
        later = self.models.by_effort is not None and near < LATER_S < shortest
        return {f"predictions {s:g} s ahead": s for s in (near, *(LATER_S,) * later)}

    @property
    def currencies(self) -> tuple[str, ...]:
        """Predictions over the horizon of a rig in closed loop or of imposed motion, else free simulations.

        Where the effort of a joint was recorded, the low-passed effort that its motion takes as well.
        """
        return (*self.ahead, EFFORT) if self.models.by_effort is not None else (*self.ahead,)

    def errors_in(self, state: RigState, currency: str, unit: State[Any, Any, Any]) -> Errors | None:
        """Return cross-validated errors of a set on the fitted trials; of a single trial, those of the fit itself.

        A set with a cause of which inverse dynamics knows no column has no error of effort.
        """
        best, by_effort = state.found.best, self.models.by_effort
        if currency == EFFORT and by_effort is not None:
            return by_effort.errors(best.names) if by_effort.knows(best.names) else None
        train, floor = self.models.trials, unit.found.best
        held = folds_that_tell(floor) if len(train) > 1 else []  # the same of both sets
        folds = make_folds(replace(state.found, nominal=best, without={}), train, (), self.refitted, held)
        pairs = [(f.best, floor, f.test) for f in folds]  # what folds choose again is the same of both
        return squared_errors(pairs or [(best, floor, train)], self.ahead[currency])

    def chosen(self, state: RigState) -> list[LikelihoodFit]:
        """Return for each fold the fit to all trials of the set that is chosen without its own; none without folds."""
        found, folds = state.found, state.weighed.folds
        if not folds or not folds[0].within:
            return []
        if id(found) not in self._chosen:
            fits = {n: f for n, f in state.search.possible().items() if not set(n) & set(state.rejected)}
            choose = ChosenAgain({**fits, found.best.names: found.best}, state.search.improves)
            self._chosen[id(found)] = found, [choose.without(fold.out) for fold in folds]
        return self._chosen[id(found)][1]

    def folds(self, state: RigState) -> Sequence[Fold]:
        """Return the held-out trials, with fits without them, and the set that each fold chooses again."""
        chosen, folds = self.chosen(state), state.weighed.folds
        if not chosen or not state.names:
            return folds
        again = self.refitted([(one, fold.best.trials) for one, fold in zip(chosen, folds, strict=True)])
        return [replace(fold, chosen=one) for fold, one in zip(folds, again, strict=True)]

    def errors(self, state: RigState) -> list[tuple[Ahead, Ahead]]:
        """Return errors of the nominal and of the extended model: on the fitted trials, and on held-out ones if any."""
        found, out = state.found, []
        whole = [Fold(found.nominal, found.best, found.without, self.models.trials)]
        for folds in filter(None, (whole, self.folds(state))):
            nominal = self._ahead(state, [(f.nominal, f.best, f.test) for f in folds])
            out.append((nominal, self._ahead(state, [(f.chosen or f.best, f.best, f.test) for f in folds])))
        return out

    def _ahead(self, state: RigState, pairs: Pairs) -> Ahead:
        return errors_ahead(pairs, self.models.horizon_s, self.models.answered and state.weighed.falls)

    def _judged(self, error: Ahead) -> float:
        """Return the error that judges causes: over the horizon in closed loop, else of free simulations."""
        return error.horizon if error.free is None or self.models.judged_s is not None else error.free
