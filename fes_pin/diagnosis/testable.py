"""Identifiability of the causes of a library from a study's trials, and checks that need a fit of the nominal model.

A cause is linearized at the fitted nominal model, as in the search. It is not identifiable, whatever its size, if the
nominal parameters and the initial states can reproduce its sensitivity.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fes_pin.data.read_only import ReadOnly
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.identify.feedback import is_fed_back
from fes_pin.identify.fit import Fit, noise_of, rough_fit
from fes_pin.identify.likelihood_fit import at_noise
from fes_pin.identify.process_noise import first_guess
from fes_pin.infer.levels import ALIKE_COSINE, IDENTIFIABLE_SHARE, LEAST_SHIFT_S, REVERSED_LEAVES, SMALL_SHARE
from fes_pin.models.catalogue import Catalogue, installed
from fes_pin.models.model import Model
from fes_pin.models.nominal import nominal_model
from fes_pin.models.simulate import simulated_trial
from fes_pin.prepare.long_records import searched_part
from fes_pin.search.library import Library
from fes_pin.search.score import Scores, best_by_effect
from fes_pin.workers import attempted, one_thread_each

LONGEST_SHIFT = 0.25
"""Largest shift of a trial in time that is tried, either way, as a share of its length."""
FEWEST = 3
"""Least number of trials: a shifted one is found by two others."""
MOST_LOOKED_AT = 8
"""Trials that are tested for a shift, the worst fitted first; each takes a fit of the others."""


@dataclass(frozen=True, eq=False)
class Testable(ReadOnly):
    """Causes that trials can and cannot identify.

    Attributes
    ----------
    shown
        Identifiable causes by name, with the share of their sensitivity that no other parameter reproduces.
    absorbed
        Causes that are not identifiable, as the nominal parameters can take their place.
    silent
        Causes that are not identifiable, as they act in none of the trials.
    alike
        Groups of causes that look alike on these trials.
    unexplained
        Share of the readings' variance that the fitted nominal model leaves. Where it is large, the causes are
        linearized far from the data.
    warnings
        Checks of the fitted nominal model: a trial that is shifted in time, an effort of the opposite sign.
    """

    shown: Mapping[str, float]
    absorbed: tuple[str, ...]
    silent: tuple[str, ...]
    alike: tuple[tuple[str, ...], ...]
    unexplained: float
    warnings: tuple[str, ...]


def testable_causes(study: Study, catalogue: Catalogue | None = None) -> Testable | str:
    """Find the causes of a study's rig that its trials can identify.

    Returns
    -------
    Testable or str
        The causes, or the reason why they are not known before a diagnosis.
    """
    nominal, trials = _to_fit(study)
    effects = (catalogue or installed()).effects_for(nominal.rig)
    with one_thread_each():
        try:
            fitted = rough_fit(nominal, trials)
            if not math.isfinite(fitted.sse):
                return "the nominal model diverges when it is simulated from its start values"
            library = Library(nominal, trials, effects)
            white = replace(first_guess(nominal, trials), std={}, time={})
            scores = library.scores(at_noise(fitted, white))
            warnings = [*_reversed(nominal, trials, fitted), *_shifted(nominal, trials, fitted)]
        except (ArithmeticError, np.linalg.LinAlgError) as problem:
            return f"the nominal model cannot be fitted ({problem})"
    kept = {n: max(one.kept for one in many) for n, many in best_by_effect(scores.scored).items()}
    return Testable(
        shown={n: k for n, k in sorted(kept.items()) if k >= IDENTIFIABLE_SHARE},
        absorbed=tuple(sorted(n for n, k in kept.items() if k < IDENTIFIABLE_SHARE)),
        silent=library.not_excited(),
        alike=_alike(scores, kept),
        unexplained=_unexplained(fitted),
        warnings=tuple(warnings),
    )


def given_away(study: Study) -> list[str]:
    """Return warnings about a study from a fit of its nominal model, as in `Testable`; those found before time is over.

    There are none for a rig in closed loop: its diagnosis estimates the delay of efforts by the likelihood.
    """
    nominal, trials = _to_fit(study)
    if is_fed_back(nominal.rig, trials):
        return []
    found: list[str] = []

    def look() -> None:
        fitted = rough_fit(nominal, trials)
        for check in (_reversed, _shifted) if math.isfinite(fitted.sse) else ():
            found.extend(check(nominal, trials, fitted))

    with one_thread_each():
        attempted(look, None)
    return found


def _to_fit(study: Study) -> tuple[Model, Sequence[Trial]]:
    trials = [t for t in study.trials if t.role != "held_out"] or list(study.trials)
    return nominal_model(study), searched_part(trials, study.schema)[0]


def _unexplained(fitted: Fit) -> float:
    """Return the largest share of a column's variance that a fit leaves."""
    around = {n: np.mean([np.var(t[n]) for t in fitted.trials if n in t]) for n in fitted.noise}
    return max((one.std**2 / max(around[n], 1e-300) for n, one in noise_of(fitted, longest=0).items()), default=0.0)


def _alike(scores: Scores, kept: Mapping[str, float]) -> tuple[tuple[str, ...], ...]:
    """Return pairs of causes of one amplitude that have, for some of their shapes, nearly parallel sensitivities."""
    single = [
        (one.effect.name, block.start)
        for one, block in zip(scores.scored, scores.blocks, strict=False)
        if block.stop - block.start == 1
        and kept[one.effect.name] >= IDENTIFIABLE_SHARE
        and one.kept >= IDENTIFIABLE_SHARE
    ]
    pairs = set[tuple[str, ...]]()
    for (name, i), (other, j) in itertools.combinations(single, 2):
        size = math.sqrt(scores.gram[i, i] * scores.gram[j, j])
        if name != other and size > 0.0 and abs(scores.gram[i, j]) >= ALIKE_COSINE * size:
            pairs.add(tuple(sorted((name, other))))
    return tuple(sorted(pairs))


def _reversed(model: Model, trials: Sequence[Trial], fitted: Fit) -> list[str]:
    """Return a warning for an effort that explains the motion far better with the opposite sign."""
    if not any("effort" in t and "position" in t for t in trials):
        return []
    turned = [t.with_columns(effort=-t["effort"]) if "effort" in t else t for t in trials]
    other = rough_fit(model, turned)
    better = math.isfinite(other.sse) and other.sse < REVERSED_LEAVES * fitted.sse
    if not (better and _unexplained(other) < REVERSED_LEAVES):
        return []  # a rig whose effort answers its reading is explained by neither
    share = 100.0 * other.sse / fitted.sse
    return [
        f"with the opposite sign of the effort the nominal model has {share:.2g} % of its squared error: "
        "does a positive effort push towards positive positions?"
    ]


def _shifted(model: Model, trials: Sequence[Trial], fitted: Fit) -> list[str]:
    """Return warnings for trials whose readings a model of the others predicts far better at another time."""
    if len(trials) < FEWEST:
        return []
    sums = [float(p.residual @ p.residual) / len(p.residual) for p in fitted.parts]
    worst = [trials[i] for i in np.argsort(sums)[::-1][:MOST_LOOKED_AT]]
    shifts = [_shift(model, [t for t in trials if t is not one], one) for one in worst]
    usual = float(np.median([shift if share < SMALL_SHARE else 0.0 for shift, share in shifts]))
    out = []
    for trial, (shift, share) in zip(worst, shifts, strict=True):
        if share < SMALL_SHARE and abs(shift - usual) > LEAST_SHIFT_S:
            late = f"{abs(shift - usual):.2g} s {'later' if shift > usual else 'earlier'}"
            out.append(f"trial {trial.name} answers {late} than the others: is it shifted in time?")
    return out


def _shift(model: Model, others: Sequence[Trial], trial: Trial) -> tuple[float, float]:
    """Return the lag in s of a trial's reading behind its simulation, and the share of its error at that lag."""
    name = model.rig.output(trial.kind)
    if name not in trial or not model.rig.input_columns(trial):
        return 0.0, 1.0
    measured, simulated = trial[name], simulated_trial(rough_fit(model, others).model, trial)[name]
    most = int(LONGEST_SHIFT * len(trial))
    lags = np.arange(-most, most + 1, max(1, most // 200))
    inside = simulated[most : len(trial) - most]
    errors = np.array([np.mean((measured[most + k : len(trial) - most + k] - inside) ** 2) for k in lags])
    best, none = int(np.argmin(errors)), int(np.argmin(np.abs(lags)))
    # no shift predicts a rig that falls over
    if not np.isfinite(errors).all() or errors[best] > SMALL_SHARE * np.var(measured):
        return 0.0, 1.0
    return float(lags[best] * trial.dt), float(errors[best] / max(errors[none], 1e-300))
