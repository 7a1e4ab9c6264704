"""Arrays whose last axis has names: of joints, of nerves. What holds them by position takes them by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import numbers, shortened

ELEMENTWISE = (np.clip, np.round, np.around)
"""Functions of numpy that are no ufuncs and whose results keep the names: they compute by ufuncs."""


class NamedArray(np.ndarray):
    """Numbers with names along the last axis: an array that also answers by name.

    `q["right_knee_flexion"]`, `q[["left_hip_flexion", "right_hip_flexion"]]`, `q.items()`, `dict(q)`. Otherwise it is
    an array of numpy: it iterates over its numbers and computes as one. Elementwise results keep the names: those of
    operators and ufuncs, of `np.clip` and `np.round`; so do rows and copies. All else that numpy makes of it (a slice,
    a sorted array, a matrix product) has none.

    What is taken by name stays as it is when the array changes: a float of an array (n,), of others a copy of the
    column. `q[name] = ...` writes by name, `q[3:][name] = ...` a part of a column, and `q[name][3:] = ...` writes to
    the copy alone. What is written by position (`q[0] = ...`, `np.put`, `np.random.shuffle`) stands under the name of
    that position.

    Parameters
    ----------
    values
        (..., n) numbers; they are copied.
    names
        The n names.

    Raises
    ------
    InputError
        Values that are no numbers, names that are no text or not as many; two arrays whose names differ, or differ in
        order, in one operation.
    """

    names: tuple[str, ...] | None = None

    def __new__(cls, values: Any, names: Iterable[str]) -> NamedArray:
        found = numbers(values, "values").view(cls)
        found.names = () if isinstance(names, str) or not isinstance(names, Iterable) else tuple(names)
        if not all(isinstance(name, str) for name in found.names):
            raise InputError(f"names are text, got {shortened(found.names)}")
        if found.shape[-1:] != (len(found.names),):
            raise InputError(f"{len(found.names)} names need as many numbers, got an array of shape {found.shape}")
        return found

    @property
    def keys(self) -> Callable[[], tuple[str, ...]]:
        """The names, as mappings give them."""
        names = self.names
        if names is None:
            raise AttributeError("an array without names has no keys")
        return lambda: names

    def items(self) -> Iterator[tuple[str, Any]]:
        """Pairs of name and number, or of name and column."""
        return ((name, self[name]) for name in self.keys())

    def get(self, name: str, default: Any = None) -> Any:
        """The number of a name, or the default."""
        return self[name] if name in self else default  # noqa: SIM401

    def arranged(self, names: Sequence[str], default: float = 0.0) -> NamedArray:
        """The same numbers in another order: (..., m); absent names get the default."""
        out = NamedArray(np.full((*self.shape[:-1], len(names)), default), names)
        for i, name in enumerate(names):
            if name in self:
                out[..., i] = self[name]
        return out

    def __contains__(self, thing: object) -> bool:
        return thing in (self.names or ()) if isinstance(thing, str) else bool((np.asarray(self) == thing).any())

    def _place(self, key: Any) -> Any:
        """An index by position for names; any other index as it is."""
        several = isinstance(key, list | tuple) and bool(key) and all(isinstance(each, str) for each in key)
        if not (several or isinstance(key, str)):
            return key
        places = []
        for name in key if several else [key]:
            if name not in self:
                raise InputError(f"{name!r} is not one of {', '.join(self.names or ())}")
            places.append((self.names or ()).index(name))
        return (..., places if several else places[0])

    def __getitem__(self, key: Any) -> Any:
        found = np.asarray(self)[self._place(key)]
        if isinstance(key, str):
            return found.copy() if found.ndim else np.float64(found)
        if isinstance(key, list | tuple) and key and isinstance(key[0], str):
            return NamedArray(found, key)
        rows = self.ndim > 1 and not isinstance(key, tuple)
        return _named(found, self.names) if rows else found

    def __setitem__(self, key: Any, value: Any) -> None:
        super().__setitem__(self._place(key), value)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *given: Any, out: Any = (), **options: Any) -> Any:
        each = ufunc.signature is None and method == "__call__"
        names = {x.names for x in (*given, *out) if isinstance(x, NamedArray) and x.names is not None}
        if each and len(names) > 1:
            one, other = sorted(names)[:2]
            raise InputError(f"arrays of {one[0]}, ... and of {other[0]}, ... do not have the same names in one order")
        if out:
            options["out"] = _plain(out)
        found = getattr(ufunc, method)(*_plain(given), **options)
        if out:
            _without_names(() if each else out)
            return out[0] if len(out) == 1 else out
        return _named(found, names.pop()) if each and names else found

    def __array_function__(self, func: Callable[..., Any], types: Any, args: Any, options: Any) -> Any:
        if func in ELEMENTWISE:
            return super().__array_function__(func, types, args, options)
        _without_names([options.get("out")])
        return func(*_plain(args), **{key: _plain(each) for key, each in options.items()})

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return np.asarray(array)[()] if return_scalar else np.asarray(array)

    def copy(self, order: Any = "C") -> NamedArray:
        """A copy that may be changed."""
        return _named(np.array(self, order=order), self.names)

    def sort(self, *given: Any, **options: Any) -> None:
        """Sort in place, which parts numbers from their names: it then has none."""
        super().sort(*given, **options)
        self.names = None

    def partition(self, *given: Any, **options: Any) -> None:
        """Partition in place, which parts numbers from their names as well."""
        super().partition(*given, **options)
        self.names = None

    def __copy__(self) -> NamedArray:
        return self.copy()

    def __deepcopy__(self, memo: Any) -> NamedArray:
        return self.copy()

    def __reduce__(self) -> Any:
        return _named, (np.asarray(self), self.names)

    def __repr__(self) -> str:
        if self.ndim != 1 or self.names is None:
            return repr(np.asarray(self))
        return f"NamedArray({', '.join(f'{name}={value:.6g}' for name, value in self.items())})"

    __str__ = __repr__


def _plain(given: Any) -> Any:
    """What numpy was given, without names: arrays share their numbers."""
    if type(given) in (list, tuple):
        return type(given)(map(_plain, given))
    return np.asarray(given) if isinstance(given, NamedArray) else given


def _without_names(written: Iterable[Any]) -> None:
    for array in written:
        if isinstance(array, NamedArray):
            array.names = None


def _named(found: Any, names: tuple[str, ...] | None) -> Any:
    """An array of floats with names, if it has as many along its last axis; else as it is."""
    if names is None or not isinstance(found, np.ndarray) or found.dtype.kind != "f":
        return found
    if found.shape[-1:] != (len(names),):
        return found
    out = found.view(NamedArray)
    out.names = names
    return out
