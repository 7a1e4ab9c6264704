"""CasADi SX functions as LLVM functions on lanes: one walk over the instruction list.

What depends on nothing that changes in a loop is worked out before it: an instruction says what it reads, and so at
which stage all of that is known.
"""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from fes_pin.models.compile.lanes import CONTRACT, LaneFunctions
from fes_pin.models.compile.layout import WIDTH
from fes_pin.models.compile.straight import Lines, Value

ROUNDED = (*CONTRACT, "arcp")
"""Floating-point flags: fused products, and products with an inverse for several divisions by the same number."""
KEPT = "%kept"
"""Name of the pointer to what earlier parts of a function leave to later ones."""
_BINARY = {ca.OP_ADD: "fadd", ca.OP_SUB: "fsub", ca.OP_MUL: "fmul", ca.OP_DIV: "fdiv"}
_COMPARE = {ca.OP_LT: "olt", ca.OP_LE: "ole", ca.OP_EQ: "oeq", ca.OP_NE: "une"}
_NAMED = (
    *("exp", "log", "sin", "cos", "tanh", "sqrt", "fabs", "floor", "ceil", "copysign", "tan", "asin", "acos", "atan"),
    *("atan2", "sinh", "cosh", "erf", "pow", "fmod", "remainder", "hypot", "log1p", "expm1", "asinh", "acosh", "atanh"),
)
_LANE_FUNCTIONS = {getattr(ca, f"OP_{n.upper()}"): n for n in _NAMED} | {ca.OP_CONSTPOW: "pow"}


@dataclass(frozen=True)
class Staged:
    """A function as assembly: each part works out what it can of the inputs that are known by then.

    Attributes
    ----------
    parts
        Names of the functions that are there, by stage; the last stage's is the function's own and always there.
        Each takes a pointer to lanes for every input of the function and one to what is kept between the parts; the
        last takes one for every output besides.
    text
        Their assembly.
    declared
        Declarations of the functions that they call, by name.
    kept
        How many vectors earlier parts leave to later ones.
    """

    parts: Mapping[int, str]
    text: str
    declared: Mapping[str, str]
    kept: int


def lowered(
    function: ca.Function, linkage: str = "internal", known: Sequence[Container[int]] = (), width: int = WIDTH
) -> Staged:
    """`function` in LLVM assembly; its inputs and outputs are the nonzeros of CasADi's, a vector of lanes each.

    Parameters
    ----------
    linkage
        "internal", or "external" of what is called from outside the module.
    known
        For each earlier stage, numbers of the inputs that do not change from it to the last; by default there is one
        stage alone.
    width
        Lanes of a vector.

    Raises
    ------
    NotImplementedError
        For an operation of CasADi that has no lowering.
    """
    schedule, last = _Schedule(function, known), len(known)
    parts, texts, declared = dict[int, str](), [], dict[str, str]()
    inputs, outputs = ([f"%{k}{i}" for i in range(n)] for k, n in (("i", function.n_in()), ("o", function.n_out())))
    for stage in range(last + 1):
        if stage < last and stage not in {schedule.stages[i] for i in schedule.places}:  # nothing of it is kept
            continue
        lines = Lines(width)
        _Lowering(lines, schedule, stage).emit(inputs, outputs)
        parts[stage] = function.name() if stage == last else f"{function.name()}.{stage}"
        texts.append(lines.function(parts[stage], [*inputs, KEPT], outputs if stage == last else [], linkage))
        declared |= lines.declared
    return Staged(parts, "\n".join(texts), declared, len(schedule.places))


class _Node(NamedTuple):
    """An instruction: what it does, the instructions that it reads, its place where it is an input or an output."""

    op: int
    arguments: tuple[int, ...]
    place: tuple[int, int] = (0, 0)
    value: float = 0.0


class _Schedule:
    """The instructions of a function, the stage at which each can be worked out, and what is kept for later ones.

    What is divided by a number of an earlier stage is multiplied by its inverse.
    """

    def __init__(self, function: ca.Function, known: Sequence[Container[int]]) -> None:
        self.nodes: list[_Node] = []
        self.stages: list[int] = []
        self.places: dict[int, int] = {}
        self._inverses: dict[int, int] = {}
        slots, last = dict[int, int](), len(known)
        for k in range(function.n_instructions()):
            op, out, given = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
            if op == ca.OP_INPUT:
                stage = next((s for s, those in enumerate(known) if given[0] in those), last)
                slots[out[0]] = self._add(_Node(op, (), (given[0], given[1])), stage)
            elif op == ca.OP_CONST:
                slots[out[0]] = self._add(_Node(op, (), value=function.instruction_constant(k)), 0)
            elif op == ca.OP_OUTPUT:
                self._add(_Node(op, (slots[given[0]],), (out[0], out[1])), last)
            else:
                slots[out[0]] = self._operation(op, tuple(slots[i] for i in given))

    def _operation(self, op: int, arguments: tuple[int, ...]) -> int:
        stage = max(self.stages[i] for i in arguments)
        if op == ca.OP_DIV and self.stages[arguments[1]] < stage:
            over, under = arguments
            if under not in self._inverses:
                self._inverses[under] = self._add(_Node(ca.OP_INV, (under,)), self.stages[under])
            op, arguments = ca.OP_MUL, (over, self._inverses[under])
        return self._add(_Node(op, arguments), stage)

    def _add(self, node: _Node, stage: int) -> int:
        """Number of a new instruction; what it reads of earlier stages, but for inputs and constants, is kept."""
        for i in node.arguments:
            if self.stages[i] < stage and self.nodes[i].op not in (ca.OP_INPUT, ca.OP_CONST):
                self.places.setdefault(i, len(self.places))
        self.nodes.append(node)
        self.stages.append(stage)
        return len(self.nodes) - 1


class _Lowering:
    """Lowers what one stage works out into one function's lines."""

    def __init__(self, lines: Lines, schedule: _Schedule, stage: int) -> None:
        self.lines, self.schedule, self.stage = lines, schedule, stage
        self.functions = LaneFunctions(lines)
        self._made: dict[int, Value] = {}

    def emit(self, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Write out every instruction of the stage."""
        for k, node in enumerate(self.schedule.nodes):
            if self.schedule.stages[k] != self.stage or node.op in (ca.OP_INPUT, ca.OP_CONST):
                continue
            arguments = [self._value(i, inputs) for i in node.arguments]
            if node.op == ca.OP_OUTPUT:
                self.lines.store(arguments[0], outputs[node.place[0]], node.place[1])
                continue
            self._made[k] = self._operation(node.op, arguments)
            if k in self.schedule.places:
                self.lines.store(self._made[k], KEPT, self.schedule.places[k])

    def _value(self, k: int, inputs: Sequence[str]) -> Value:
        """Return the value of an instruction: computed here, or read."""
        if k not in self._made:
            node = self.schedule.nodes[k]
            if node.op == ca.OP_CONST:
                self._made[k] = self.lines.splat(node.value)
            elif node.op == ca.OP_INPUT:
                self._made[k] = self.lines.load(inputs[node.place[0]], node.place[1])
            else:
                self._made[k] = self.lines.load(KEPT, self.schedule.places[k])
        return self._made[k]

    def _operation(self, op: int, a: list[Value]) -> Value:
        b, one, zero = self.lines, self.lines.splat(1.0), self.lines.splat(0.0)
        if op in _BINARY:
            return b.operation(_BINARY[op], a[0], a[1], ROUNDED)
        if op in _COMPARE:
            return _number(b, b.compare(f"fcmp {_COMPARE[op]}", a[0], a[1]))
        simple = {
            ca.OP_NEG: lambda: b.fneg(a[0]),
            ca.OP_SQ: lambda: b.fmul(a[0], a[0]),
            ca.OP_TWICE: lambda: b.fadd(a[0], a[0]),
            ca.OP_INV: lambda: b.fdiv(one, a[0]),
            ca.OP_ASSIGN: lambda: a[0],
            ca.OP_NOT: lambda: _number(b, b.compare("fcmp oeq", a[0], zero)),
            ca.OP_AND: lambda: _number(b, b.operation("and", _truth(b, a[0]), _truth(b, a[1]))),
            ca.OP_OR: lambda: _number(b, b.operation("or", _truth(b, a[0]), _truth(b, a[1]))),
            ca.OP_IF_ELSE_ZERO: lambda: b.select(_truth(b, a[0]), a[1], zero),
            ca.OP_FMIN: lambda: _extreme(b, "ult", a[0], a[1]),
            ca.OP_FMAX: lambda: _extreme(b, "ugt", a[0], a[1]),
            ca.OP_SIGN: lambda: _sign(b, a[0]),
        }
        if op in simple:
            return simple[op]()
        if op not in _LANE_FUNCTIONS:
            raise NotImplementedError(f"CasADi operation {op} has no lowering")
        return self.functions.call(_LANE_FUNCTIONS[op], *a)


def _number(b: Lines, mask: Value) -> Value:
    """A mask as 1.0 and 0.0."""
    return b.select(mask, b.splat(1.0), b.splat(0.0))


def _extreme(b: Lines, relation: str, one: Value, other: Value) -> Value:
    """The smaller or larger number; NaN if either is (CasADi's own would hide it)."""
    chosen = b.select(b.compare(f"fcmp {relation}", one, other), one, other)
    return b.select(b.compare("fcmp uno", other, other), other, chosen)


def _sign(b: Lines, value: Value) -> Value:
    """-1, 0 or 1; NaN for NaN."""
    zero = b.splat(0.0)
    sign = b.fsub(_number(b, b.compare("fcmp ogt", value, zero)), _number(b, b.compare("fcmp olt", value, zero)))
    return b.select(b.compare("fcmp uno", value, value), value, sign)


def _truth(b: Lines, value: Value) -> Value:
    """A number as a mask: true where it is not zero."""
    return b.compare("fcmp une", value, b.splat(0.0))
