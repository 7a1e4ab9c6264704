"""Arrays with names: what was asked for by name is never taken by position."""

import copy
import pickle
from collections.abc import Mapping

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fes_pin.data.errors import InputError
from fes_pin.data.named import NamedArray
from fes_pin.data.numbers import by_name

NAMES = ("hip", "knee", "ankle")


@pytest.fixture
def q():
    return NamedArray([1.0, 2.0, 3.0], NAMES)


def test_it_answers_by_name_and_is_an_array_otherwise(q):
    assert (q["knee"], q[1], q.get("toe", 7.0), q.get("hip")) == (2.0, 2.0, 7.0, 1.0)
    assert dict(q) == dict(q.items()) == {"hip": 1.0, "knee": 2.0, "ankle": 3.0}
    assert list(q) == [1.0, 2.0, 3.0]
    assert "knee" in q and "toe" not in q and 3.0 in q
    assert q[["ankle", "hip"]].names == ("ankle", "hip")
    assert q[["ankle", "hip"]].tolist() == [3.0, 1.0]
    assert "knee=2" in repr(q)
    q["knee"] = 5.0
    assert q.tolist() == [1.0, 5.0, 3.0]


def test_elementwise_results_and_rows_keep_the_names_and_nothing_else_does(q):
    rows = NamedArray([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], NAMES)
    for same in (q + 1.0, np.degrees(q), -q, q * np.ones(3), q + q, rows[1], rows[:1], next(iter(rows)), rows - q):
        assert same.names == NAMES
    for other in (q[::-1], q[:2], q > 0.0, np.eye(3) @ q, np.flip(q), np.sort(q), np.roll(q, 1), q.T, rows[:, 0]):
        assert not hasattr(other, "keys")
    q += 1.0
    assert q["hip"] == 2.0


def test_arrays_in_two_orders_do_not_add_up(q):
    with pytest.raises(InputError, match="do not have the same names in one order"):
        q + q.arranged(NAMES[::-1])
    assert (q + q.arranged(NAMES[::-1]).arranged(NAMES)).tolist() == [2.0, 4.0, 6.0]


def test_what_does_not_fit_is_refused(q):
    with pytest.raises(InputError, match="2 names need as many numbers"):
        NamedArray([1.0, 2.0, 3.0], NAMES[:2])
    with pytest.raises(InputError, match="'toe' is not one of hip, knee, ankle"):
        q["toe"]


@given(st.permutations(NAMES), st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3))
def test_another_order_means_the_same(order, values):
    q = NamedArray(values, NAMES)
    assert dict(q.arranged(order)) == dict(q)
    assert by_name(q.arranged(order), NAMES, "x", 0.0).tolist() == values
    for same in (copy.copy(q), copy.deepcopy(q), pickle.loads(pickle.dumps(q)), q.copy()):
        assert dict(same) == dict(q)
        same["hip"] = 2e3
        assert dict(q) == dict(zip(NAMES, values, strict=True))


@pytest.mark.parametrize("kind", [dict, pd.Series, lambda d: NamedArray(list(d.values()), d)])
def test_numbers_by_name_are_taken_from_whatever_has_names(kind):
    given = kind({"ankle": 3.0, "hip": 1.0})
    assert not isinstance(given, Mapping) or isinstance(given, dict)
    assert by_name(given, NAMES, "x", 0.5).tolist() == [1.0, 0.5, 3.0]
    with pytest.raises(InputError, match="x names 'hip'"):
        by_name(given, NAMES[1:], "x", 0.5)
