"""The causes of a driven joint by its recorded efforts: searched, judged, and with final values."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from fes_pin.data.trial import Trial
from fes_pin.effort.columns import Links
from fes_pin.effort.fits import EffortSets, effect_of
from fes_pin.effort.motion import Band, Record, band_of, has_rows, noise_of_bend
from fes_pin.effort.problem import EffortFit, Rows
from fes_pin.effort.timing import timed
from fes_pin.effort.verdict import EffortSearch, EffortState, EffortVerdict
from fes_pin.infer.covariance import covariance_of
from fes_pin.infer.fits import Names
from fes_pin.infer.held_out import Errors
from fes_pin.infer.problem import normal_equations
from fes_pin.infer.scatter import as_wide_as_estimates_differ, as_wide_as_trials_differ, with_honest_intervals
from fes_pin.infer.search import FITTED, Policy, Search
from fes_pin.models.effects import effect_named
from fes_pin.models.effects.coulomb_friction import STATED
from fes_pin.models.model import Model
from fes_pin.models.rigs.base import Rig
from fes_pin.models.rigs.joint import Joint

OTHER_BANDS = (0.7, 1.4)
"""Bands in which a set is fitted again, as shares of its own: half of the power of the acceleration apart."""
NOT_CARRIED = "the inertia moves by more than its interval between 0.7 and 1.4 of the band of the motion"
"""Why no values are given."""


class LikelihoodValues(Protocol):
    """A fit of a set of causes by another estimator."""

    @property
    def names(self) -> Names:
        """The set."""

    @property
    def free(self) -> Sequence[str]:
        """Names of the fitted parameters."""

    @property
    def values(self) -> Mapping[str, float]:
        """Values of all parameters."""


@dataclass(frozen=True, eq=False)
class FoundByEffort:
    """What a search of efforts found, before its values are final.

    Attributes
    ----------
    rig
        The joint, with the start values of its nominal parameters.
    verdict
        The verdict on what the search found.
    state
        The state to which no claim objects.
    others
        Sets of the same trials in other bands; see `OTHER_BANDS`.
    """

    rig: Joint
    verdict: EffortVerdict
    state: EffortState
    others: Sequence[EffortSets]

    @property
    def models(self) -> EffortSets:
        """The sets that were searched."""
        return self.verdict.search.models

    @property
    def band_hz(self) -> float:
        """Cut-off frequency of the low pass, Hz."""
        return self.models.rows.band.low

    @property
    def names(self) -> Names:
        """Names of the causes, in alphabetical order."""
        return tuple(sorted(self.state.names))

    def knows(self, names: Names) -> bool:
        """Return whether every cause of a set has a column."""
        return {*names} <= {*self.models.library}

    def errors(self, names: Names) -> Errors:
        """Return cross-validated errors of the low-passed effort of a set, of which it `knows` every cause."""
        return self.verdict.errors_of(self.models.fitted_set(names), self.state.found.best)

    def values_in(self, fitted: LikelihoodValues, names: Collection[str]) -> dict[str, float]:
        """Return the final values of the set of another fit, by trials of some names; those that mean the same in it.

        Parameters
        ----------
        names
            Names of the trials; all rows count where none is of a trial by these names.
        """
        kept = [np.full(len(t.rows), t.record.name in names) for t in self.models.rows.tracks]
        whole = self.models.fitted_set(fitted.names)
        final = self.models.final(whole, kept if any(one.any() for one in kept) else None)
        unlike = self.of_other_forms(fitted.free, final)
        return {n: final.values[n] for n in fitted.free if n in final.free and n not in unlike}

    def of_other_forms(self, free: Sequence[str], fitted: EffortFit) -> list[str]:
        """Return the fitted parameters of another fit whose cause has another form there than in a fit by efforts.

        The torque of dry friction is that of a joint at speed, where friction falls with the speed.
        """
        out = []
        for name in fitted.names:
            known = {f"{name}.{n}" for one in self.models.library[name].forms for n in one}
            known &= {f"{name}.{n}" for n in effect_named(name).parameters()}
            if known & {*free} != known & {*fitted.free}:
                out += [n for n in free if n.startswith(f"{name}.")]
        return out

    def final(self, fitted: EffortFit) -> EffortFit:
        """Return the final values of a set, with their intervals, and with the delay of commands where it shows."""
        return self._best[0] if fitted is self.state.found.best else self._final(fitted)[0]

    def near(self, fitted: LikelihoodValues) -> EffortFit:
        """Return the final values of the set of another fit, at the maximum that is nearest to the shapes of that fit.

        Two estimates of one truth are near each other. A periodic torque has a maximum at many periods, and a farther
        one says nothing of the error of an estimate (Hausman, Econometrica 46, 1978, compares consistent ones).
        """
        whole, causes = self.models.fitted_set(fitted.names), self.models.library
        same = {*fitted.free} & {*whole.free} - {*self.of_other_forms(fitted.free, whole)}
        if not any(f"{name}.{x}" in same for name in fitted.names for x in causes[name].free):
            return self.final(whole)
        begun = {n: fitted.values[n] for n in same if "." in n}
        return self.final(self.models.fit(fitted.names, {**whole.values, **begun}, whole.forms))

    @property
    def is_carried(self) -> bool:
        """Whether the inertia of the best set moves by no more than its interval between bands."""
        return not self._best[1]

    @cached_property
    def _best(self) -> tuple[EffortFit, bool]:
        return self._final(self.state.found.best)

    def _final(self, fitted: EffortFit) -> tuple[EffortFit, bool]:
        """Return the final values of a set, and whether its inertia moves between bands."""
        with timed(fitted, [self.models, *self.others]) as begun:
            final = _final(self.verdict, begun, self.others)
            return final, _moves(final, begun, self.others)

    @cached_property
    def alike(self) -> list[EffortFit]:
        """The best set, and the sets that its efforts do not distinguish from it."""
        found = self.state.found
        each = (self.models.equivalents(found.best, found.without[n], found.rivals[n]) for n in found.best.names)
        return list({f.names: f for f in [found.best, *(f for many in each for f in many)]}.values())

    def model(self, fitted: EffortFit | None = None) -> Model:
        """Return the set, or another fit, as a model of the catalogue."""
        fitted, info = fitted or self.state.found.best, self.rig.parameters()
        effects = (effect_of(fitted.values, self.models.library[n]) for n in fitted.names)
        nominal = {n: one.nearest(fitted.values[n]) for n, one in info.items() if n in fitted.free}
        return Model(self.rig, tuple(effects)).with_parameters(nominal)


def has_efforts(rig: Rig, trials: Sequence[Trial]) -> bool:
    """Return whether trials have what inverse dynamics takes: efforts and positions of a joint, without gaps."""
    wanted = ("effort", "position")
    known = (all(n in t.columns and np.isfinite(t[n]).all() for n in wanted) and t["effort"].any() for t in trials)
    return isinstance(rig, Joint) and bool(trials) and all(known)


def searched(rig: Joint, trials: Sequence[Trial], seed: int = 0) -> FoundByEffort:
    """Search the causes of a joint by least squares of its low-passed efforts.

    Parameters
    ----------
    rig
        The nominal model with its start values.
    trials
        For which `has_efforts` is true.

    Raises
    ------
    InputError
        The motion is not above the noise of its reading, or trials are shorter than the filter.
    """
    records = [Record.of(t) for t in trials]
    links = Links.of_rig(rig)
    values = {n: float(getattr(rig, n)) for n in rig.parameters()}
    values |= {STATED: links.friction} if links.friction else {}
    fitted = [n for n in rig.fitted_parameters() if n != "gravity_scale" or links.cosine or links.sine]
    band = band_of(records)

    def sets_in(one: Band) -> EffortSets:
        return EffortSets(Rows(records, one, links), values, fitted, seed)

    search: EffortSearch = Search(sets_in(band), lambda share, words: None, Policy(fitted_first=FITTED))
    verdict = EffortVerdict(search)
    state = verdict.of(search.run())
    bands = [replace(band, low=r * band.low, wide=max(band.wide, r * band.low)) for r in OTHER_BANDS]
    return FoundByEffort(rig, verdict, state, [sets_in(one) for one in bands if has_rows(records, one)])


def _final(verdict: EffortVerdict, fitted: EffortFit, others: Sequence[EffortSets]) -> EffortFit:
    """Return a set by plain least squares, with intervals that contain errors of form.

    They are those of the scores of pieces, as wide as parts that are left out differ, and they include the difference
    to each other estimate where that is significant: by Student's weights, without the rows near reversals, where the
    form of friction matters most, and in other bands.
    """
    sets = verdict.search.models
    plain = sets.final(fitted)
    wide = as_wide_as_trials_differ(with_honest_intervals(plain), verdict.refits(plain))
    moving = [~near_to(r) for r in sets.rows.reversing]
    again = [fitted, *(one.final(fitted) for one in others)]
    if all(one.sum() > len(plain.free) for one in moving):
        again.append(sets.final(fitted, moving))
    for other in again:
        wide = as_wide_as_estimates_differ(wide, with_honest_intervals(other))
    bias = attenuation(wide, sets.rows)
    return replace(wide, covariance=wide.covariance + np.outer(bias, bias))


def near_to(some: np.ndarray) -> np.ndarray:
    """Return which rows are some, or neighbours of these, shape (m,) of bool."""
    return np.convolve(some, np.ones(3, bool), mode="same")


def attenuation(fitted: EffortFit, rows: Rows) -> np.ndarray:
    """Return what noise of the acceleration takes from each fitted parameter, shape (p,); instruments would return it.

    With C the covariance of a right model and n rows, noise of variance s^2 in the column of a parameter J moves the
    estimate by C_J n s^2 J / variance (Fuller, Measurement Error Models, 1987). The band keeps it small
    (`NOISE_SHARE`), so that no instrumental variables are needed.
    """
    name = "inertia_scale"
    if name not in fitted.free:
        return np.zeros(len(fitted.free))
    system = normal_equations(fitted.parts)
    known = covariance_of(system.hessian, np.isin(fitted.free, fitted.at_bound, invert=True))[:, fitted.place(name)]
    power = rows.links.inertia**2 * noise_of_bend(rows.band) / fitted.variances[0]
    return np.where(np.isfinite(known), known, 0.0) * fitted.samples * power * fitted.values[name]


def _moves(final: EffortFit, fitted: EffortFit, others: Sequence[EffortSets]) -> bool:
    """Return whether the inertia moves by more than its interval between bands."""
    name = "inertia_scale"
    if name not in final.free:
        return False
    again = [with_honest_intervals(sets.final(fitted)) for sets in others]
    return any(abs(one.values[name] - final.values[name]) > final.reach(name) + one.reach(name) for one in again)
