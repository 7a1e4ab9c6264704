"""LLVM on this processor: IR text in, callable machine code out."""

import ctypes
import threading
from collections.abc import Callable
from functools import cache

import llvmlite
import llvmlite.binding as llvm

from fes_pin import settings

_LOCK = threading.Lock()


def _new_target(name: str, features: str) -> llvm.TargetMachine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple = llvm.Target.from_default_triple()
    return triple.create_target_machine(cpu=name, features=features, opt=1, jit=True)


@cache
def compiling_target(name: str, features: str) -> llvm.TargetMachine:
    """The one that compiles. An execution engine takes its target machine with it when it goes: it needs its own."""
    return _new_target(name, features)


def made_for() -> str:
    """Return the target and maker of object code: processor, its features, compiler."""
    return " ".join((*settings.target(), "llvmlite", llvmlite.__version__))


class MachineCode:
    """A compiled module; keep it as long as its functions are called."""

    def __init__(self, object_code: bytes) -> None:
        with _LOCK:
            target = _new_target(*settings.target())
            self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
            self._engine.add_object_file(llvm.ObjectFileRef.from_data(object_code))
            self._engine.finalize_object()

    def function(self, name: str, *argument_types: type) -> Callable[..., None]:
        """The function of that name as a ctypes callable; ctypes releases the interpreter lock while it runs."""
        return ctypes.CFUNCTYPE(None, *argument_types)(self._engine.get_function_address(name))


def compile_object(assembly: str) -> bytes:
    """Compile LLVM assembly for this processor.

    No optimisation passes: CasADi has shared the common terms already, and on the ankle's program they cost 35 ms to
    gain a tenth of the running time. NaN and infinity are honoured.
    """
    with _LOCK:
        return compiling_target(*settings.target()).emit_object(llvm.parse_assembly(assembly))
