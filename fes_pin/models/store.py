"""Models on disk: `model.toml`, whole and by itself."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import tomli_w

from fes_pin.data.errors import InputError
from fes_pin.data.files import write_text
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
    if document.data.get("format") != FORMAT:
        raise document.error("format", f"expected format = {FORMAT}: a model that fes-pin saved")
    if document.data.get("rig") not in kinds:
        raise document.error("rig", f"expected one of {', '.join(kinds)}")
    kind = kinds[document.data["rig"]]
    fitted = document.data.get("fitted")
    if not isinstance(fitted, list) or not set(map(str, fitted)) <= set(kind.parameters()):
        raise document.error("fitted", f"expected names among {', '.join(kind.parameters())}")
    nominal = _numbers(document, "nominal", set(kind.parameters()))
    constants = _numbers(document, "constants", None)
    if missing := set(kind.needed) - set(constants):
        raise document.error("constants", f"expected {', '.join(sorted(missing))} as well")
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
    for name, value in values.items():
        if known is not None and name not in known:
            raise document.error(f"{key}.{name}", f"unknown; expected one of {', '.join(sorted(known))}")
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise document.error(f"{key}.{name}", f"expected a finite number, found {value!r}")
    if known is not None and (missing := known - set(values)):
        raise document.error(key, f"expected {', '.join(sorted(missing))} as well")
    return {n: float(v) for n, v in values.items()}
