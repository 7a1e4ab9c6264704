"""What trials can and cannot tell of the ankle's constants, found from the model and said in words.

Every constant is moved a little, in its logarithm, and the readings are watched. Directions in which nothing moves are
combinations that no amount of such data can show; what can be found is a set of products, like a / J, that the data
determine.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import all_known
from fes_pin.data.show import Tabulated, frame
from fes_pin.data.trial import Trial
from fes_pin.models.model import Model
from fes_pin.models.simulate import Simulator

if TYPE_CHECKING:
    import pandas

SYMBOLS = {
    "gain": "K",
    "force_scale_n": "F_ref",
    "time_constant_s": "tau",
    "moment_arm_m": "a",
    "com_distance_m": "l",
    "damping_nms": "xi",
    "inertia_kgm2": "J",
}
"""The ankle's constants as the paper writes them; J last, so that the others are given as shares of it."""
CHANGE = 1e-4
"""Change of a logarithm in the central differences: they err by 1e-8 of the answer."""
UNSEEN = 1e-5
"""Singular value, relative to the largest, below which a direction does not show: far above the differences' error."""


@dataclass(frozen=True, eq=False)
class Identifiability(Tabulated):
    """What trials determine.

    Attributes
    ----------
    names
        Of the constants that were moved.
    sensitivity
        Shape (n, names): change of all readings by the constants' logarithms, each kind in units of its size.
    """

    names: tuple[str, ...]
    sensitivity: np.ndarray

    @property
    def _seen(self) -> np.ndarray:
        """Orthonormal basis of what shows, shape (r, names)."""
        _, values, vectors = np.linalg.svd(self.sensitivity, full_matrices=False)
        return vectors[values > UNSEEN * values[0]]

    def determines(self, powers: Mapping[str, float]) -> bool:
        """True if the data determine the product of constants to these powers.

        Raises
        ------
        InputError
            For a constant that was not moved.
        """
        w = np.zeros(len(self.names))
        all_known(powers, self.names, "constant")
        for name, power in powers.items():
            w[self.names.index(name)] = power
        seen = self._seen
        return bool(np.linalg.norm(w - seen.T @ (seen @ w)) <= 1e-4 * np.linalg.norm(w))

    def to_frame(self) -> pandas.DataFrame:
        """The constants as a frame of pandas, a row a constant: whether the data determine it singly."""
        single = [self.determines({n: 1.0}) for n in self.names]
        return frame({"constant": self.names, "determined": single}, index="constant")

    def products(self) -> tuple[dict[str, float], ...]:
        """A smallest set of products that the data determine, each by powers."""
        rows = _reduced(self._seen)
        return tuple({n: float(p) for n, p in zip(self.names, row, strict=True) if abs(p) > 1e-3} for row in rows)

    def __str__(self) -> str:
        single = [n for n in self.names if self.determines({n: 1.0})]
        lost = [SYMBOLS.get(n, n) for n in self.names if n not in single]
        lines = ["determined: " + ", ".join(_product(p) for p in self.products())]
        if lost:
            lines.append("not determined singly, however long the trial: " + ", ".join(lost))
        return "\n".join(lines)


def ankle_identifiability(
    model: Model, trials: Sequence[Trial], names: Sequence[str] = tuple(SYMBOLS)
) -> Identifiability:
    """Which constants and parameters of an ankle its trials can determine, near the model's values.

    Parameters
    ----------
    names
        Parameters of the model or constants of its rig, all above 0.

    Raises
    ------
    InputError
        For another name.
    """
    base = _readings(model, trials)
    sizes = [float(np.ptp(r)) or 1.0 for r in base]
    columns = []
    for name in names:
        up, down = (_readings(_scaled(model, name, np.exp(sign * CHANGE)), trials) for sign in (1.0, -1.0))
        columns.append(np.concatenate([(u - d) / (2.0 * CHANGE * s) for u, d, s in zip(up, down, sizes, strict=True)]))
    return Identifiability(tuple(names), np.stack(columns, axis=1))


def _readings(model: Model, trials: Sequence[Trial]) -> list[np.ndarray]:
    return [s.readings[:, 0] for s in Simulator(model, trials).run(model.parameters())]


def _scaled(model: Model, name: str, factor: float) -> Model:
    if name in model.parameters():
        return model.with_parameters({name: model.parameters()[name] * factor})
    constants = dict(model.rig.constants)
    if name not in constants:
        raise InputError(f"no constant {name}; there are {', '.join((*model.parameters(), *constants))}")
    constants[name] *= factor
    return Model(dataclasses.replace(model.rig, constants=constants), model.effects)


def _reduced(rows: np.ndarray) -> np.ndarray:
    """Reduced row echelon form."""
    rows, pivot = rows.copy(), 0
    for column in range(rows.shape[1]):
        if pivot == len(rows):
            break
        best = pivot + int(np.argmax(np.abs(rows[pivot:, column])))
        if abs(rows[best, column]) < 1e-6:
            continue
        rows[[pivot, best]] = rows[[best, pivot]]
        rows[pivot] /= rows[pivot, column]
        others = np.arange(len(rows)) != pivot
        rows[others] -= np.outer(rows[others, column], rows[pivot])
        pivot += 1
    return rows


def _product(powers: Mapping[str, float]) -> str:
    def part(items: list[tuple[str, float]]) -> str:
        return " ".join(SYMBOLS.get(n, n) + ("" if round(p, 3) == 1.0 else f"^{p:.3g}") for n, p in items)

    over = [(n, p) for n, p in powers.items() if p > 0]
    under = [(n, -p) for n, p in powers.items() if p < 0]
    return part(over) + (f" / {part(under)}" if under else "")
