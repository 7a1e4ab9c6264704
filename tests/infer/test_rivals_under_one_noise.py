"""Rivals of a converged set are compared with it under one noise."""

from dataclasses import dataclass

import pytest

from fes_pin.infer.fits import FittedSets


@dataclass(frozen=True)
class OneFit:
    """A fit whose criterion under the noise of the best set, and the gain of a further step, are given."""

    criterion: float
    there: float = 0.0
    step: float = 0.0
    degrees: int = 1
    sse: float = 0.0


class Sets(FittedSets):
    """Fits by name; first fits were made under the noise of the nominal model."""

    def __init__(self, rival):
        super().__init__()
        self.fits = {(): OneFit(0.0, there=500.0), ("a",): OneFit(-100.0, there=-100.0), ("b",): rival}
        self._converged = {(), ("a",)}
        self.asked = []

    def nominal(self):
        raise NotImplementedError

    def candidates(self, base):
        raise NotImplementedError

    def begin(self, base, starts):
        raise NotImplementedError

    def without(self, names, name):
        raise NotImplementedError

    def under_noise_of(self, other, fits):
        assert other is self.fits["a",]
        return [OneFit(f.there, step=f.step) for f in fits]

    def step_gain(self, fitted):
        return fitted.step

    def converged(self, fits):
        self.asked += fits
        return [OneFit(-120.0) for _ in fits]


@pytest.mark.parametrize(
    ("rival", "converges"),
    [
        (OneFit(-10.0, there=-90.0), True),
        (OneFit(600.0, there=700.0, step=790.0), True),
        (OneFit(-10.0, there=300.0, step=50.0), False),
        (OneFit(-99.0, there=400.0), False),
    ],
    ids=["hidden by the noise of a smaller set", "its first fit failed", "far", "near under another noise alone"],
)
def test_a_rival_converges_where_a_step_under_the_noise_of_the_best_explains_half_as_much(rival, converges):
    sets = Sets(rival)
    sets.converge_rivals(("a",), "a")
    assert [f.criterion for f in sets.asked] == [min(rival.criterion, rival.there)] * converges
    assert sets.ranked(1)[0] == (("b",) if converges else ("a",))
    asked = len(sets.asked)
    sets.converge_rivals(("a",), "a")
    assert len(sets.asked) == asked
