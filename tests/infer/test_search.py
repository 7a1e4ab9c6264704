"""Sets are extended by one candidate at a time; a rival that is better together with the others takes its place."""

import itertools
from types import SimpleNamespace

import pytest

from fes_pin.infer.search import Search

COST = {
    (): 0.0,
    ("lag",): -100.0,
    ("tendon",): -1.0,
    ("velocity",): -2.0,
    ("lag", "velocity"): -150.0,
    ("lag", "tendon"): -100.5,
    ("tendon", "velocity"): -400.0,
}
"""A tendon shows nothing without velocity, and a lag nearly as much as it alone."""


class Models:
    """Fits by their names, of which no candidate comes in but together with a set that is there."""

    most_candidates = 2
    better = True
    noise = True

    def __init__(self):
        self.fits = {(): self.fit(())}

    def fit(self, names):
        sse = COST[names]
        return SimpleNamespace(names=names, sse=sse, criterion=sse + 5.0 * len(names), degrees=len(names))

    def nominal(self):
        return self.fits[()]

    def has_room(self, names):
        return len(names) < self.most_candidates

    def is_claimed(self, name):
        return True

    def noise_p_value(self, gain, degrees):
        return 1e-6 if gain > 10.0 else 0.5

    def p_value(self, larger, smaller, gain=None):
        return self.noise_p_value(smaller.sse - larger.sse if gain is None else gain, 1)

    def extend(self, base, most=None):
        for name in ("lag", "tendon", "velocity"):
            names = tuple(sorted({*base, name}))
            self.fits.setdefault(names, self.fit(names))

    def converge_rivals(self, names, name):
        """All have converged."""

    def without(self, names, name):
        rest = tuple(n for n in names if n != name)
        return self.fits.setdefault(rest, self.fit(rest))

    def ranked(self, size):
        return sorted((n for n in self.fits if len(n) == size), key=lambda n: self.fits[n].criterion)

    def is_possible(self, fitted):
        return True

    def level(self, fitted):
        return 0.01

    def is_error_of_form(self, larger, gain, explained):
        return gain < 0.06 * explained

    def predicts_better(self, larger, smaller):
        return self.better

    def leaves_noise(self, fitted):
        return self.noise

    def better_form(self, fitted):
        return None


@pytest.fixture
def search():
    made = Search(Models(), lambda share, words: None)
    made.models.extend(())
    made.models.extend(("lag",))
    return made


def test_a_rival_that_is_better_together_with_the_others_is_the_answer(search):
    found = search.settle(("lag", "velocity"))
    assert found.best.names == ("tendon", "velocity")
    assert [f.names for f in found.rivals["tendon"]] == [("lag", "velocity")]
    assert set(found.without) == {"tendon", "velocity"}


def test_what_was_refused_comes_back_in_no_exchange(search):
    found = search.settle(("lag", "velocity"), rejected=("tendon",))
    assert found.best.names == ("lag", "velocity")


def test_an_answer_has_the_lowest_price_of_its_size(search):
    for size in (1, 2):
        for names in itertools.combinations(("lag", "tendon", "velocity"), size):
            search.models.fits.setdefault(names, search.models.fit(names))
            best = search.settle(names).best
            assert best.criterion == min(
                f.criterion for n, f in search.models.fits.items() if len(n) == len(best.names)
            )


def test_a_set_of_lower_price_with_a_candidate_that_is_not_significant_is_no_answer(search, monkeypatch):
    """As a hum that the pieces of the data do not agree on."""
    cheapest = ("tendon", "velocity")
    monkeypatch.setattr(search.models, "p_value", lambda more, less, gain=None: 0.5 if more.names == cheapest else 1e-6)
    found = search.settle(("lag", "velocity"))
    assert search.models.fits[cheapest].criterion < found.best.criterion
    assert found.best.names == ("lag", "velocity")
    assert cheapest not in search.possible()
    assert ("lag", "velocity") in search.possible()


@pytest.mark.parametrize(("gain", "accepted"), [(40.0, False), (80.0, True)])
def test_a_further_candidate_must_explain_more_than_errors_of_form_leave(gain, accepted, search):
    smaller, larger = (SimpleNamespace(sse=s, degrees=k) for s, k in ((-1000.0, 1), (-1000.0 - gain, 2)))
    assert search.is_accepted(larger, smaller) is accepted


def test_a_set_that_is_a_model_is_accepted_beside_one_that_is_none(search, monkeypatch):
    """An autoregression takes up every error of a simulation that is worse than a constant: it was the likelier."""
    near, wreck = (SimpleNamespace(sse=s, degrees=1, is_near=s > -50.0) for s in (-40.0, -100.0))
    assert not search.is_accepted(near, wreck)
    monkeypatch.setattr(search.models, "is_possible", lambda fitted: fitted.is_near)
    assert search.is_accepted(near, wreck) and not search.is_accepted(wreck, near)


@pytest.mark.parametrize(
    ("base", "better", "noise", "accepted"),
    [("lag", False, True, False), ("lag", True, True, True), ("", False, True, True), ("lag", False, False, True)],
)
def test_a_further_candidate_must_lessen_errors_of_prediction(base, better, noise, accepted, search):
    """As a play of a micrometre beside a friction: it gained 222 in likelihood, and a thousandth of the errors.

    Where the smaller set has a lack of fit a third candidate may bring that about, as with a muscle's lag and
    force-velocity.
    """
    best = (base,) if base else ()
    search.models.better, search.models.noise = better, noise
    names = ("lag", "velocity")
    assert search._is_accepted(names, best) is accepted
    assert (names in search.possible()) is accepted


def test_other_forms_are_tried_of_sets_with_half_of_what_they_must_gain(search):
    """With a lag in the set a tendon gains 0.5 and velocity 50, of 10 that are demanded: no form gives the other 9."""
    assert search._is_rough(("lag", "velocity"), ("lag",))
    assert not search._is_rough(("lag", "tendon"), ("lag",))
    search._reform(("lag", "velocity"))
    assert not search._is_rough(("lag", "velocity"), ("lag",))
