"""The causes and rigs that there are: those written here, those of installed packages, and anybody's own."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from fes_pin.data.errors import InputError
from fes_pin.data.schema import RigSchema
from fes_pin.models import effects, rigs
from fes_pin.models.in_channel import in_channel
from fes_pin.models.outside import check_effect, check_rig, classes_of, in_one_line, load_module, origin
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Effect, by_name, in_order
from fes_pin.models.tried import guard, try_effect, try_rig

GROUPS = ("fes_pin.effects", "fes_pin.rigs")
"""Entry points of packages: each names a class, or a module that holds classes."""


@dataclass(frozen=True)
class Catalogue:
    """Causes and rigs by name: what a study may be of, and what a diagnosis may name.

    Parameters
    ----------
    effects
        In the order of the signal path.
    rigs
        By name.
    """

    effects: tuple[type[Effect], ...]
    rigs: tuple[type[Rig], ...]

    def effect(self, name: str) -> type[Effect]:
        """The effect of that name.

        Raises
        ------
        InputError
            If there is none.
        """
        return by_name(self.effects, name)

    def effects_for(self, rig: Rig | type[Rig]) -> tuple[type[Effect], ...]:
        """The effects that a rig can have; of a rig with its constants those that it determines, in their variants.

        Of a rig with a stimulus they are in the unit of that.
        """
        if not isinstance(rig, Rig):
            return tuple(e for e in self.effects if rig.takes(e))
        unknown = rig.undetermined()
        known = (e for e in self.effects if rig.takes(e) and e.name not in unknown)
        return tuple(in_channel(e.on(rig.constants), rig.channel) for e in known)

    def schemas(self) -> dict[str, RigSchema]:
        """What a study of each rig must and may hold, by the rig's name; see `read_study`."""
        return {one.name: one.described() for one in self.rigs}

    def origins(self) -> dict[str, list[str]]:
        """Names of what is not written here, by whose code it is."""
        found: dict[str, list[str]] = {}
        every: tuple[type[Effect] | type[Rig], ...] = (*self.effects, *self.rigs)
        for one in every:
            if where := origin(one):
                found.setdefault(where, []).append(one.name)
        return found

    def with_classes(self, classes: Iterable[type[Effect] | type[Rig]]) -> "Catalogue":
        """The same with other classes as well.

        Raises
        ------
        InputError
            If one of them is not whole, or its name is taken.
        """
        added = tuple(classes)
        known_rigs, known_effects = {r.name: r for r in self.rigs}, {e.name: e for e in self.effects}
        for rig in (one for one in added if issubclass(one, Rig)):  # first: an effect may act on a rig of its own
            check_rig(rig)
            _refuse_another(known_rigs.setdefault(rig.name, rig), rig)
            if origin(rig):
                with in_one_line((rig,), "rates"):
                    guard(rig)
                    try_rig(rig, self.effects)
        for effect in (one for one in added if issubclass(one, Effect)):
            check_effect(effect, known_rigs.values())
            _refuse_another(known_effects.setdefault(effect.name, effect), effect)
            if origin(effect):
                with in_one_line((effect,), "apply"):
                    guard(effect)
                    try_effect(effect, known_rigs.values(), known_effects.values())
        return Catalogue(in_order(known_effects.values()), tuple(known_rigs[n] for n in sorted(known_rigs)))


Source = Catalogue | str | Path | ModuleType | type[Effect] | type[Rig]
"""Where causes and rigs come from: a file or the name of a module, a module, a class, or a catalogue."""


def load_library(*sources: Source) -> Catalogue:
    """What is written here and in installed packages, with the causes and rigs of files, modules and classes.

    Parameters
    ----------
    sources
        A path of a Python file, the name of a module, a module, or a class. The code of files and modules is run.

    Raises
    ------
    InputError
        If a source cannot be run, holds no cause and no rig, or one that is not whole or whose name is taken.
    """
    catalogue = installed()
    for source in sources:
        if isinstance(source, Catalogue):
            catalogue = catalogue.with_classes((*source.rigs, *source.effects))
        elif isinstance(source, type):
            catalogue = catalogue.with_classes((source,))
        else:
            if not isinstance(source, str | Path | ModuleType):
                message = f"expected a path, the name of a module, a module or a class, found a {type(source).__name__}"
                raise InputError(message, column="library")
            module = source if isinstance(source, ModuleType) else load_module(source)
            catalogue = catalogue.with_classes(classes_of(module))
    return catalogue


def catalogue_of(library: Source | Sequence[Source] | None) -> Catalogue:
    """What is meant by a `library`: nothing, one source or several; a catalogue is taken as it is."""
    if isinstance(library, Catalogue):
        return library
    several: Sequence[Any] = library if isinstance(library, list | tuple) else () if library is None else (library,)
    return load_library(*several)


@cache
def shipped() -> Catalogue:
    """What is written here."""
    return Catalogue(effects.EFFECTS, rigs.RIGS)


@cache
def installed() -> Catalogue:
    """What is written here, and what installed packages register.

    Raises
    ------
    InputError
        If an entry point cannot be loaded.
    """
    catalogue = shipped()
    for group in GROUPS:
        for point in sorted(entry_points(group=group), key=lambda p: p.name):
            catalogue = catalogue.with_classes(_registered(point))
    return catalogue


def _registered(point: EntryPoint) -> Iterator[type[Effect] | type[Rig]]:
    package = point.dist.name if point.dist else "unknown"
    try:
        loaded = point.load()
    except Exception as error:  # anybody's code: anything may be wrong with it
        message = f"{point.group} {point.name} = {point.value} of the package {package} cannot be loaded: {error}"
        raise InputError(message) from error
    if isinstance(loaded, ModuleType):
        yield from classes_of(loaded)
    elif isinstance(loaded, type) and issubclass(loaded, Effect | Rig):
        yield loaded
    else:
        expected = "expected a class of an effect or a rig, or a module that holds such"
        raise InputError(f"{point.group} {point.name} = {point.value} of the package {package}: {expected}")


def _refuse_another(known: type[Effect] | type[Rig], one: type[Effect] | type[Rig]) -> None:
    """Refuse a class whose name another one has."""
    if (known.__module__, known.__qualname__) != (one.__module__, one.__qualname__):
        taken = origin(known) or "fes_pin"
        raise InputError(f"{one.name} is a name of {taken} already; expected another", file=origin(one))
