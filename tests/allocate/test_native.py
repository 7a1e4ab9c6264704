"""The lowering of plain functions to machine code: the same numbers as the interpreter, and no silent gaps."""

import numpy as np
import pytest

from fes_pin.allocate.native import Integers, Native, Reals, address


def inner(n: int, a: Reals, shift: float):
    for i in range(n):
        a[i] += shift if i % 2 == 0 else -shift
    return n


def everything(n: int, k: int, x: float, a: Reals, b: Integers):
    """All that may be used, once."""
    total = 0.0
    count = 0
    for i in range(1, n):
        if (a[i] > x and not (a[i] > 2.0 * x)) or b[i] == 3:
            total += a[i] * x - abs(a[i - 1]) / 2.0
            b[i] = count
        elif a[i] != x:
            total -= float(b[i] // 2)
        else:
            pass
    while True:
        count += 1
        if count >= k:
            break
    inner(n - 2, a[2:], total)
    a[0] = -total if total < 0 else total
    return count * 10 - n


def test_machine_code_gives_the_interpreters_numbers():
    rng = np.random.default_rng(0)
    native = Native(inner, everything)
    for _ in range(200):
        n = int(rng.integers(3, 12))
        a, b = rng.normal(size=n), rng.integers(-5, 5, n)
        a2, b2 = a.copy(), np.abs(b)
        b = b2.copy()
        expected = everything(n, 4, 0.3, a, b)
        assert native["everything"](n, 4, 0.3, address(a2), address(b2)) == expected
        np.testing.assert_allclose(a2, a, atol=1e-14)
        np.testing.assert_array_equal(b2, b)


def unsupported(n: int):
    total = [n]
    return total


def test_what_cannot_be_lowered_is_refused():
    with pytest.raises(NotImplementedError, match="List"):
        Native(unsupported)


def test_addresses_are_of_contiguous_arrays_only():
    with pytest.raises(ValueError, match="contiguous"):
        address(np.zeros((4, 4))[:, 1])
