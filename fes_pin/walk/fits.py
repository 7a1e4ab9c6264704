"""Fits of sets of forms to a walk: many at once, each kept; sizes that cannot be are no explanation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from fes_pin.walk.banks import Banks, Chosen
from fes_pin.walk.likelihood import Fitted, fit_many, fitted_of
from fes_pin.workers import check_limit

TOGETHER = 64
"""Fits that are made at once: as many as a processor's cache holds."""
POSSIBLE = 3.0
"""Sizes beyond this many times the plausible one are no explanation."""


@dataclass(frozen=True)
class Set:
    """A set of forms with its fit; its price is its deviance: sizes are integrated over their priors."""

    forms: Chosen
    fitted: Fitted = field(repr=False)
    price: float


class WalkFits:
    """One diagnosis's fits.

    Attributes
    ----------
    banks
        What is fitted.
    readings
        By form whose parameter a trial shows directly, its value and standard deviation.
    is_limited
        Whether a limit of time may end them: once there is a set to fall back on.
    """

    def __init__(self, banks: Banks) -> None:
        self.banks = banks
        self.readings = dict(_read_off(banks))
        self.is_limited = False
        self._made: dict[Chosen, Set] = {}

    def turn(self, left: np.ndarray) -> None:
        """Rotate the channels for what is left, (1, 6, k); every set is fitted anew."""
        self.banks.turn(left)
        self._made = {}

    def fit(self, chosen: Chosen) -> Set:
        """A set's fit; kept."""
        return self.fit_all([chosen])[0]

    def fit_all(self, wanted: Iterable[Chosen]) -> list[Set]:
        """Fits of many sets, those of as many parameters and one clock together; kept."""
        sets = [tuple(sorted(chosen)) for chosen in wanted]
        groups: dict[tuple[int, bool], list[Chosen]] = {}
        for chosen in dict.fromkeys(sets):
            if chosen not in self._made:
                count = sum(len(self.banks.forms[i].parameters) for i in chosen)
                groups.setdefault((count, self.banks.shift in chosen), []).append(chosen)
        for (count, _), group in groups.items():
            for at in range(0, len(group), TOGETHER):
                if self.is_limited:
                    check_limit()
                self._fit_alike(group[at : at + TOGETHER], count)
        return [self._made[chosen] for chosen in sets]

    def _fit_alike(self, group: list[Chosen], count: int) -> None:
        noise = self.banks.noise
        y = noise.rotated(self.banks.bank(group[0]).y)
        x = np.stack([self.banks.columns(chosen) for chosen in group])
        prior = np.array([[size for i in chosen for size in self.banks.forms[i].plausible] for chosen in group])
        prior = prior.reshape(len(group), count)
        found = fit_many(np.broadcast_to(y, (len(group), *y.shape)), x, prior, noise)
        for k, chosen in enumerate(group):
            fitted = fitted_of(found, k)
            possible = bool((np.abs(fitted.believed) <= POSSIBLE * prior[k]).all())
            possible &= all(self._may_be(i, v) for i, v in self._named(chosen, fitted.believed))
            self._made[chosen] = Set(chosen, fitted, fitted.deviance if possible else np.inf)

    def _may_be(self, form: int, value: float) -> bool:
        """Whether a value has a meaning, and is what can be read off where it can."""
        if self.banks.forms[form].positive and value < 0.0:
            return False
        known = self.readings.get(form)
        return known is None or abs(value - known[0]) <= POSSIBLE * known[1]

    def _named(self, chosen: Chosen, values: np.ndarray) -> Iterator[tuple[int, float]]:
        """Form and value of every parameter of a set."""
        owners = [i for i in chosen for _ in self.banks.forms[i].parameters]
        return zip(owners, values.tolist(), strict=False)

    def sizes(self, one: Set) -> dict[int, np.ndarray]:
        """Values of a set's parameters by form; a shift counts from the clock as it was read."""
        out: dict[int, list[float]] = {i: [] for i in one.forms}
        for i, value in self._named(one.forms, one.fitted.values):
            out[i].append(value + (self.banks.shifted.later_s if self.banks.forms[i].shifts else 0.0))
        return {i: np.array(values) for i, values in out.items()}


def _read_off(banks: Banks) -> Iterator[tuple[int, tuple[float, float]]]:
    """Forms whose parameter a trial shows directly: the mean over trials, and its standard deviation."""
    for i, form in enumerate(banks.forms):
        found = [form.reading(scene) for scene in banks.as_read.scenes] if form.reading else []
        known = [one for one in found if one is not None]
        if known:
            yield i, (float(np.mean([value for value, _ in known])), known[0][1])
