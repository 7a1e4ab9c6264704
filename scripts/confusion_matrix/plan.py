"""Which studies a confusion matrix is made of; a study's name says all that is needed to make it again."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from confusion_matrix import forms_joint, forms_muscle, forms_nerve, forms_rig, forms_sensor
from confusion_matrix.form import Form
from confusion_matrix.noise import FAMILIES

FORMS = tuple(f for m in (forms_nerve, forms_muscle, forms_joint, forms_rig, forms_sensor) for f in m.FORMS)
DISTANCES = (15, 40, 150)
PAIR_DISTANCE = 100
BLANK_RIGS = ("ankle",) * 8 + ("joint", "muscle")
"""Rigs of one round's nulls and decoys: 6 studies each."""
OUTSIDE_DISTANCE = 60


@dataclass(frozen=True)
class Item:
    """One study of the matrix.

    Attributes
    ----------
    rig
        "ankle", "joint" or "muscle".
    causes
        Hidden in it.
    form
        Their functional form; "null" (start values nearly right) or "decoy" (wrong by up to 40 %) without any.
    distance
        The d that each cause is sized for.
    noise
        Family.
    seed
        Of everything random.
    """

    rig: str
    causes: tuple[str, ...]
    form: str
    distance: int
    noise: str
    seed: int

    @property
    def name(self) -> str:
        causes = "+".join(self.causes) or "none"
        return f"{self.rig}-{causes}-{self.form}-d{self.distance}-{self.noise}-{self.seed}"

    @classmethod
    def parse(cls, name: str) -> Item:
        """The study of that name.

        Raises
        ------
        ValueError
            If it is not the name of a study.
        """
        try:
            rig, causes, form, distance, noise, seed = name.split("-")
            hidden = () if causes == "none" else tuple(causes.split("+"))
            item = cls(rig, hidden, form, int(distance.removeprefix("d")), noise, int(seed))
            item.forms()
        except (ValueError, KeyError) as error:
            raise ValueError(f"{name!r} is not a study; expected RIG-CAUSES-FORM-dN-NOISE-SEED ({error})") from None
        return item

    @property
    def kind(self) -> str:
        """ "null", "decoy", "single", "pair" or "outside"."""
        if not self.causes:
            return self.form
        return "pair" if len(self.causes) > 1 else ("outside" if self.form == "outside" else "single")

    def forms(self) -> tuple[type[Form], ...]:
        """The functional form of each cause."""
        wanted = "same" if self.kind == "pair" else self.form
        return tuple(form_of(cause, wanted) for cause in self.causes)

    def rng(self, purpose: int) -> np.random.Generator:
        """Random numbers for one purpose."""
        return np.random.default_rng([zlib.crc32(self.name.encode()), purpose])


def form_of(cause: str, name: str) -> type[Form]:
    """The form of that name of a cause.

    Raises
    ------
    KeyError
        If there is none.
    """
    for form in FORMS:
        if (form.cause, form.name) == (cause, name):
            return form
    raise KeyError(f"no form {name} of {cause}")


def groups(seed: int) -> Iterator[tuple[Item, ...]]:
    """Studies without end, in groups that are simulated together; any beginning of it is a stratified slice.

    One round holds each form of each cause on the ankle at d = 40 and 150, every other one at 15 too, in noise families
    that rotate from round to round; nulls and decoys; pairs; causes outside the library; and a share on the other rigs.
    """
    turn = seed
    while True:
        rng = np.random.default_rng([seed, turn])
        cells: list[tuple[Item, ...]] = []
        for number, form in enumerate(FORMS):
            rigs = [rig for rig in form.rigs if rig == "ankle" or (number + turn) % 3 == 0] or [form.rigs[0]]
            cells += [_singles(form, rig, turn, number) for rig in rigs]
        cells += [_blanks(rig, turn) for rig in BLANK_RIGS]
        cells += [_pair(rng, turn, number) for number in range(12)]
        cells = [tuple(_renumbered(one, k) for one in cell) for k, cell in enumerate(cells)]
        yield from (cells[k] for k in rng.permutation(len(cells)))
        turn += 1


def _singles(form: type[Form], rig: str, turn: int, number: int) -> tuple[Item, ...]:
    distances = (OUTSIDE_DISTANCE,) * 2 if form.name == "outside" else DISTANCES[(number + turn) % 2 :]
    return tuple(
        Item(rig, (form.cause,), form.name, d, FAMILIES[(number + turn + k) % len(FAMILIES)], turn)
        for k, d in enumerate(distances)
    )


def _blanks(rig: str, turn: int) -> tuple[Item, ...]:
    return tuple(Item(rig, (), form, 0, noise, turn) for form in ("null", "decoy") for noise in FAMILIES)


def _pair(rng: np.random.Generator, turn: int, number: int) -> tuple[Item, ...]:
    causes = sorted({form.cause for form in FORMS if "ankle" in form.rigs and form.name == "same"})
    two = tuple(sorted(str(c) for c in rng.choice(causes, 2, replace=False)))
    return (Item("ankle", two, "pair", PAIR_DISTANCE, FAMILIES[(number + turn) % len(FAMILIES)], turn),)


def _renumbered(item: Item, cell: int) -> Item:
    return Item(item.rig, item.causes, item.form, item.distance, item.noise, 1000 * item.seed + cell)
