"""The next experiment: the trial that distinguishes confounded causes best."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.data.results import Plan
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.per_trial import falls
from fes_pin.identify.problem import measured_columns
from fes_pin.infer.covariance import least_squares_step
from fes_pin.infer.levels import SEPARABLE, SURE
from fes_pin.infer.problem import Linearized, NormalEquations, Unknowns, normal_equations
from fes_pin.models.nominal import rig_of
from fes_pin.models.simulate import Simulator

MOST_REPEATS = 50
"""A trial that must be run more often than this is not proposed."""
SECONDS = 8.0
"""Length of a proposed trial."""
ROOM = 0.5
"""Share of the measured range by which a proposed trial may leave it on either side: a model is not known beyond."""
ALIKE = 0.01
"""Squared noise units below which two predictions are the same."""
QUIET_S = 0.4
"""Time at the beginning and at the end of a trial in which the refinement leaves the stimulus as it is."""
ROUNDS, CHILDREN = 24, 4
"""Rounds of the refinement, and changed stimuli that each compares with the best so far."""


@dataclass(frozen=True)
class NextExperiment(Plan):
    """A trial that distinguishes two causes, or the reason why no trial does.

    Attributes
    ----------
    why, separates, trial
        As of `Plan`.
    expected
        What the trial is expected to add to the lead of the first cause if it is the true one, and to that of the
        second if that is, in twice the log-likelihood.
    """

    expected: tuple[float, float] = (0.0, 0.0)

    @property
    def promised(self) -> tuple[float, float]:
        """`expected` by its old name. Deprecated."""
        said = "NextExperiment.promised is NextExperiment.expected now; it ends with version 0.3"
        warnings.warn(said, DeprecationWarning, stacklevel=2)
        return self.expected


@dataclass(frozen=True)
class Discrimination:
    """The expected contribution of a trial to the likelihood ratio of two models, in twice the log-likelihood.

    With r the whitened difference of the two predictions, J the sensitivities of the wrong model and H the information
    on its parameters in the data that it was fitted to, `repeats` = n trials add

        D(n) = n r'r - (n J'r)' (H + n J'J)^-1 (n J'r),

    the part of the difference that its parameters cannot reproduce without contradicting those data. Twice the
    logarithm of the likelihood ratio has mean D and standard deviation 2 sqrt(D).

    Attributes
    ----------
    lead
        Lead of the better model without the trial, in twice the log-likelihood.
    news
        Normal equations of the trial alone: if the better model is true, and if the other is.
    known
        Information on the parameters of the wrong model, in the same order.
    """

    lead: float
    news: tuple[NormalEquations, NormalEquations]
    known: tuple[np.ndarray, np.ndarray]

    def distance(self, way: int, repeats: int = 1) -> float:
        """Return D(n) if the better model is true (`way` 0) or the other one (1)."""
        new, known = self.news[way], self.known[way]
        hessian, gradient = known + repeats * new.hessian, repeats * new.gradient
        gained = gradient @ least_squares_step(hessian, gradient)
        return float(max(repeats * (new.sse - new.local_gain) - gained, 0.0))

    def margin(self, repeats: int = 1) -> float:
        """Return the lead of the true model after the trial, at 95 % confidence, whichever of the two it is."""
        ways = ((self.lead, self.distance(0, repeats)), (-self.lead, self.distance(1, repeats)))
        return min(lead + d - 2.0 * SURE * np.sqrt(d) for lead, d in ways)

    @property
    def worth(self) -> float:
        """The smaller of the two distances, by which trials are compared."""
        return min(self.distance(0), self.distance(1))

    def repeats(self) -> int | None:
        """Return how often the trial must be run to decide at 95 % confidence; None if that is too often."""
        return next((n for n in range(1, MOST_REPEATS + 1) if self.margin(n) >= SEPARABLE), None)


def next_experiment(
    best: LikelihoodFit, rivals: Mapping[str, LikelihoodFit], name: str, study: Study
) -> NextExperiment:
    """Return the feasible trial on which a model differs most from its rivals, once each is fitted to that trial too.

    Either of two models may be the wrong one, so that trials are compared by the smaller separation, and by that of the
    closest rival. The best of a dozen stimuli under every condition is then refined, one stretch at a time.

    Parameters
    ----------
    best, rivals
        The best model, and by the name of a cause the model with that cause in the place of `name`; all are fitted to
        the same data.
    name
        The cause of the best model that the rivals lack.
    study
        The rig, and the conditions that it was run under.
    """
    pair = name, next(iter(rivals))
    if falls(best.model, best.trials):
        why = "small errors grow in a simulation of this rig, so that no effort is proposed"
        return NextExperiment(f"{why}; move it further, or another way, and diagnose again", pair)
    found = _best(best, rivals, list(candidates(study)), study)
    if found is None:
        return NextExperiment("no trial that stays near what has been measured was found", pair)
    expected, trial = _refined(best, rivals, found, study)
    closest = min(expected, key=lambda n: expected[n].worth)
    pair, separation = (name, closest), expected[closest]
    if separation.worth < 1.0:
        most = f"{separation.worth:.2g} squared noise units at most" if separation.worth >= ALIKE else "nothing"
        why = f"no stimulus or load of this rig separates {name} and {closest}: the models differ by {most}"
        return NextExperiment(f"{why}; {best.model.rig.elsewhere}", pair)
    others = ", the other rivals by more" if len(rivals) > 1 else ""
    differ = f"{name} and {closest} differ by {separation.worth:.3g} squared noise units{others}"
    why = f"on this trial {differ}; {_often(separation.repeats())}"
    return NextExperiment(why, pair, trial, (separation.distance(0), separation.distance(1)))


def _often(repeats: int | None) -> str:
    if repeats is None:
        return "repeats of it alone do not decide at 95 % confidence, but it is evidence: diagnose again with it"
    return f"{'once decides' if repeats == 1 else f'{repeats} repeats decide'} 95 times in 100"


def near_measured(best: LikelihoodFit, trials: Sequence[Trial], study: Study) -> list[tuple[Trial, Trial]]:
    """Return the trials that a model predicts within the measured range, each without and with predicted outputs."""
    measured, out = measured_columns(best.model, study.trials), []
    run = Simulator(best.model, trials).run(best.values, [_start(best, t) for t in trials])
    for trial, one in zip(trials, run, strict=True):
        names = best.model.rig.outputs(trial.kind)
        read = trial.with_columns(**{n: one.readings[:, k] for k, n in enumerate(names) if n in best.noise})
        if all(_is_near(read[n], y) for n, y in measured.items() if n in read):
            out.append((trial, read))
    return out


def _start(best: LikelihoodFit, trial: Trial) -> dict[str, float]:
    """Return the unknowns that a trial starts with, those of effects as in the first trial of a fit."""
    own = {n: v for n, v in best.unknowns[0].items() if n in best.model.own_unknowns()}
    return {**best.model.initial_unknowns(trial), **own}


def discriminations(
    best: LikelihoodFit, rival: LikelihoodFit, near: Sequence[tuple[Trial, Trial]]
) -> list[Discrimination]:
    """Return the discrimination of two models by each of the trials of `near_measured`."""
    trials = [read for _, read in near]

    def linearized(one: LikelihoodFit, start: Unknowns) -> list[Linearized]:
        return LikelihoodProblem(one.model, trials, best.noise, one.free).linearize(one.values, start)

    if_best = linearized(rival, [rival.model.initial_unknowns(read) for read in trials])
    slopes = linearized(best, [_start(best, trial) for trial, _ in near])
    if_rival = [Linearized(-r.residual, b.jacobian, b.local) for r, b in zip(if_best, slopes, strict=True)]
    known = (normal_equations(rival.parts).hessian, normal_equations(best.parts).hessian)
    news = [(normal_equations([one]), normal_equations([other])) for one, other in zip(if_best, if_rival, strict=True)]
    return [Discrimination(rival.criterion - best.criterion, one, known) for one in news]


def _is_near(values: np.ndarray, measured: np.ndarray) -> bool:
    """Return whether a prediction stays within the measured range, widened by `ROOM`."""
    room = ROOM * np.ptp(measured)
    inside = values.min() >= measured.min() - room and values.max() <= measured.max() + room
    return bool(np.isfinite(values).all() and inside)


BestTrial = tuple[dict[str, Discrimination], Trial]


def _best(
    best: LikelihoodFit, rivals: Mapping[str, LikelihoodFit], trials: Sequence[Trial], study: Study
) -> BestTrial | None:
    """Return the trial that separates the closest rival best, with its discrimination of each rival."""
    near = near_measured(best, trials, study)
    each = {n: discriminations(best, rival, near) for n, rival in rivals.items()} if near else {}
    found = [({n: many[k] for n, many in each.items()}, trial) for k, (trial, _) in enumerate(near)]
    return max((one for one in found if np.isfinite(_worth(one))), key=_worth, default=None)


def _worth(found: BestTrial) -> float:
    return float(np.min([p.worth for p in found[0].values()]))


def _refined(best: LikelihoodFit, rivals: Mapping[str, LikelihoodFit], found: BestTrial, study: Study) -> BestTrial:
    """Return the trial with stretches of its stimulus held at other levels, where that separates better."""
    rng = np.random.default_rng(7)
    column = rig_of(study).steered(study)
    if column is None:
        return found
    for _ in range(ROUNDS):
        children = [_changed(found[1], column, study, rng) for _ in range(CHILDREN)]
        better = _best(best, rivals, children, study)
        if better is not None and _worth(better) > _worth(found):
            found = better
    return found


def _changed(trial: Trial, column: str, study: Study, rng: np.random.Generator) -> Trial:
    """Return the same trial with one stretch of 0.1 to 2 s at another level, but for its beginning and its end."""
    values, time = trial[column].copy(), trial.time
    begin = rng.uniform(QUIET_S, time[-1] - QUIET_S)
    length = np.exp(rng.uniform(np.log(0.1), np.log(2.0)))
    stretch = (time >= begin) & (time < min(begin + length, time[-1] - QUIET_S))
    values[stretch] = rig_of(study).driven(study, np.full(int(stretch.sum()), rng.choice([0.0, rng.random(), 1.0])))
    return trial.with_columns(**{column: values})


def candidates(study: Study) -> Iterator[Trial]:
    """Yield trials that the rig can run as it is: a dozen stimuli under each of its conditions."""
    rig, time = rig_of(study), np.arange(0.0, SECONDS, study.trials[0].dt)
    column = rig.steered(study)
    shaped = [{column: rig.driven(study, shape)} for shape in _shapes(time)] if column else None
    inputs = shaped or list(rig.other_stimuli(study, time))
    for kind, conditions in sorted(rig.conditions_to_try(study)):
        for columns in inputs:
            yield Trial("next", kind, columns, time, dict(conditions))


def _shapes(time: np.ndarray) -> Sequence[np.ndarray]:
    """Return stimuli between 0 and 1: steps, a staircase, a ramp, sines, trains and a random sequence."""
    t = time / time[-1]
    held = np.repeat(np.random.default_rng(45).random(40), -(-len(time) // 40))[: len(time)]
    on, moving = _between(t, 0.1, 0.6), _between(t, -1.0, 0.9)
    return [
        *(np.where(on, level, 0.0) for level in (0.3, 0.6, 1.0)),
        np.clip(np.floor(10.0 * t) / 8.0, 0.0, 1.0),
        1.0 - np.abs(2.0 * t - 1.0),
        *(np.where(moving, 0.5 + k * np.sin(2.0 * np.pi * hz * time), 0.0) for k, hz in ((0.5, 0.5), (0.3, 1.5))),
        *(np.where(_between(time % s, -1.0, 0.5 * s) & moving, level, 0.0) for s, level in ((1.0, 0.8), (0.4, 0.5))),
        np.where(moving, held, 0.0),
    ]


def _between(t: np.ndarray, low: float, high: float) -> np.ndarray:
    return (low < t) & (t < high)
