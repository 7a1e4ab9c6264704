"""Causes and rigs of somebody's own: tried before any study is, and what fails in them is one line wherever it runs.

The equations of a rig, and of a cause in it, are evaluated on expressions and on numbers, at states near those at rest,
with constants and inputs that are made up: what is asked of a cause holds at any.
"""

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextvars import ContextVar
from functools import wraps
from typing import Any

import casadi as ca
import numpy as np

from fes_pin.data.channels import CHANNELS, RATE, VOLUNTARY, WIDTH
from fes_pin.data.errors import InputError
from fes_pin.data.imposed import MOTION
from fes_pin.data.numbers import shortened
from fes_pin.models.compile.equations import Symbols, column
from fes_pin.models.compile.layout import make_layout
from fes_pin.models.maths import is_expression
from fes_pin.models.model import Model
from fes_pin.models.outside import PACKAGE, fault_of, in_one_line
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Effect
from fes_pin.settings import while_set

NAMES = {
    **{"rate": "states", "update": "memories", "rates": "states", "trial_constants": "constant_names"},
    **{"rest": "states memories", "start_variances": "states memories", "sample": "memories"},
    **dict.fromkeys(("grids", "far_sizes", "limits", "smallest"), "parameters"),
}
"""What names the entries of the dictionary that a method of a cause or a rig returns."""
WHOLE = ("rate", "update", "rates", "trial_constants")
"""Methods that return all of them."""
EQUATIONS = ("apply", "rate", "update", "rest", "rates", "sample", "readings", "rest_residual")
"""Methods that return numbers or expressions."""
FINITE = "finite numbers, by fes_pin.models.maths.sin and its like in place of math.sin"
"""What is expected of them: of an expression `math` gives NaN."""
OTHER_UNITS = (*(n for n in CHANNELS if n != WIDTH.column), RATE, *VOLUNTARY)
"""Stimuli of which a rig is not tried: its equations are those of a pulse width."""
POINTS = 16
"""Combinations of signals at which all must be finite."""
SIGNED = ("q", "v", "effort", "imposed_rate", "imposed_acceleration")
"""Signals that have both signs; others, as an activation, may have one alone."""
ROUNDING = 1e-9
"""Difference that is none, as a share."""
_Notes = list[tuple[str, tuple[Any, ...], Any]]
_NOTES: ContextVar[_Notes | None] = ContextVar("notes", default=None)
_DONE = set[tuple[object, ...]]()


def guard(one: type[Effect] | type[Rig]) -> None:
    """Have the methods of an own class raise `InputError` with file and row; the class itself is changed.

    So errors, and results of another form, end in one line in every search, thread and process.

    Raises
    ------
    InputError
        For a method with other arguments than it is called with.
    """
    for name in [n for n in dir(one) if n == "__post_init__" or not n.startswith("__")]:
        found, base = inspect.getattr_static(one, name), getattr(Effect if issubclass(one, Effect) else Rig, name, None)
        function = getattr(found, "__func__", found)
        is_theirs = inspect.isfunction(function) and not function.__module__.startswith(PACKAGE)
        if not is_theirs or hasattr(function, "is_guarded"):
            continue
        arguments = inspect.signature(base).parameters if callable(base) else {}
        try:
            inspect.signature(getattr(one, name)).bind(*arguments) if base else None
        except TypeError:
            kind = " as a class method" if inspect.ismethod(base) else ""
            raise fault_of(one, name, f"expected {name}({', '.join(arguments)}){kind}") from None
        made = _guarded(one, name, function)
        setattr(one, name, made if function is found else type(found)(made))


def _guarded(one: type[Effect] | type[Rig], name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(function)
    def method(*given: Any, **named: Any) -> Any:
        with in_one_line((one,), name):
            found = function(*given, **named)
        if expected := _expected(name, found, *given):
            raise fault_of(one, name, f"{name} returns {shortened(found)}; expected {expected}")
        if name in EQUATIONS and (notes := _NOTES.get()) is not None:
            notes.append((name, given, found))
        return found

    vars(method)["is_guarded"] = True
    return method


def _expected(name: str, found: Any, owner: Any = None, first: Any = None, *_: Any) -> str:
    """What a result of a method lacks; "" if it is whole."""
    if name not in (*NAMES, *EQUATIONS):
        return ""
    if name in NAMES and (names := _lacks_names(name, found, owner, first)):
        return f"a dictionary of {names}"
    if name == "limits":
        is_whole = all(np.size(pair) == 2 and pair[0] <= pair[1] for pair in found.values())
        return "" if is_whole else "a lower and an upper bound of each"
    if name in ("grids", "far_sizes") and any(np.ndim(many) != 1 for many in found.values()):
        return "a tuple of numbers of each"
    numbers = [np.asarray(one) for one in ([found] if name == "apply" else _leaves(found)) if not is_expression(one)]
    if not all(np.issubdtype(one.dtype, np.number) for one in numbers):
        return "numbers"
    is_any = name in EQUATIONS and _NOTES.get() is None  # what was not measured is NaN
    return "" if is_any or all(np.isfinite(one).all() for one in numbers) else FINITE


def _lacks_names(name: str, found: Any, owner: Any, first: Any) -> str:
    """The names of a dictionary that a method should return; "" if it returned one."""
    kinds = [first.kind] if hasattr(first, "kind") else []
    lists = [getattr(owner, attribute) for attribute in NAMES[name].split()]
    known = [n for one in lists for n in (one(*kinds) if callable(one) else one)]
    needed = set(known).difference(getattr(owner, "of_form", ())) if name in WHOLE else set()
    needed |= set(owner.shapes() if name == "grids" else ())
    is_whole = isinstance(found, Mapping) and needed <= set(found) <= set(found if name == "trial_constants" else known)
    return "" if is_whole else ", ".join(known) or "nothing"


def _leaves(found: Any) -> list[Any]:
    many = found.values() if isinstance(found, Mapping) else found if isinstance(found, tuple | list) else None
    return [found] if many is None else [leaf for one in many for leaf in _leaves(one)]


def try_rig(rig: type[Rig], effects: Iterable[type[Effect]]) -> None:
    """Evaluate a rig in every kind of trial, alone and with every cause that it can have, once for these.

    Raises
    ------
    InputError
        For equations that give no finite numbers.
    """
    if (key := (rig, *(taken := [e for e in effects if rig.takes(e)]))) in _DONE:
        return
    every = Model(_rig(rig), tuple(e() for e in taken))
    for kind, inputs in _kinds(rig):
        for model in (Model(every.rig), every.acting(kind, inputs)):
            _try(model, every.rig, kind, inputs, {})
    _DONE.add(key)


def try_effect(one: type[Effect], rigs: Iterable[type[Rig]], effects: Iterable[type[Effect]]) -> None:
    """Evaluate a cause in every kind of trial that it acts in, once for the rigs and effects that it is tried with.

    Parameters
    ----------
    rigs, effects
        All that there are: it is tried on the rigs that it names, with the effects that it is screened with.

    Raises
    ------
    InputError
        For a method that gives no finite numbers, and for a cause that is not nominal at its null, ignores its signal,
        or changes nothing.
    """
    others = [e for e in effects if e.name in one.screened_with]
    if (key := (one, *(taking := [r for r in rigs if r.takes(one)]), *others)) not in _DONE:
        for rig in taking:
            _try_on(rig, one, Model(_rig(rig), tuple(e() for e in others if rig.takes(e))))
        _DONE.add(key)


def _try_on(rig: type[Rig], one: type[Effect], model: Model) -> None:
    missing, acts = None, list[bool]()
    refined = {n: i for n, i in one.parameters().items() if i.optional and (not i.rigs or rig.is_one_of(i.rigs))}
    on: dict[str, Any] = {n: [*i.grid, i.nearest(getattr(one, n) + i.scale)][0] for n, i in refined.items()}
    for kind, inputs in _kinds(rig):
        if one.signal not in model.rig.changeable(kind, inputs):
            continue
        try:
            acts.append(_try(model + one(), one(), kind, inputs, one.nulls(), {}))
            if on:
                _try(model + one(**on), one(), kind, inputs, {})
        except InputError as error:  # a column that only some trials of a rig hold may be what a cause needs
            if getattr(error.__cause__, "name", None) not in rig.schema.inputs:
                raise
            missing = error
    if missing and not acts:
        raise missing
    if acts and not any(acts):
        raise fault_of(one, "apply", f"the rig does not depend on {', '.join(one.parameters())}; expected it to")


def _rig(rig: type[Rig]) -> Rig:
    ends = [n for n in WIDTH.ends if n in rig.schema.constants]
    return rig(constants={n: k + 1.0 for k, n in enumerate(dict.fromkeys((*rig.needed, *ends)))})


def _kinds(rig: type[Rig]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Every kind of trial, with each stimulus."""
    for kind in rig.schema.outputs:
        for stimulus in [n for n in rig.schema.stimuli(kind) if n not in OTHER_UNITS] or ("",):
            yield kind, (*filter(None, [stimulus]), *(MOTION if rig.schema.motion(kind) else ()))


def _try(model: Model, part: Effect | Rig, kind: str, inputs: tuple[str, ...], *settings: Mapping[str, float]) -> bool:
    """Evaluate a model at settings of a part, of which the first of several is its null; whether it changes the rig.

    Raises
    ------
    InputError
        For what is not as `try_effect` says.
    """
    notes = _Notes()
    also = dict.fromkeys([*inputs, *(n for e in model.effects for n in e.inputs)])
    layout = make_layout(model, kind, tuple(also), tuple(model.parameters()))
    sym, plain = (Symbols(model, layout, estimated=False) for _ in range(2))
    places = _places(sym)
    symbols = [values[n] for values, n in places]
    numbers = _numbers(sym, [{**model.parameters(), **{f"{part.name}.{n}": v for n, v in s.items()}} for s in settings])
    with while_set(_NOTES, notes):
        of_rig, steps = _near_rest(sym)
        moving = ["." in n and values is not sym.p for values, n in places]
        names, *both = _returned([note for note in notes if type(note[1][0]) is type(part)])
        made = ca.Function("tried", [ca.vertcat(*symbols)], [column(one) for one in (*both, steps)])
        for _ in range(2):  # at their rest, and a step from it
            signals, results, step = map(np.array, made.call([numbers]))
            _reject(part, zip(names, signals, results, strict=True), len(settings) > 1)
            numbers[moving] += step
        for (values, n), number in zip(_places(plain), numbers[:, -1], strict=True):
            values[n] = float(number)
        with np.errstate(all="ignore"):  # what is not finite is rejected
            _near_rest(plain)
    if isinstance(part, Effect):
        columns = ["time", "reading", *layout.outputs, *model.rig.schema.motion(kind)]
        columns += ["effort", "answer"] if "effort" in (*inputs, *columns) else []
        for method in (part.grids, part.far_sizes, part.forms, part.limits, part.smallest):
            method(dict.fromkeys(columns, np.linspace(0.1, 0.9)))
        part.start_variances(1.0, 1.0)
    own = [symbol for symbol, (_, n) in zip(symbols, places, strict=True) if n.startswith(f"{part.name}.")]
    return bool(own) and ca.depends_on(column(of_rig), ca.vertcat(*own))


def _numbers(sym: Symbols, settings: list[dict[str, float]]) -> np.ndarray:
    """Numbers in the place of symbols, shape (symbols, settings POINTS): those of settings, and others made up."""
    rng, rows, places = np.random.default_rng(0), list[np.ndarray](), _places(sym)
    known = {"t0": 0.0, "dt": 0.01, "step": 0.0025, "shift": 0.0, "since": 0.005, "into": 0.0}
    for k, (values, n) in enumerate(places):
        made = rng.uniform(0.1, 1.0, POINTS) if values is not sym.c else np.full(POINTS, 0.2 + k / len(places))
        made *= rng.choice((-1.0, 1.0), POINTS) if n in SIGNED else 1e3 if n.endswith("_us") else 1.0
        made *= "." not in n  # a cause begins at its own rest
        rows.append(np.ravel([np.full(POINTS, {**known, **one}.get(n, made)) for one in settings]))
    return np.array(rows)


def _places(sym: Symbols) -> list[tuple[dict[str, Any], str]]:
    """Where the symbols of equations are, for numbers in their place."""
    places = [(values, n) for values in (sym.x, sym.m, sym.p, sym.c, sym.u) for n in values]
    return places + [(vars(sym), n) for n in ("t", "since", "into", "z")]


def _near_rest(sym: Symbols) -> tuple[list[Any], list[Any]]:
    """Return rates, memories and readings of a rig, and steps of effects' states and memories; all differ from rest."""
    states, memories, _ = sym.at_rest()
    sym.x, sym.m = ({n: v + there[n] for n, v in one.items()} for one, there in ((states, sym.x), (memories, sym.m)))
    after, rates, readings = sym.running()
    rows = [(n, sym.c["step"] * rate) for n, rate in zip(sym.states, rates, strict=True)]
    rows += [(n, value - sym.m[n]) for n, value in zip(sym.memories, after, strict=True)]
    return [*(v for n, v in rows if "." not in n), *readings], [v for n, v in rows if "." in n]


def _returned(notes: _Notes) -> list[list[Any]]:
    """Return for each number that a method returned: the method, the signal of `apply` (else 0), and the number."""
    other = ca.SX.sym("value")
    applied = [effect.apply(other, s.of(effect)) for n, (effect, *_, s), _ in notes if n == "apply"]
    if applied and not any(ca.depends_on(ca.SX(found), other) for found in applied):
        raise fault_of(type(notes[0][1][0]), "apply", "apply ignores value; expected the signal with the effect")
    rows = [(n, given[1] if n == "apply" else 0.0, leaf) for n, given, found in notes for leaf in _leaves(found)]
    return [[row[k] for row in rows] for k in range(3)]


def _reject(part: Effect | Rig, rows: Iterable[tuple[str, np.ndarray, np.ndarray]], null_first: bool) -> None:
    """Reject what is not finite, and an effect that is not nominal at its null, the first setting."""
    for n, signal, result in rows:
        bad = np.isfinite(signal) & ~np.isfinite(result)
        if bad.all() if isinstance(part, Rig) else bad.any():
            raise fault_of(type(part), n, f"{n} gives NaN or infinity; expected {FINITE}")
        off = np.abs(result - signal)[:POINTS] > ROUNDING * np.maximum(1.0, np.abs(signal[:POINTS]))
        if n == "apply" and null_first and off.any():
            words = f"apply makes {result[:POINTS][off][0]:.6g} of {signal[:POINTS][off][0]:.6g} at the null"
            raise fault_of(type(part), n, f"{words}; expected the same number")
