"""Structures of a file that nests vectors, each perhaps a trial: of struct arrays, of cells, of a struct."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np


def elements_in(content: Any, name: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Each structure in a file by its dotted name, `trials.2`, `data.walk1`: what it holds, and what stands above it.

    A struct array is read as a list for each field: its elements are put together again.
    """
    if not isinstance(content, Mapping):
        content = {"": content}
    content = {str(key): value for key, value in content.items() if not str(key).startswith("__")}
    parts, used = _parts(content)
    above = {_dotted(name, key): value for key, value in content.items() if key not in used}
    for key, one in parts.items():
        yield _dotted(name, key), {**above, **one}
        for inner, its in elements_in(one, _dotted(name, key)):
            yield inner, {**above, **its}


def _dotted(*names: str) -> str:
    return ".".join(n for n in names if n)


def _parts(content: Mapping[str, Any]) -> tuple[dict[str, Mapping[str, Any]], set[str]]:
    """Structures next to each other by name, and keys of what they are made of."""
    parts: dict[str, Mapping[str, Any]] = {k: v for k, v in content.items() if isinstance(v, Mapping)}
    count = next(iter(Counter(len(v) for v in content.values() if _is_list_of_parts(v)).most_common(1)), (0, 0))[0]
    lists = {k: v for k, v in content.items() if isinstance(v, list) and len(v) == count > 1}
    for place in range(count if lists else 0):
        its = {k: v[place] for k, v in lists.items()}
        if len(its) == 1 and isinstance(one := next(iter(its.values())), Mapping):  # a cell array of structs
            parts[_dotted(next(iter(its)), str(place + 1))] = one
        else:
            parts[str(place + 1)] = its
    return parts, {k for k, v in content.items() if isinstance(v, Mapping)} | {*lists}


def _is_list_of_parts(value: Any) -> bool:
    """Return whether a value is a list of vectors or structures; lists of equally many numbers are a matrix."""
    if not isinstance(value, list) or not any(isinstance(one, np.ndarray | list | Mapping) for one in value):
        return False
    return not all(isinstance(one, list) for one in value) or len({len(one) for one in value}) > 1
