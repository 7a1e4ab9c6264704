"""Arrays with names: what was asked for by name is never taken by position."""

import copy
import json
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


def test_a_number_by_name_is_a_float_that_stays_as_it_is(q):
    old = q["knee"]
    assert isinstance(old, float)
    assert (round(old), json.dumps(old), hash(old), f"{old:.1f}") == (2, "2.0", hash(2.0), "2.0")
    q["knee"] += 1e-3
    assert old == 2.0 and q["knee"] == 2.001
    q["knee"] = old
    assert dict(q) == {"hip": 1.0, "knee": 2.0, "ankle": 3.0}
    assert json.loads(json.dumps(dict(q))) == dict(q)
    assert all(isinstance(value, float) for _, value in q.items())


def test_a_column_by_name_stays_as_it_is_and_is_written_by_name_alone():
    rows = NamedArray([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], NAMES)
    old = rows["knee"]
    rows["knee"] += 1.0
    assert old.tolist() == [2.0, 5.0] and rows["knee"].tolist() == [3.0, 6.0]
    rows["knee"] = old
    rows["ankle"][0] = 7.0  # of the copy
    rows[1:]["hip"] = 8.0
    assert rows.tolist() == [[1.0, 2.0, 3.0], [8.0, 5.0, 6.0]]


GIVEN = [(), (0,), (1,), (2, 0), ([2, 1, 0],), ([2, 1, 0], 0), (0.5,), ([0.1, 0.5, 0.9],), (np.array([True] * 3),)]
"""What functions take in addition to an array: a number, an order, quantiles, a mask."""
WRITE = ("copyto", "fill_diagonal", "place", "put", "put_along_axis", "putmask", "save", "savetxt", "savez", "shuffle")
"""Functions that write by position into what they are given, or files."""


def functions():
    """Every function of numpy that arrays of other kinds may take over; and those that draw."""
    drawing = np.random.default_rng(0)
    for module in (np, np.fft, np.linalg):
        for name in dir(module):
            one = getattr(module, name)
            if hasattr(one, "_implementation") and not name.startswith(WRITE):
                yield name, one
    for name in ("permutation", "permuted", "choice", "normal", "poisson", "dirichlet"):
        yield name, getattr(drawing, name)


def calls(one, x):
    """What a function makes of an array and of everything that it can take as well."""
    for more in (*GIVEN, (x,), (x, x)):
        try:
            found = one(x, *more)
        except Exception:
            continue
        yield from found if isinstance(found, tuple | list) else [found]


@pytest.mark.filterwarnings("ignore")
def test_of_all_functions_of_numpy_only_elementwise_ones_keep_the_names():
    """Whatever reorders, sorts, draws or interpolates: its numbers are not those of the names."""
    known, kept = set(), set()
    for name, one in functions():
        for x in (NamedArray([3.0, 1.0, 2.0], NAMES), NamedArray(np.eye(3)[[2, 0, 1]], NAMES)):
            for found in calls(one, x):
                known.add(name)
                kept |= {name} if hasattr(found, "keys") else set()
    assert kept == {"clip", "round", "around"}
    assert len(known) > 200
    assert {"partition", "sort", "flip", "roll", "take", "permutation", "permuted", "quantile", "kron"} <= known


def test_methods_that_reorder_lose_the_names(q):
    for method, more in (("take", ([2, 1, 0],)), ("repeat", (1,)), ("compress", ([1, 1, 1],)), ("reshape", (3,))):
        assert not hasattr(getattr(q, method)(*more), "keys")
    for method, more in (("sort", ()), ("partition", (1,))):
        changed = NamedArray([3.0, 1.0, 2.0], NAMES)
        getattr(changed, method)(*more)
        assert not hasattr(changed, "keys")


@pytest.mark.parametrize(
    "write",
    [
        lambda q, out: np.take(q, [2, 1, 0], out=out),
        lambda q, out: np.matmul(np.eye(3)[::-1], q, out=out),
        lambda q, out: np.cumsum(q, out=out),
    ],
)
def test_an_array_that_such_a_result_is_written_to_loses_its_names(q, write):
    out = q.copy()
    write(q, out)
    assert not hasattr(out, "keys") and q.names == NAMES


def test_an_elementwise_result_is_written_to_an_array_of_the_same_names(q):
    out = np.clip(q, 1.5, 2.5, out=q.copy())
    assert dict(out) == {"hip": 1.5, "knee": 2.0, "ankle": 2.5}
    with pytest.raises(InputError, match="do not have the same names in one order"):
        np.add(q, 1.0, out=q.arranged(NAMES[::-1]))


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
