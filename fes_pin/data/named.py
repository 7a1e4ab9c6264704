"""Arrays whose last axis has names: of joints, of nerves. What holds them by position takes them by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import numbers, shortened


class NamedArray(np.ndarray):
    """Numbers with names along the last axis: an array that also answers by name.

    `q["right_knee_flexion"]`, `q[["left_hip_flexion", "right_hip_flexion"]]`, `q.items()`, `dict(q)`. Otherwise it is
    an array of numpy: it iterates over its numbers and computes as one. Elementwise results keep the names, and so do
    rows. All else that numpy makes of it (a slice, a matrix product) has none.

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
        if isinstance(key, list | tuple) and key and isinstance(key[0], str):
            return NamedArray(found, key)
        rows = self.ndim > 1 and not isinstance(key, str | tuple)
        return _named(found, self.names) if rows else found

    def __setitem__(self, key: Any, value: Any) -> None:
        super().__setitem__(self._place(key), value)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *given: Any, out: Any = None, **options: Any) -> Any:
        each = ufunc.signature is None and method == "__call__"
        names = {x.names for x in given if isinstance(x, NamedArray) and x.names is not None}
        if each and len(names) > 1:
            one, other = sorted(names)[:2]
            raise InputError(f"arrays of {one[0]}, ... and of {other[0]}, ... do not have the same names in one order")
        if out is not None:
            options["out"] = tuple(np.asarray(x) if isinstance(x, NamedArray) else x for x in out)
        found = getattr(ufunc, method)(*(np.asarray(x) if isinstance(x, NamedArray) else x for x in given), **options)
        if out is not None:
            return out[0] if len(out) == 1 else out
        return _named(found, names.pop()) if each and names else found

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return np.asarray(array)[()] if return_scalar else np.asarray(array)

    def copy(self, order: Any = "C") -> NamedArray:
        """A copy that may be changed."""
        return _named(np.array(self, order=order), self.names)

    def sort(self, *given: Any, **options: Any) -> None:
        """Sort in place, which parts numbers from their names: it then has none."""
        super().sort(*given, **options)
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


def _named(found: Any, names: tuple[str, ...] | None) -> Any:
    """An array of floats with names, if it has as many along its last axis; else as it is."""
    if names is None or not isinstance(found, np.ndarray) or found.dtype.kind != "f":
        return found
    if found.shape[-1:] != (len(names),):
        return found
    out = found.view(NamedArray)
    out.names = names
    return out
