"""Structures of a file that nests vectors, each perhaps a trial: of struct arrays, of cells, of a struct."""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np

from fes_pin.data.errors import listed
from fes_pin.data.units import words_of

TIMES = frozenset({"t", "time", "times"})
"""Names of a vector that no unit of its structure is for."""
FEWEST = 50
"""Samples that vectors have at least of which some are a sample longer: shorter ones are settings (a round figure)."""


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


def units_in(content: Any, found: Collection[str], name: str = "") -> dict[str, str]:
    """Units by the names of vectors whose structure states one: `Torque.values` of one with `units`."""
    units: dict[str, str] = {}
    for key, value in content.items() if isinstance(content, Mapping) else ():
        units |= units_in(value, found, _dotted(name, str(key)))
        if str(key).lower() in ("unit", "units") and isinstance(value, str) and name:
            its = [n for n in found if n.rpartition(".")[0] == name and not TIMES & words_of(n.rpartition(".")[2])]
            units |= dict.fromkeys(its, value)
    return units


def of_one_length(found: Mapping[str, np.ndarray]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Vectors without a last sample that others do not have, as channels that a logger stopped one by one; and why.

    Channels are vectors of one structure, or each alone in its own; others may be trials.
    """
    out, said, by_length = dict(found), list[str](), defaultdict[int, list[str]](list)
    for name, values in found.items():
        by_length[len(values)].append(name)
    for count, names in sorted(by_length.items()):
        every = [*names, *by_length.get(count - 1, ())]
        apart = len({n.rpartition(".")[0] for n in every})
        is_pair = len(every) > len(names) and not {count - 2, count + 1} & by_length.keys()
        if count > FEWEST and is_pair and apart in (1, len(every)) and not any(n[-1:].isdigit() for n in every):
            out |= {n: found[n][:-1] for n in names}
            said.append(f"{listed(names)} have one sample more than others: their last one is left out")
    return out, said
