"""Functional electrical stimulation on Pinocchio: simulate, diagnose, extend, control."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_WHERE = {
    "read_study": "fes_pin.data.study",
    "write_study": "fes_pin.data.study",
    "Study": "fes_pin.data.study",
    "read_trial": "fes_pin.data.trial",
    "write_trial": "fes_pin.data.trial",
    "Trial": "fes_pin.data.trial",
    "InputError": "fes_pin.data.errors",
    "Model": "fes_pin.models.model",
    "nominal_model": "fes_pin.models.nominal",
    "load_model": "fes_pin.models.store",
    "save_model": "fes_pin.models.store",
    "simulate": "fes_pin.models.simulate",
    "predict": "fes_pin.models.predict",
    "fit": "fes_pin.identify.fit",
    "Fit": "fes_pin.identify.fit",
    "diagnose": "fes_pin.diagnose.diagnosis",
    "Diagnosis": "fes_pin.diagnose.diagnosis",
    "report": "fes_pin.view.report",
    "Body": "fes_pin.body.build",
    "linearize": "fes_pin.body.linearize",
    "minimal_sets": "fes_pin.body.minimal_sets",
    "controllability": "fes_pin.muscles.nerve_inputs",
    "allocate": "fes_pin.allocate.allocate",
    "Nerves": "fes_pin.muscles.nerves",
}
_CHAPTERS = {"effects": "fes_pin.models.effects", "rigs": "fes_pin.models.rigs"}

__all__ = ["__version__", *_WHERE, *_CHAPTERS]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    """Import what is asked for when it is asked for: the command line starts fast."""
    if name in _CHAPTERS:
        return import_module(_CHAPTERS[name])
    if name in _WHERE:
        return getattr(import_module(_WHERE[name]), name)
    raise AttributeError(f"module 'fes_pin' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Every public name."""
    return sorted(__all__)
