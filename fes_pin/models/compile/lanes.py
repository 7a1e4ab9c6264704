"""Elementary functions on SIMD lanes, written as LLVM IR.

Each is accurate to a few units in the last place; NaN passes through, so a simulation that went wrong shows it.
Ranges: `exp` is 0 below -708 and infinite above 709.4; `log` is -inf at 0 and NaN below, and takes numbers below
2.2e-308 for 0; `sin` and `cos` are exact to the rounding of the result up to 1e6, to that of the argument from there,
and NaN from 1e9; `tanh` takes any number. Polynomials are Taylor series after range reduction, long enough that the
truncation error is below the rounding error.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from functools import cache

from llvmlite import ir

from fes_pin.models.compile.layout import WIDTH

DOUBLE, INT64, BOOL = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
VECTOR, INT_VECTOR = ir.VectorType(DOUBLE, WIDTH), ir.VectorType(INT64, WIDTH)

CONTRACT = ("contract",)
"""A product and a sum may become one fused instruction."""

LN2_HIGH = float.fromhex("0x1.62e42fee00000p-1")  # ln 2, its leading 33 bits
LN2_LOW = float.fromhex("0x1.a39ef35793c76p-33")  # the rest of ln 2
HALF_PI_HIGH = float.fromhex("0x1.921fb54400000p+0")  # pi/2, its leading 33 bits
HALF_PI_MIDDLE = float.fromhex("0x1.0b4611a600000p-34")  # the next 33 bits
HALF_PI_LOW = float.fromhex("0x1.3198a2e037073p-69")  # the rest


def splat(value: float) -> ir.Constant:
    """The same number in every lane."""
    return _splat(float(value).hex())


@cache
def _splat(value: str) -> ir.Constant:
    """The number of a hexadecimal text in every lane; made once, as is the text that stands for it in assembly."""
    return ir.Constant(VECTOR, [float.fromhex(value)] * WIDTH)


@cache
def splat_int(value: int) -> ir.Constant:
    """The same integer in every lane."""
    return ir.Constant(INT_VECTOR, [int(value)] * WIDTH)


@cache
def index(value: int) -> ir.Constant:
    """A place in an array."""
    return ir.Constant(INT64, value)


class LaneFunctions:
    """The functions of one module, written out where they are called: a call would spill every register."""

    def __init__(self, module: ir.Module) -> None:
        self.module = module
        self._made: dict[str, ir.Function] = {}
        self._turns: dict[tuple[ir.Block, ir.Value], tuple[ir.Value, ir.Value, ir.Value]] = {}
        self._bodies: dict[str, Callable[[ir.IRBuilder, ir.Value], ir.Value]] = {
            "exp": self._exp,
            "log": self._log,
            "sin": lambda b, x: self._sine(b, x, 0),
            "cos": lambda b, x: self._sine(b, x, 1),
            "tanh": self._tanh,
        }

    def call(self, builder: ir.IRBuilder, name: str, *args: ir.Value) -> ir.Value:
        """Call `name` on lanes: our own vector code, an LLVM intrinsic, or the C library lane by lane."""
        if name in self._bodies:
            return self._bodies[name](builder, *args)
        if name in {"fabs", "sqrt", "floor", "ceil", "copysign", "rint"}:
            return builder.call(self._intrinsic(name, len(args)), args)
        return self._per_lane(builder, name, args)

    def _intrinsic(self, name: str, arity: int) -> ir.Function:
        full = f"llvm.{name}.v{WIDTH}f64"
        if full not in self._made:
            self._made[full] = ir.Function(self.module, ir.FunctionType(VECTOR, [VECTOR] * arity), full)
        return self._made[full]

    def _per_lane(self, builder: ir.IRBuilder, name: str, args: Sequence[ir.Value]) -> ir.Value:
        if name not in self._made:
            self._made[name] = ir.Function(self.module, ir.FunctionType(DOUBLE, [DOUBLE] * len(args)), name)
        out: ir.Value = ir.Constant(VECTOR, ir.Undefined)
        for lane in range(WIDTH):
            at = ir.Constant(ir.IntType(32), lane)
            value = builder.call(self._made[name], [builder.extract_element(a, at) for a in args])
            out = builder.insert_element(out, value, at)
        return out

    def _exp(self, b: ir.IRBuilder, x: ir.Value) -> ir.Value:
        """e^x = 2^n e^r with |r| <= ln 2 / 2; beyond [-708, 709.4] a double has no room for 2^n."""
        n = self.call(b, "rint", b.fmul(x, splat(1 / math.log(2))))
        r = b.fsub(b.fsub(x, b.fmul(n, splat(LN2_HIGH))), b.fmul(n, splat(LN2_LOW)))
        y = polynomial(b, r, [1 / math.factorial(k) for k in range(14)])
        bits = b.shl(b.add(self._to_int(b, n), splat_int(1023)), splat_int(52))
        y = b.fmul(y, b.bitcast(bits, VECTOR))
        y = select_lanes(b, b.fcmp_ordered("<", x, splat(-708.0)), splat(0.0), y)
        return select_lanes(b, b.fcmp_ordered(">", x, splat(709.4)), splat(math.inf), y)

    def _to_int(self, b: ir.IRBuilder, n: ir.Value) -> ir.Value:
        """A whole number |n| < 2^51 as an integer: adding 1.5 * 2^52 leaves it in the low bits of the mantissa."""
        magic = 6755399441055744.0
        return b.sub(b.bitcast(b.fadd(n, splat(magic)), INT_VECTOR), b.bitcast(splat(magic), INT_VECTOR))

    def _log(self, b: ir.IRBuilder, x: ir.Value) -> ir.Value:
        """ln x = e ln 2 + 2 atanh((m - 1) / (m + 1)), x = m 2^e, m in [sqrt(1/2), sqrt(2))."""
        bits = b.bitcast(x, INT_VECTOR)
        offset = b.sub(bits, splat_int(0x3FE6A09E667F3BCD))  # sqrt(1/2)
        exponent = b.ashr(offset, splat_int(52))
        m = b.bitcast(b.sub(bits, b.shl(exponent, splat_int(52))), VECTOR)
        magic = 6755399441055744.0
        e = b.fsub(b.bitcast(b.add(exponent, b.bitcast(splat(magic), INT_VECTOR)), VECTOR), splat(magic))
        f = b.fdiv(b.fsub(m, splat(1.0)), b.fadd(m, splat(1.0)))
        series = polynomial(b, b.fmul(f, f), [2 / (2 * k + 1) for k in range(12)])
        value = b.fadd(b.fmul(e, splat(LN2_HIGH)), b.fadd(b.fmul(f, series), b.fmul(e, splat(LN2_LOW))))
        value = select_lanes(b, b.fcmp_unordered("<", x, splat(sys.float_info.min)), splat(-math.inf), value)
        value = select_lanes(b, b.fcmp_ordered("<=", x, splat(sys.float_info.max)), value, x)
        return select_lanes(b, b.fcmp_ordered("<", x, splat(0.0)), splat(math.nan), value)

    def _sine(self, b: ir.IRBuilder, x: ir.Value, quarter: int) -> ir.Value:
        """Sine of x plus `quarter` quarter turns."""
        if (b.block, x) not in self._turns:
            self._turns[b.block, x] = self._turn(b, x)
        quarters, sine, cosine = self._turns[b.block, x]
        turn = b.add(quarters, splat_int(quarter))
        odd = b.icmp_signed("!=", b.and_(turn, splat_int(1)), splat_int(0))
        value = select_lanes(b, odd, cosine, sine)
        sign = b.shl(b.and_(turn, splat_int(2)), splat_int(62))
        return b.bitcast(b.xor(b.bitcast(value, INT_VECTOR), sign), VECTOR)

    def _turn(self, b: ir.IRBuilder, x: ir.Value) -> tuple[ir.Value, ir.Value, ir.Value]:
        """Quarter turns in x, and sine and cosine of the rest |r| <= pi / 4; sin(x) and cos(x) share them."""
        n = self.call(b, "rint", b.fmul(x, splat(2 / math.pi)))
        r = b.fsub(x, b.fmul(n, splat(HALF_PI_HIGH)))
        r = b.fsub(b.fsub(r, b.fmul(n, splat(HALF_PI_MIDDLE))), b.fmul(n, splat(HALF_PI_LOW)))
        size = self.call(b, "fabs", x)
        r = select_lanes(b, b.fcmp_ordered("<", size, splat(1e9)), r, splat(math.nan))
        square = b.fmul(r, r)
        sine = b.fmul(r, polynomial(b, square, [(-1) ** k / math.factorial(2 * k + 1) for k in range(9)]))
        cosine = polynomial(b, square, [(-1) ** k / math.factorial(2 * k) for k in range(10)])
        return self._to_int(b, n), sine, cosine

    def _tanh(self, b: ir.IRBuilder, x: ir.Value) -> ir.Value:
        """tanh x = (1 - e) / (1 + e), e = exp(-2 |x|), with the sign of x; a series below 0.03."""
        size = self.call(b, "fabs", x)
        e = self.call(b, "exp", b.fmul(size, splat(-2.0)))
        value = b.fdiv(b.fsub(splat(1.0), e), b.fadd(splat(1.0), e))
        small = b.fmul(size, polynomial(b, b.fmul(x, x), [1.0, -1 / 3, 2 / 15, -17 / 315, 62 / 2835, -1382 / 155925]))
        value = select_lanes(b, b.fcmp_ordered("<", size, splat(0.03)), small, value)
        return self.call(b, "copysign", value, x)


def polynomial(b: ir.IRBuilder, x: ir.Value, coefficients: Sequence[float]) -> ir.Value:
    """Sum of coefficients[k] x^k, in pairs of pairs (Estrin): a chain of log2(terms) steps, Horner's has `terms`."""
    terms: list[ir.Value] = [splat(c) for c in coefficients]
    while len(terms) > 1:
        pairs = [
            b.fadd(b.fmul(terms[k + 1], x, flags=CONTRACT), terms[k], flags=CONTRACT)
            for k in range(0, len(terms) - 1, 2)
        ]
        terms = pairs + terms[2 * len(pairs) :]
        x = b.fmul(x, x)
    return terms[0]


def select_lanes(b: ir.IRBuilder, mask: ir.Value, yes: ir.Value, no: ir.Value) -> ir.Value:
    """`yes` where the mask holds, else `no`, lane by lane."""
    return b.select(mask, yes, no)
