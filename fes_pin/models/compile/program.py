"""The program of a model: compiled once for its structure, kept in memory and on disk.

A program on CasADi's virtual machine is the oracle of the machine code, and runs where that cannot be made. Where code
on disk cannot be used it costs time; executed is what this user alone can write.
"""

import hashlib
import json
import logging
import os
import stat
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

import casadi as ca
import numpy as np

from fes_pin import settings
from fes_pin.data.errors import InputError
from fes_pin.data.files import write_bytes
from fes_pin.data.sources import code_hash
from fes_pin.models.compile.equations import Equations, derive
from fes_pin.models.compile.layout import REST_ITERATIONS, REST_STEP, Layout
from fes_pin.models.compile.predictor import derive_predictor
from fes_pin.models.model import Model
from fes_pin.models.outside import in_one_line
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Effect

_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def cache_folder() -> Path:
    """Return the folder of compiled models: `FES_PIN_CACHE`, else the user's cache folder.

    Raises
    ------
    RuntimeError
        The user has no home.
    """
    if chosen := os.environ.get("FES_PIN_CACHE"):
        return Path(chosen)
    usual = Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    return Path(os.environ.get("XDG_CACHE_HOME") or usual) / "fes_pin"


def read_cached(key: str) -> bytes | None:
    """Return the entry of a key, or None; an entry that is damaged, or that others can write, counts as none."""
    try:
        with _own(cache_folder(), os.O_DIRECTORY) as folder, _own(_entry(key), os.O_NOFOLLOW, folder) as handle:
            data = b"".join(iter(lambda: os.read(handle, 1 << 24), b""))
    except (OSError, RuntimeError):
        return None
    digest, body = data[:32], data[32:]
    return body if hashlib.sha256(body).digest() == digest else None


def write_cached(key: str, body: bytes) -> None:
    """Keep `body`; a cache that cannot be written, or that others can write, is no error: it is not used."""
    try:
        folder = cache_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        path = folder / _entry(key)
        with _own(folder, os.O_DIRECTORY):
            if not path.is_symlink() and (path.is_file() or not path.exists()):
                write_bytes(path, hashlib.sha256(body).digest() + body, mode=0o600)
    except (OSError, RuntimeError, InputError):
        return


def _entry(key: str) -> str:
    return f"{hashlib.sha256(key.encode()).hexdigest()[:40]}.program"


@contextmanager
def _own(path: str | Path, flags: int, folder: int | None = None) -> Iterator[int]:
    """A handle of a file or folder that this user owns and nobody else can write.

    What is checked is what is open, so nothing can come between the check and the reading.

    Raises
    ------
    OSError
        Not there, not of the kind that the flags ask for, or others can write it.
    """
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | flags, dir_fd=folder)
    try:
        status = os.fstat(handle)
        if status.st_uid != os.geteuid() or status.st_mode & _OTHERS_WRITE:
            say_unsafe(f"{path} in the cache" if folder is not None else str(path))
            raise PermissionError(f"others can write {path}")
        yield handle
    finally:
        os.close(handle)


@cache
def say_unsafe(place: str) -> None:
    """A warning, once for each place."""
    _LOG.warning("compiled models are not read from %s: it is not this user's alone to write", place)


class VirtualProgram:
    """The same equations and time loop as the machine code, interpreted lane by lane."""

    def __init__(self, equations: Equations) -> None:
        self.layout, self.equations = equations.layout, equations
        self._trajectory = cache(lambda n, substeps: self._sample(substeps).mapaccum("trajectory", n, 2))

    def run(
        self, inputs: np.ndarray, values: np.ndarray, constants: np.ndarray, guess: np.ndarray, substeps: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Simulate all lanes; see `Program`."""
        width, n = self.layout.width, inputs.shape[0]
        out = np.empty((n, self.equations.sizes.reading, width))
        for lane in range(width):
            p, c = values[:, lane], constants[:, lane]
            state, memory = self.equations.functions["start"](self._rest(float(guess[lane]), p, c), p, c)
            trajectory = self._trajectory(n, substeps)
            t0, dt = (c[self.layout.constants.index(name)] for name in ("t0", "dt"))
            times = (t0 + np.arange(n) * dt)[None, :]
            ended = trajectory(state, memory, inputs[:, :, lane].T, times, ca.repmat(p, 1, n), ca.repmat(c, 1, n))
            out[:, :, lane] = np.array(ended[2]).T
        return self.layout.parted(out)

    def _rest(self, z: float, p: np.ndarray, c: np.ndarray) -> float:
        for _ in range(REST_ITERATIONS):
            g, slope = self.equations.functions["rest"](z, p, c)
            with np.errstate(all="ignore"):
                z -= float(np.clip(np.float64(g) / np.float64(slope), -REST_STEP, REST_STEP))
        return z

    def _sample(self, substeps: int) -> ca.Function:
        """From one sample to the next, by classical Runge-Kutta steps of order four."""
        e, layout, f = self.equations, self.layout, self.equations.functions
        names = ("state", "memory", "u", "t", "p", "c")
        sizes = (e.sizes.state, e.sizes.memory, len(layout.inputs), 1, len(layout.values), len(layout.constants))
        state, memory, u, t, p, c = given = [ca.MX.sym(n, k) for n, k in zip(names, sizes, strict=True)]
        held = f["sample"](state, memory, u, t, p, c)
        if "correct" in f:
            state, y = f["correct"](state, held, u, t, p, c)
        else:
            y = f["output"](state, held, u, t, p, c)
        h = c[layout.constants.index("step")]
        for j in range(substeps):

            def rates(x: Any, at: float, since: Any = j * h, begun: Any = (state,) if "follow" in f else ()) -> Any:
                return f["rates"](x, *begun, held, u, t, since, at * h, p, c)

            begun = state[: e.sizes.integrated]
            first = rates(begun, 0.0)
            second = rates(begun + 0.5 * h * first, 0.5)
            third = rates(begun + 0.5 * h * second, 0.5)
            fourth = rates(begun + h * third, 1.0)
            end = begun + h / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
            state = f["follow"](state, end, held, u, t, j * h, 0.5 * h, p, c) if "follow" in f else end
        return ca.Function("sample", given, [state, held, y])


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
