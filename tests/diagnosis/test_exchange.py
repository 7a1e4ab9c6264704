"""Sets are extended one cause at a time; a rival that turns out better beside the others takes a cause's place."""

import itertools
import time
from types import SimpleNamespace

import numpy as np
import pytest

from fes_pin.diagnosis.decide.held_out import Gain
from fes_pin.diagnosis.remainder.open_set import Remainder
from fes_pin.diagnosis.search import likelihood_search
from fes_pin.diagnosis.search.likelihood_search import LikelihoodSearch
from fes_pin.diagnosis.search.score import Scores
from fes_pin.workers import check_limit, time_limit

PRICE = {
    (): 0.0,
    ("lag",): -100.0,
    ("tendon",): -1.0,
    ("velocity",): -2.0,
    ("lag", "velocity"): -150.0,
    ("lag", "tendon"): -100.5,
    ("tendon", "velocity"): -400.0,
}
"""A tendon shows nothing without velocity, and a lag nearly as much as it alone."""


class Sets:
    """Fits by their names, of which no cause comes in but beside a set that is there."""

    def __init__(self):
        self.fits, self.trials = {(): self.fit(())}, ()
        self.library = SimpleNamespace(silent=lambda: ())
        self.screen = SimpleNamespace(scores=lambda base: Scores([], np.zeros((0, 0)), np.zeros(0), []))
        self.forms = SimpleNamespace(
            refined=lambda base: None, simplified=lambda base: None, reformed=lambda base: None
        )

    def fit(self, names):
        sse = PRICE[names]
        random = SimpleNamespace(acting=("effort",))
        known = {"degrees": len(names), "model": SimpleNamespace(effects=()), "free": (), "doubt": random}
        return SimpleNamespace(names=names, sse=sse, price=sse + 5.0 * len(names), **known)

    def extend_all(self, base, most=None):
        for name in ("lag", "tendon", "velocity"):
            names = tuple(sorted({*base, name}))
            self.fits.setdefault(names, self.fit(names))

    def converge_rivals(self, base, name):
        """All have converged."""

    def without(self, names, name):
        rest = tuple(n for n in names if n != name)
        return self.fits.setdefault(rest, self.fit(rest))

    def ranked(self, size):
        return sorted((n for n in self.fits if len(n) == size), key=lambda n: self.fits[n].price)


@pytest.fixture
def search():
    made = LikelihoodSearch(Sets(), 0, lambda share, words: None)
    made.family = SimpleNamespace(p_value=lambda gain, degrees: 1e-6 if gain > 10.0 else 0.5)
    made.sets.extend_all(())
    made.sets.extend_all(("lag",))
    return made


def test_a_rival_that_is_better_beside_the_others_is_the_answer(search):
    found = search.settle(("lag", "velocity"))
    assert found.best.names == ("tendon", "velocity")
    assert [f.names for f in found.rivals["tendon"]] == [("lag", "velocity")]
    assert set(found.without) == {"tendon", "velocity"}


def test_what_was_refused_comes_back_in_no_exchange(search):
    found = search.settle(("lag", "velocity"), refused=("tendon",))
    assert found.best.names == ("lag", "velocity")


def test_an_answer_is_the_cheapest_of_its_size(search):
    for size in (1, 2):
        for names in itertools.combinations(("lag", "tendon", "velocity"), size):
            search.sets.fits.setdefault(names, search.sets.fit(names))
            best = search.settle(names).best
            assert best.price == min(f.price for n, f in search.sets.fits.items() if len(n) == len(best.names))


def test_a_cheaper_set_whose_cause_does_not_earn_its_place_is_no_answer(search, monkeypatch):
    """As a hum that the pieces of the data do not agree on."""
    cheapest = ("tendon", "velocity")
    monkeypatch.setattr(search, "p_value", lambda more, less: 0.5 if more.names == cheapest else 1e-6)
    found = search.settle(("lag", "velocity"))
    assert search.sets.fits[cheapest].price < found.best.price
    assert found.best.names == ("lag", "velocity")
    assert cheapest not in search.possible()
    assert ("lag", "velocity") in search.possible()


@pytest.mark.parametrize(("acting", "gain", "earned"), [((), 40.0, False), ((), 80.0, True), (("effort",), 40.0, True)])
def test_a_further_cause_must_explain_more_than_errors_of_form_leave(acting, gain, earned, search, monkeypatch):
    """Of what all causes do, where no random effort takes such errors up."""
    monkeypatch.setattr(search, "p_value", lambda more, less: 1e-6)
    smaller, larger = (SimpleNamespace(sse=s, doubt=SimpleNamespace(acting=acting)) for s in (-1000.0, -1000.0 - gain))
    assert search._is_earned(larger, smaller) is earned


@pytest.mark.parametrize(
    ("beside", "low", "left", "earns"),
    [("lag", 0.05, False, False), ("lag", 0.2, False, True), ("", 0.05, False, True), ("lag", 0.05, True, True)],
)
def test_what_stands_beside_a_cause_must_lessen_errors_ahead(beside, low, left, earns, search, monkeypatch):
    """As a play of a micrometre beside a friction: it gained 222 in likelihood, and a thousandth of the errors.

    Where something is left a third cause may bring that about, as beside a muscle's lag and force-velocity.
    """
    best = (beside,) if beside else ()
    search.sets.fits[best].model.effects = best
    monkeypatch.setattr(likelihood_search, "gains_of", lambda folds, *_: {"": Gain(1.0, low, 2.0)})
    monkeypatch.setattr(likelihood_search, "is_possible", lambda fit: True)
    monkeypatch.setattr(likelihood_search, "random_parts", lambda fit: ())
    monkeypatch.setattr(likelihood_search, "driven_remainder", lambda fit, seed: Remainder(left, 0.5, None))
    monkeypatch.setattr(search, "_horizon_s", 0.3)
    names = tuple(sorted({"lag", "velocity"}))
    search.sets.fits[names] = search.sets.fit(names)
    assert search._earns_beside(names, best) is earns
    assert (names in search.possible()) is earns


def test_other_forms_are_tried_of_sets_half_way_to_what_they_must_gain(search):
    """Beside a lag a tendon gains 0.5 and velocity 50, of 10 that are demanded: no form makes up for the rest."""
    assert search._is_rough(("lag", "velocity"), ("lag",))
    assert not search._is_rough(("lag", "tendon"), ("lag",))
    search._refine(("lag", "velocity"))
    assert not search._is_rough(("lag", "velocity"), ("lag",))


def test_no_other_form_is_tried_past_the_limit_of_the_search(search):
    better = search.sets.fits[()]
    search.sets.nominal, search.sets.forms.otherwise = lambda: better, lambda base: check_limit() or better
    assert search.form_otherwise(())
    search.sets.near = lambda size: check_limit()
    with time_limit(0.0):
        time.sleep(0.01)
        search.run()
    assert search.was_stopped
    assert not search.form_otherwise(())
