"""CasADi SX functions as LLVM functions on lanes: one walk over the instruction list."""

from __future__ import annotations

import casadi as ca

from fes_pin.models.compile.lanes import CONTRACT, LaneFunctions
from fes_pin.models.compile.straight import Lines, Value, splat

ROUNDED = (*CONTRACT, "arcp")
"""Beside fused products: what is divided by the same number several times may be multiplied by its inverse."""
_BINARY = {ca.OP_ADD: "fadd", ca.OP_SUB: "fsub", ca.OP_MUL: "fmul", ca.OP_DIV: "fdiv"}
_COMPARE = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_LANE_FUNCTIONS = {
    ca.OP_EXP: "exp",
    ca.OP_LOG: "log",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_TANH: "tanh",
    ca.OP_SQRT: "sqrt",
    ca.OP_FABS: "fabs",
    ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil",
    ca.OP_COPYSIGN: "copysign",
    ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_ATAN2: "atan2",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_ERF: "erf",
    ca.OP_POW: "pow",
    ca.OP_FMOD: "fmod",
    ca.OP_REMAINDER: "remainder",
    ca.OP_HYPOT: "hypot",
    ca.OP_LOG1P: "log1p",
    ca.OP_EXPM1: "expm1",
    ca.OP_ASINH: "asinh",
    ca.OP_ACOSH: "acosh",
    ca.OP_ATANH: "atanh",
}


def lowered(function: ca.Function, linkage: str = "internal") -> tuple[str, dict[str, str]]:
    """An LLVM function with one pointer to lanes for each input and output of `function` (their nonzeros).

    Returns
    -------
    text
        Its assembly.
    declared
        Declarations of the functions that it calls, by name.
    """
    lines = Lines()
    inputs, outputs = ([f"%{k}{i}" for i in range(n)] for k, n in (("i", function.n_in()), ("o", function.n_out())))
    _Lowering(lines).emit(function, inputs, outputs)
    return lines.function(function.name(), inputs, outputs, linkage), lines.declared


class _Lowering:
    """Lowers expressions into one function's lines."""

    def __init__(self, lines: Lines) -> None:
        self.lines, self.functions = lines, LaneFunctions(lines)

    def emit(self, function: ca.Function, inputs: list[str], outputs: list[str]) -> None:
        """Write out every instruction."""
        b, work = self.lines, dict[int, Value]()
        for k in range(function.n_instructions()):
            op, out = function.instruction_id(k), function.instruction_output(k)
            arguments = function.instruction_input(k)
            if op == ca.OP_INPUT:
                work[out[0]] = b.load(inputs[arguments[0]], arguments[1])
            elif op == ca.OP_OUTPUT:
                b.store(work[arguments[0]], outputs[out[0]], out[1])
            elif op == ca.OP_CONST:
                work[out[0]] = splat(function.instruction_constant(k))
            else:
                work[out[0]] = self._operation(op, [work[i] for i in arguments])

    def _operation(self, op: int, a: list[Value]) -> Value:
        b, one, zero = self.lines, splat(1.0), splat(0.0)
        if op in _BINARY:
            return b.operation(_BINARY[op], a[0], a[1], ROUNDED)
        if op in _COMPARE:
            compare = b.unordered if op == ca.OP_NE else b.ordered
            return _number(b, compare(_COMPARE[op], a[0], a[1]))
        simple = {
            ca.OP_NEG: lambda: b.fneg(a[0]),
            ca.OP_SQ: lambda: b.fmul(a[0], a[0]),
            ca.OP_TWICE: lambda: b.fadd(a[0], a[0]),
            ca.OP_INV: lambda: b.fdiv(one, a[0]),
            ca.OP_ASSIGN: lambda: a[0],
            ca.OP_NOT: lambda: _number(b, b.ordered("==", a[0], zero)),
            ca.OP_AND: lambda: _number(b, b.operation("and", _truth(b, a[0]), _truth(b, a[1]))),
            ca.OP_OR: lambda: _number(b, b.operation("or", _truth(b, a[0]), _truth(b, a[1]))),
            ca.OP_IF_ELSE_ZERO: lambda: b.select(_truth(b, a[0]), a[1], zero),
            ca.OP_FMIN: lambda: _extreme(b, "<", a[0], a[1]),
            ca.OP_FMAX: lambda: _extreme(b, ">", a[0], a[1]),
            ca.OP_SIGN: lambda: _sign(b, a[0]),
        }
        if op in simple:
            return simple[op]()
        if op == ca.OP_CONSTPOW:
            op = ca.OP_POW
        if op not in _LANE_FUNCTIONS:
            raise NotImplementedError(f"CasADi operation {op} has no lowering")
        return self.functions.call(_LANE_FUNCTIONS[op], *a)


def _number(b: Lines, mask: Value) -> Value:
    """A mask as 1.0 and 0.0."""
    return b.select(mask, splat(1.0), splat(0.0))


def _extreme(b: Lines, relation: str, one: Value, other: Value) -> Value:
    """The smaller or larger number; NaN if either is (CasADi's own would hide it)."""
    chosen = b.select(b.unordered(relation, one, other), one, other)
    return b.select(b.unordered("uno", other, other), other, chosen)


def _sign(b: Lines, value: Value) -> Value:
    """-1, 0 or 1; NaN for NaN."""
    zero = splat(0.0)
    sign = b.fsub(_number(b, b.ordered(">", value, zero)), _number(b, b.ordered("<", value, zero)))
    return b.select(b.unordered("uno", value, value), value, sign)


def _truth(b: Lines, value: Value) -> Value:
    """A number as a mask: true where it is not zero."""
    return b.unordered("!=", value, splat(0.0))
