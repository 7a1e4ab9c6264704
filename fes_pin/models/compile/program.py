"""The program of a model: compiled once for its structure, kept in memory and on disk."""

import json
import logging
import threading
from dataclasses import asdict
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Protocol

import numpy as np

from fes_pin import settings
from fes_pin.data.sources import code_hash
from fes_pin.models.compile.disk_cache import read_cached, write_cached
from fes_pin.models.compile.equations import Equations, derive
from fes_pin.models.compile.layout import Layout
from fes_pin.models.compile.predictor import derive_predictor
from fes_pin.models.compile.virtual import VirtualProgram
from fes_pin.models.model import Model
from fes_pin.models.outside import in_one_line
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Effect

_LOG = logging.getLogger("fes_pin")


class Program(Protocol):
    """One model structure, kind of trial and set of sensitivity columns, ready to run."""

    layout: Layout

    def run(
        self, inputs: np.ndarray, values: np.ndarray, constants: np.ndarray, guess: np.ndarray, substeps: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Simulate the lanes of the layout.

        Parameters
        ----------
        inputs
            Shape (n, number of inputs, width).
        values, constants
            Shape (number, width), in the layout's order.
        guess
            Shape (width,): start of the search for the static equilibrium.
        substeps
            Integration steps per sample.

        Returns
        -------
        readings
            Shape (n, outputs, width); of a predictor (n, 2 measured, width): innovations, then their variances.
        sensitivities
            Shape (n, outputs, columns, width); of a predictor those of the innovations at constant gains.
        """


_LOCK = threading.Lock()  # CasADi's expressions are not made for two threads
_PROGRAMS: dict[tuple[str, str, tuple[type, ...], Layout], Program] = {}


def compiled_program(model: Model, layout: Layout) -> Program:
    """Return the program of a model, compiled if it is not in a cache; see `make_layout`.

    Raises
    ------
    InputError
        If FES_PIN_ENGINE names no engine, or FES_PIN_CPU no processor.
    """
    engine = settings.engine()
    key = (engine, settings.processor(), _classes(model), layout)
    if key not in _PROGRAMS:
        with _LOCK:
            if key not in _PROGRAMS:
                made = _native(model, layout) if engine == "llvm" else None
                _PROGRAMS[key] = made or VirtualProgram(derived(model, layout))
    return _PROGRAMS[key]


def derived(model: Model, layout: Layout) -> Equations:
    """Return the equations of a simulation, or of a predictor where the layout has measured outputs.

    Raises
    ------
    InputError
        With file and row, if the equations of an own cause or rig cannot be run.
    """
    with in_one_line(_classes(model)):
        return derive_predictor(model, layout) if layout.measured else derive(model, layout)


def _classes(model: Model) -> tuple[type[Rig] | type[Effect], ...]:
    """Return the key of the equations: the classes of rig and effects, own ones of the same name too."""
    return (type(model.rig), *(type(e) for e in model.effects))


def _native(model: Model, layout: Layout) -> Program | None:
    """Return machine code from the cache, or compiled; None if it cannot be compiled here."""
    try:
        from fes_pin.models.compile import machine, native  # noqa: PLC0415 - llvmlite may be missing

        classes = [f"{c.__module__}.{c.__qualname__}" for c in _classes(model)]
        if not all(name.startswith("fes_pin.") for name in classes):  # the signature knows only our own source
            return native.NativeProgram(layout, native.compile_equations(derived(model, layout)))
        key = machine.made_for() + json.dumps([source_signature(), classes, asdict(layout)])
        stored = read_cached(key)
        if stored is None:
            stored = native.compile_equations(derived(model, layout))
            write_cached(key, stored)
        return native.NativeProgram(layout, stored)
    except (ImportError, OSError, RuntimeError, NotImplementedError) as problem:
        _say_slow(" ".join(str(problem).split()))
        return None


@cache
def source_signature() -> str:
    """Return a signature that changes whenever an equation, the compiler or CasADi changes."""
    return f"{version('casadi')} {code_hash(Path(__file__).parents[1])}"


@cache
def _say_slow(reason: str) -> None:
    _LOG.warning("models run on CasADi's virtual machine, tens of times slower: %s", reason)
