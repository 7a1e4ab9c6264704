"""Models on disk: `model.toml`, whole and by itself."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from fes_pin.data.errors import InputError
from fes_pin.data.files import write_text
from fes_pin.data.schema import SCHEMAS, Number, one_of
from fes_pin.data.toml import Document, read_toml
from fes_pin.models.effects import effect
from fes_pin.models.model import Model
from fes_pin.models.rigs import RIGS
from fes_pin.models.stage import Effect

FORMAT = 1
EACH_TRIAL = "each_trial"
"""Key of an effect whose amplitudes are each trial's own."""


def model_toml(model: Model) -> str:
    """A model as TOML: rig, constants, parameters to the last bit, effects."""
    rig = model.rig
    tables: dict[str, Any] = {
        "format": FORMAT,
        "rig": rig.name,
        "fitted": list(rig.fitted_parameters()),
        "constants": {n: float(v) for n, v in rig.constants.items()},
        "nominal": {n: float(getattr(rig, n)) for n in rig.parameters()},
        "effects": {e.name: _effect_table(e) for e in model.effects},
    }
    return tomli_w.dumps(tables)


def save_model(model: Model, path: str | Path) -> None:
    """Write `model.toml`, whole or not at all."""
    write_text(path, model_toml(model))


def load_model(path: str | Path) -> Model:
    """Read a model that `save_model` wrote.

    Raises
    ------
    InputError
        Not such a file: names the row, the key and what was expected.
    """
    document = read_toml(path)
    kinds = {rig.name: rig for rig in RIGS}
    found = document.data.get("format")
    if found != FORMAT or isinstance(found, bool):
        raise document.error("format", f"expected format = {FORMAT}: a model that fes-pin saved")
    try:
        kind = kinds[one_of(document.data.get("rig"), tuple(kinds))]
    except ValueError as problem:
        raise document.error("rig", str(problem)) from None
    fitted = document.data.get("fitted")
    names = list(kind.parameters())
    if not isinstance(fitted, list) or not all(f in names for f in fitted) or len(set(fitted)) < len(fitted):
        raise document.error("fitted", f"expected names among {', '.join(names)}, each once")
    nominal = _numbers(document, "nominal", set(names))
    constants = _numbers(document, "constants", None)
    if missing := set(kind.needed) - set(constants):
        raise document.error("constants", f"expected {', '.join(sorted(missing))} as well")
    _check_possible(document, kind.name, {"nominal": nominal, "constants": constants})
    model = Model(kind(**nominal, constants=constants, fitted=tuple(fitted)))
    listed = document.table("effects")
    for name in listed:
        try:
            model = model + _effect(document, name, listed)
        except KeyError as error:
            raise document.error(f"effects.{name}", str(error.args[0])) from None
        except InputError:
            raise
        except ValueError as error:
            raise document.error(f"effects.{name}", str(error)) from None
    return model


def _check_possible(document: Document, rig: str, tables: Mapping[str, Mapping[str, float]]) -> None:
    """Refuse what a study of this rig could not hold either: a mass below zero, a saturation below the threshold."""
    schema = SCHEMAS[rig]
    known = {**schema.constants, **(schema.passive or {}), **schema.start}
    for key, table in tables.items():
        for name in table.keys() & known.keys():
            try:
                known[name].check(table[name])
            except ValueError as problem:
                raise document.error(f"{key}.{name}", str(problem)) from None
    constants = tables["constants"]
    if "threshold_us" in constants and constants.get("saturation_us", math.inf) <= constants["threshold_us"]:
        raise document.error("constants.saturation_us", f"expected more than {constants['threshold_us']:g}")


def _effect_table(one: Effect) -> dict[str, Any]:
    own = {EACH_TRIAL: True} if one.each_trial else {}
    return {**own, **{n: float(getattr(one, n)) for n in one.parameters()}}


def _effect(document: Document, name: str, listed: dict[str, Any]) -> Effect:
    kind, key = effect(name), f"effects.{name}"
    each_trial = document.table(key, listed).pop(EACH_TRIAL, False)
    if not isinstance(each_trial, bool) or (each_trial and not kind.varies):
        raise document.error(f"{key}.{EACH_TRIAL}", f"expected {'true or false' if kind.varies else 'none'}")
    return kind(**_numbers(document, key, set(kind.parameters()), listed), each_trial=each_trial)


def _numbers(
    document: Document, key: str, known: set[str] | None, inside: dict[str, Any] | None = None
) -> dict[str, float]:
    values = document.table(key, inside)
    for name in values:
        if known is not None and name not in known:
            raise document.error(f"{key}.{name}", f"unknown; expected one of {', '.join(sorted(known))}")
    if known is not None and (missing := known - set(values)):
        raise document.error(key, f"expected {', '.join(sorted(missing))} as well")
    return document.numbers(key, values, dict.fromkeys(values, Number("")))
