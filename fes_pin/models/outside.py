"""Causes and rigs of anybody's own file or module: loaded, checked, and distinguished from those written here."""

import hashlib
import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from fes_pin.data.as_read import note_read
from fes_pin.data.errors import InputError
from fes_pin.data.schema import RigSchema
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Effect, Stage

OF_A_FILE = "fes_pin_library_"
"""How the names of modules begin that are made of files."""
PACKAGE = "fes_pin."
FROZEN = "expected @dataclass(frozen=True) above it"
EQUATIONS = [
    n for n, one in vars(Rig).items() if inspect.isfunction(one) and "NotImplementedError" in one.__code__.co_names
]
"""Methods without which a rig has no equations."""
STAGES = ", ".join(f"Stage.{stage.name}" for stage in Stage)


def load_module(source: str | Path) -> ModuleType:
    """Run a Python file, or import a module by its name.

    Raises
    ------
    InputError
        If there is none, or its code ends in an error.
    """
    path = Path(source)
    if path.suffix == ".py" or path.exists():
        return _run_file(path)
    try:
        return importlib.import_module(str(source))
    except ModuleNotFoundError as error:
        if error.name is None or not str(source).startswith(error.name):
            raise InputError(f"the module {source} cannot be run: {_text_of(error)}") from error
        raise InputError(f"no module {source}; expected the name of a module, or a file that ends in .py") from None
    except (Exception, SystemExit) as error:
        raise InputError(f"the module {source} cannot be run: {_text_of(error)}") from error


def _run_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise InputError("no such file; expected a Python file with causes or rigs", file=path)
    whole = path.resolve()
    name = f"{OF_A_FILE}{whole.stem}_{hashlib.sha256(str(whole).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, whole)
    if spec is None or spec.loader is None:
        raise InputError("expected a Python file, whose name ends in .py", file=path)
    note_read(whole)
    module = importlib.util.module_from_spec(spec)
    before = sys.modules.get(name)
    sys.modules[name] = module  # dataclasses look their module up
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        if before is not None:
            sys.modules[name] = before
        raise InputError(f"cannot be run: {_text_of(error)}", file=path, row=_row(error, whole)) from error
    return module


def _text_of(error: BaseException) -> str:
    words = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{type(error).__name__}: {words}".rstrip(": ")


@contextmanager
def in_one_line(classes: Iterable[type[Effect] | type[Rig]], method: str = "") -> Iterator[None]:
    """Let errors in somebody's own causes and rigs be one line, with the row where they are raised.

    Parameters
    ----------
    classes
        Those that may be at fault; what is written here is none.
    method
        Of the first of them: at fault as well where an error is raised outside of them all. Without, that is raised.

    Raises
    ------
    InputError
        In the place of such an error.
    """
    try:
        yield
    except InputError:
        raise
    except (Exception, SystemExit) as error:  # anybody's code: anything may be wrong with it
        theirs = {_path(one): one for one in classes if origin(one)}
        for frame in reversed(traceback.extract_tb(error.__traceback__)):
            if one := theirs.get(Path(frame.filename).resolve()):
                words = f"class {one.__name__}: {_text_of(error)}"
                raise InputError(words, file=_where(one.__module__), row=frame.lineno) from error
        if not method:
            raise
        raise fault_of(next(iter(classes)), method, _text_of(error)) from error


def fault_of(one: type, method: str, words: str) -> InputError:
    """One line on a method of a class, with the row where it is defined if that is with the class."""
    function = inspect.unwrap(getattr(one, method, one))
    code = getattr(function, "__code__", None) if function.__module__ == one.__module__ else None
    return InputError(f"class {one.__name__}: {words}", file=_where(one.__module__), row=code and code.co_firstlineno)


def _path(one: type) -> Path:
    return Path(getattr(sys.modules[one.__module__], "__file__", None) or "").resolve()


def _row(error: BaseException, path: Path) -> int | None:
    if isinstance(error, SyntaxError):
        return error.lineno
    rows = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path)]
    return rows[-1] if rows else None


def classes_of(module: ModuleType) -> tuple[type[Effect] | type[Rig], ...]:
    """The causes and rigs that a module, or a module inside it, defines; names that begin with _ are its own.

    Raises
    ------
    InputError
        If there is none.
    """
    found = [c for c in vars(module).values() if isinstance(c, type) and issubclass(c, Effect | Rig)]
    variants = [c for c in found if "name" not in vars(c) and any(base in found for base in c.__mro__[1:])]
    parts = [c for c in found if c not in variants]
    own = [one for one in parts if f"{one.__module__}.".startswith(f"{module.__name__}.")]
    found = [one for one in own if not one.__name__.startswith("_")]
    if not found:
        raise InputError("holds no cause and no rig; expected a class of Effect or Rig", file=_where(module.__name__))
    return tuple(dict.fromkeys(found))


def check_effect(one: type[Effect], rigs: Iterable[type[Rig]]) -> None:
    """Make sure that a class is a whole cause.

    Parameters
    ----------
    one
        Of anybody's.
    rigs
        Every rig that there is, to look the effect's signal up.

    Raises
    ------
    InputError
        With the class and what was expected.
    """
    signals = _signals(one, rigs) if not (problem := _form_lacks(one)) else set()
    if not problem and not signals:
        problem = f"expected a rig that there is, found {', '.join(map(repr, one.rigs))}"
    elif not problem and one.signal not in signals:
        problem = f"expected a signal of its rigs, {', '.join(sorted(signals))}; found {one.signal!r}"
    if problem:
        raise InputError(f"class {one.__name__}: {problem}", file=_where(one.__module__))


def check_rig(one: type[Rig]) -> None:
    """Make sure that a class is a whole rig.

    Raises
    ------
    InputError
        With the class and what was expected.
    """
    problem = ""
    if "__dataclass_fields__" not in vars(one):
        problem = FROZEN
    elif not isinstance(getattr(one, "name", None), str) or not one.name.isidentifier():
        problem = "expected a name of letters, digits and _"
    elif not isinstance(getattr(one, "schema", None), RigSchema):
        problem = "expected schema, a RigSchema: the keys and columns of its studies"
    elif lacking := [name for name in EQUATIONS if getattr(one, name) is getattr(Rig, name)]:
        problem = f"expected methods {', '.join(lacking)}"
    if problem:
        raise InputError(f"class {one.__name__}: {problem}", file=_where(one.__module__))


def _form_lacks(one: type[Effect]) -> str:
    """What the class of an effect lacks whatever its rigs are; "" if it is whole."""
    lacking = [n for n in ("name", "stage", "signal", "rigs") if not hasattr(one, n)]
    problems = {
        FROZEN: "__dataclass_fields__" not in vars(one),
        f"expected {', '.join(lacking)}": bool(lacking),
        "expected a name of letters, digits and _": not str(getattr(one, "name", "")).isidentifier(),
        f"expected a stage, one of {STAGES}": not isinstance(getattr(one, "stage", None), Stage),
        'expected rigs, a tuple of names as in ("joint",)': not isinstance(getattr(one, "rigs", None), tuple),
        "expected a method apply(self, value, s)": one.apply is Effect.apply,
        "expected a method rate(self, s) of its states": bool(one.states) and one.rate is Effect.rate,
        "expected a method update(self, s) of its memories": bool(one.memories) and one.update is Effect.update,
        "expected a parameter with a null, which switches it off": not one.amplitudes(),
    }
    for name, info in one.parameters().items():
        problems[f"expected another name than {name}, which every effect has"] = hasattr(Effect, name)
        inside = info.lower <= getattr(one, name) <= info.upper
        problems[f"expected {name} from {info.lower:g} to {info.upper:g}, as its bounds are"] = not inside
    return next((problem for problem, is_so in problems.items() if is_so), "")


def _signals(one: type[Effect], rigs: Iterable[type[Rig]]) -> set[str]:
    """The signals of every rig that can have an effect."""
    return {s for rig in rigs if rig.takes(one) for kind in rig.schema.outputs for s in rig().signals(kind)}


def origin(one: type) -> str:
    """Whose code a cause or a rig is: the path of a file, or the name of a module; "" for what is written here."""
    return "" if one.__module__.startswith(PACKAGE) else _where(one.__module__)


def _where(module: str) -> str:
    """The file that a module was made of, or its name."""
    if module.startswith(OF_A_FILE) or module == "__main__":
        return str(getattr(sys.modules.get(module), "__file__", None) or module)
    return module
