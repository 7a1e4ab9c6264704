"""Evidence of trials on a set of causes of a rig, each part of it found when a claim first asks for it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

from fes_pin.data.trial import Trial
from fes_pin.diagnosis.errors_ahead import are_large, free_errors, noise_that_is_small, random_parts
from fes_pin.diagnosis.held_out import Again, Fold, evidence_of, gains_of, make_folds
from fes_pin.diagnosis.likelihood_models import Found, LikelihoodModels
from fes_pin.diagnosis.rejected import is_moved_by_what_is_recorded, no_noise
from fes_pin.identify.likelihood_fit import LikelihoodFit
from fes_pin.identify.per_trial import falls
from fes_pin.infer.levels import SMALL_SHARE
from fes_pin.infer.noise import NoiseModel
from fes_pin.infer.result import FITTED, Gain
from fes_pin.infer.text import WHOLE
from fes_pin.infer.verdict import Weighed
from fes_pin.remainder.lack_of_fit import lack_of_fit
from fes_pin.remainder.unrepeated import over_voluntary, voluntary_effort

WORSE = 2.0
"""Ratio of errors of free simulations from which a cause is refuted: those of two right models differ by less."""


class RigWeighed(Weighed):
    """Evidence of trials on a set of causes.

    Parameters
    ----------
    models, found
        Sets of the same trials, and what a search among them found.
    test
        Trials that the study itself holds out.
    refitted
        Fits to other trials.

    Attributes
    ----------
    folds
        Trials that are held out, and fits without them; none where none can be.
    fitted
        Gain of each cause on the fitted trials, by fits to all of them.
    random
        Process noise in the fit of the set.
    falls
        Whether the rig falls by itself, so that free simulations of any model diverge.
    no_noise
        Why the error of a simulation cannot be measurement noise; None where it may be.
    voluntary
        Effort that the set leaves, and that differs between equal cycles of an imposed motion; None without such.
    """

    def __init__(self, models: LikelihoodModels, found: Found, test: Sequence[Trial], refitted: Again) -> None:
        # a frozen base class, whose fields are found when they are asked for
        self.__dict__.update(_models=models, _found=found, _test=test, _refitted=refitted)
        self._models: LikelihoodModels
        self._found: Found
        self._test: Sequence[Trial]
        self._refitted: Again

    folds = cached_property(lambda own: make_folds(own._found, own._models.trials, own._test, own._refitted))
    evidence = cached_property(lambda own: evidence_of(own.folds, own._found, own._models.as_random))
    lack_of_fit = cached_property(lambda own: lack_of_fit(own._found.best))
    random = cached_property(lambda own: random_parts(own._found.best))
    is_random = property(lambda own: are_large(own.random))
    is_moved = cached_property(lambda own: is_moved_by_what_is_recorded(own._found.best))
    falls = cached_property(lambda own: falls(own._found.best.model, own._models.trials))
    no_noise = cached_property(lambda own: no_noise(own._found.best))
    voluntary = cached_property(lambda own: voluntary_effort(own._found.best))

    @cached_property
    def gains(self) -> Mapping[str, Gain]:
        """See `Weighed`."""
        gains = gains_of(self.folds, self._found.without, self._models.judged_s, self._models.seed)
        return gains if self.folds else self.fitted

    @cached_property
    def fitted(self) -> dict[str, Gain]:
        """Gain of each cause on the fitted trials."""
        models, found = self._models, self._found
        whole = Fold(found.nominal, found.best, found.without, models.trials)
        gains = gains_of([whole], found.without, models.judged_s, models.seed)
        return {n: replace(one, on=FITTED) for n, one in gains.items()}

    @cached_property
    def over_unrepeated(self) -> Mapping[str, float]:
        """See `Weighed`."""
        return {} if self.voluntary is None else over_voluntary(self.voluntary, self._found.best)

    @cached_property
    def carried(self) -> Mapping[str, float]:
        """Gain, percent, of causes with which free simulations of a driven joint are far worse.

        Predictions over a horizon begin again at the readings. A stop that the joint passes by little costs them
        little, and keeps a free simulation on its other side. In closed loop, where free simulations may drift, they
        are asked only of a set that follows the trials without the cause, and of no rig that falls by itself.
        """
        models, found = self._models, self._found
        if models.by_effort is None or models.judged_s is None or not found.without or self.falls:
            return {}
        noise = noise_that_is_small(found.best)
        error = {n: self._free_percent(f, noise) for n, f in {"": found.best, **found.without}.items()}
        far = (n for n in found.without if error[n] < WHOLE * SMALL_SHARE and error[""] > WORSE * error[n])
        return {n: 100.0 * (1.0 - error[""] / error[n]) for n in far}

    def _free_percent(self, fitted: LikelihoodFit, noise: NoiseModel) -> float:
        """Return E of free simulations of the fitted trials, percent; infinite where they are not finite."""
        found = free_errors(fitted.model, self._models.trials, noise, fitted).error_percent()
        return found if math.isfinite(found) else math.inf
