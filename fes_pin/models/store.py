"""Models on disk: `model.toml`, complete without other files."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w

from fes_pin.data.errors import InputError
from fes_pin.data.numbers import instance
from fes_pin.data.outputs import written_by
from fes_pin.data.schema import NumberKey, one_of
from fes_pin.data.toml import Document, read_toml
from fes_pin.models.catalogue import Catalogue, Source, catalogue_of
from fes_pin.models.in_channel import in_channel
from fes_pin.models.model import Model
from fes_pin.models.outside import origin
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Effect

FORMAT = 1
NEEDS = "needs"
"""Key of a table: the file or module of each cause or rig that is not of this library."""
EACH_TRIAL = "each_trial"
"""Key of an effect whose amplitudes are each trial's own."""


def model_toml(model: Model, further: Mapping[str, Mapping[str, Any]] | None = None) -> str:
    """Return a model as TOML: rig, constants, parameters to the last bit, effects; and further tables.

    Parameters
    ----------
    further
        Tables by name, as `identify.stored.stored_tables` writes them.
    """
    rig = model.rig
    tables: dict[str, Any] = {
        "format": FORMAT,
        "rig": rig.name,
        "fitted": list(rig.fitted_parameters()),
        "constants": {n: float(v) for n, v in rig.constants.items()},
        "nominal": {n: float(getattr(rig, n)) for n in rig.parameters()},
        "effects": {e.name: _effect_table(e) for e in model.effects},
    }
    if rig.session:
        tables["session"] = [list(one) for one in rig.session]
    tables |= further or {}
    parts: tuple[Rig | Effect, ...] = (rig, *model.effects)
    foreign = {one.name: Path(where).name for one in parts if (where := origin(type(one)))}
    return tomli_w.dumps({**tables, NEEDS: foreign} if foreign else tables)


def save_model(model: Model, path: str | Path, *, overwrite: bool = False) -> None:
    """Write `model.toml`, completely or not at all.

    Parameters
    ----------
    overwrite
        Replace a file that this function did not write, or that was changed since.

    Raises
    ------
    InputError
        If it is no `Model`: the body of a diagnosis of walking is saved as URDF, by its `write`. If the file cannot be
        written, was read and not written by this process, or is one of others.
    """
    how = ": its write() saves it as URDF, which Body.from_urdf reads" if hasattr(model, "urdf") else ""
    instance(model, Model, "model", how)
    written_by("save_model", path, model_toml(model), (".toml",), overwrite)


def load_model(path: str | Path, *, library: Source | Sequence[Source] | None = None) -> Model:
    """Read a model that `save_model` wrote.

    Parameters
    ----------
    library
        Sources of causes and rigs that are not of this library or of installed packages: see `load_library`.

    Raises
    ------
    InputError
        For another file, or one that needs a library that was not given: names the row, the key and what was expected.
    """
    document, catalogue = read_toml(path), catalogue_of(library)
    kinds = {rig.name: rig for rig in catalogue.rigs}
    found = document.data.get("format")
    if found is None and "model" in document.data:
        raise document.error("model", "of a diagnosis of walking: Body.from_urdf reads the URDF that it names")
    if found != FORMAT or isinstance(found, bool):
        raise document.error("format", f"expected format = {FORMAT}: a model that fes-pin saved")
    name = document.data.get("rig")
    kind = kinds[one_of(name, tuple(kinds), lambda words: document.error("rig", _missing(document, name, words)))]
    nominal: dict[str, Any] = _numbers(document, "nominal", kind.parameters())
    constants, fitted = _numbers(document, "constants", None), document.data.get("fitted", "")
    try:
        model = Model(kind(**nominal, constants=constants, fitted=fitted, session=document.data.get("session", ())))
    except InputError as problem:
        key = f"nominal.{problem.column}" if problem.column in nominal else str(problem.column)
        raise document.error(key, problem.message) from None
    listed = document.table("effects")
    for name in listed:
        try:
            model = model + _effect(document, catalogue, name, listed, model.rig)
        except InputError as problem:
            if problem.file is not None:
                raise
            within = f".{problem.column}" if problem.column else ""
            raise document.error(f"effects.{name}{within}", problem.message) from None
    return model


def _effect_table(one: Effect) -> dict[str, Any]:
    own = {EACH_TRIAL: True} if one.each_trial else {}
    return {**own, **{n: float(getattr(one, n)) for n in one.parameters()}}


def _missing(document: Document, name: object, otherwise: str) -> str:
    """Return an error message for an unknown cause or rig, with the library that the model states for it."""
    where = document.table(NEEDS).get(name) if isinstance(name, str) else None
    if not isinstance(where, str) or not where:
        return otherwise
    return f"{name} is of {where}; expected library='{'PATH/' if where.endswith('.py') else ''}{where}'"


def _effect(document: Document, catalogue: Catalogue, name: str, listed: dict[str, Any], rig: Rig) -> Effect:
    key = f"effects.{name}"
    try:
        kind = in_channel(catalogue.effect(name).on(rig.constants), rig.channel)
    except InputError as problem:
        raise document.error(key, _missing(document, name, problem.message)) from None
    each_trial = document.table(key, listed).pop(EACH_TRIAL, False)
    may = kind.varies or kind.of_record
    if not isinstance(each_trial, bool) or (each_trial and not may):
        raise document.error(f"{key}.{EACH_TRIAL}", f"expected {'true or false' if may else 'none'}")
    return kind(**_numbers(document, key, kind.parameters(), listed), each_trial=each_trial)


def _numbers(
    document: Document, key: str, known: Iterable[str] | None, inside: dict[str, Any] | None = None
) -> dict[str, float]:
    values = document.table(key, inside)
    return document.numbers(key, values, dict.fromkeys(values if known is None else known, NumberKey("")))
