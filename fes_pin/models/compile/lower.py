"""CasADi SX functions as LLVM functions on lanes: one walk over the instruction list."""

from __future__ import annotations

import casadi as ca
from llvmlite import ir

from fes_pin.models.compile.lanes import CONTRACT, VECTOR, LaneFunctions, index, select_lanes, splat

POINTER = ir.PointerType(VECTOR)
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


class Lowering:
    """Lowers expressions into one LLVM module."""

    def __init__(self, module: ir.Module) -> None:
        self.module = module
        self.functions = LaneFunctions(module)

    def lower(self, function: ca.Function) -> ir.Function:
        """Add an LLVM function with one pointer to lanes for each input and output of `function` (their nonzeros)."""
        count = function.n_in() + function.n_out()
        made = ir.Function(self.module, ir.FunctionType(ir.VoidType(), [POINTER] * count), function.name())
        made.linkage = "internal"
        for arg in made.args[function.n_in() :]:
            arg.add_attribute("noalias")
        builder = ir.IRBuilder(made.append_basic_block())
        self._emit(builder, function, made.args)
        builder.ret_void()
        return made

    def _emit(self, b: ir.IRBuilder, function: ca.Function, pointers: tuple[ir.Argument, ...]) -> None:
        work: dict[int, ir.Value] = {}
        inputs, outputs = pointers[: function.n_in()], pointers[function.n_in() :]
        for k in range(function.n_instructions()):
            op, out = function.instruction_id(k), function.instruction_output(k)
            arguments = function.instruction_input(k)
            if op == ca.OP_INPUT:
                work[out[0]] = b.load(_element(b, inputs[arguments[0]], arguments[1]), align=8)
            elif op == ca.OP_OUTPUT:
                b.store(work[arguments[0]], _element(b, outputs[out[0]], out[1]), align=8)
            elif op == ca.OP_CONST:
                work[out[0]] = splat(function.instruction_constant(k))
            else:
                work[out[0]] = self._operation(b, op, [work[i] for i in arguments])

    def _operation(self, b: ir.IRBuilder, op: int, a: list[ir.Value]) -> ir.Value:
        one, zero = splat(1.0), splat(0.0)
        if op in _BINARY:
            return getattr(b, _BINARY[op])(a[0], a[1], flags=ROUNDED)
        if op in _COMPARE:
            compare = b.fcmp_unordered if op == ca.OP_NE else b.fcmp_ordered
            return _number(b, compare(_COMPARE[op], a[0], a[1]))
        simple = {
            ca.OP_NEG: lambda: b.fneg(a[0]),
            ca.OP_SQ: lambda: b.fmul(a[0], a[0]),
            ca.OP_TWICE: lambda: b.fadd(a[0], a[0]),
            ca.OP_INV: lambda: b.fdiv(one, a[0]),
            ca.OP_ASSIGN: lambda: a[0],
            ca.OP_NOT: lambda: _number(b, b.fcmp_ordered("==", a[0], zero)),
            ca.OP_AND: lambda: _number(b, b.and_(_truth(b, a[0]), _truth(b, a[1]))),
            ca.OP_OR: lambda: _number(b, b.or_(_truth(b, a[0]), _truth(b, a[1]))),
            ca.OP_IF_ELSE_ZERO: lambda: select_lanes(b, _truth(b, a[0]), a[1], zero),
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
        return self.functions.call(b, _LANE_FUNCTIONS[op], *a)


def _element(b: ir.IRBuilder, pointer: ir.Value, place: int) -> ir.Value:
    return b.gep(pointer, [index(place)])


def _number(b: ir.IRBuilder, mask: ir.Value) -> ir.Value:
    """A mask as 1.0 and 0.0."""
    return b.select(mask, splat(1.0), splat(0.0))


def _extreme(b: ir.IRBuilder, relation: str, one: ir.Value, other: ir.Value) -> ir.Value:
    """The smaller or larger number; NaN if either is (CasADi's own would hide it)."""
    chosen = select_lanes(b, b.fcmp_unordered(relation, one, other), one, other)
    return select_lanes(b, b.fcmp_unordered("uno", other, other), other, chosen)


def _sign(b: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """-1, 0 or 1; NaN for NaN."""
    zero = splat(0.0)
    sign = b.fsub(_number(b, b.fcmp_ordered(">", value, zero)), _number(b, b.fcmp_ordered("<", value, zero)))
    return select_lanes(b, b.fcmp_unordered("uno", value, value), value, sign)


def _truth(b: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """A number as a mask: true where it is not zero."""
    return b.fcmp_unordered("!=", value, splat(0.0))
