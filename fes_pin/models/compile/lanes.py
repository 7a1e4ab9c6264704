"""Elementary functions on SIMD lanes, written as LLVM IR.

Each is accurate to a few units in the last place; NaN passes through, so a simulation that went wrong shows it.
Ranges: `exp` is 0 below -708 and infinite above 709.4; `log` is -inf at 0 and NaN below, and takes numbers below
2.2e-308 for 0; `sin` and `cos` are exact to the rounding of the result up to 1e6, to that of the argument from there,
and NaN from 1e9; `tanh` takes any number. Polynomials are Taylor series after range reduction, long enough that the
truncation error is below the rounding error.
"""

import math
import sys
from collections.abc import Callable, Sequence

from fes_pin.models.compile.straight import Lines, Value

CONTRACT = ("contract",)
"""A product and a sum may become one fused instruction."""

LN2_HIGH = float.fromhex("0x1.62e42fee00000p-1")  # ln 2, its leading 33 bits
LN2_LOW = float.fromhex("0x1.a39ef35793c76p-33")  # ln 2, the bits after those
HALF_PI_HIGH = float.fromhex("0x1.921fb54400000p+0")  # pi/2, its leading 33 bits
HALF_PI_MIDDLE = float.fromhex("0x1.0b4611a600000p-34")  # the next 33 bits
MAGIC = 1.5 * 2.0**52  # what is added to it is in the low bits of its mantissa
HALF_PI_LOW = float.fromhex("0x1.3198a2e037073p-69")  # the bits after those


class LaneFunctions:
    """Elementary functions of one function's lanes, written out where they are called: a call would spill registers."""

    def __init__(self, lines: Lines) -> None:
        self.lines = lines
        self._turns: dict[Value, tuple[Value, Value, Value]] = {}
        self._bodies: dict[str, Callable[[Lines, Value], Value]] = {
            "exp": self._exp,
            "log": self._log,
            "sin": lambda b, x: self._sine(b, x, 0),
            "cos": lambda b, x: self._sine(b, x, 1),
            "tanh": self._tanh,
        }

    def call(self, name: str, *args: Value) -> Value:
        """`name` of lanes: our own vector code, an LLVM intrinsic, or the C library lane by lane."""
        if name in self._bodies:
            return self._bodies[name](self.lines, *args)
        if name in {"fabs", "sqrt", "floor", "ceil", "copysign", "rint"}:
            return self.lines.intrinsic(name, args)
        return self.lines.per_lane(name, args)

    def _exp(self, b: Lines, x: Value) -> Value:
        """e^x = 2^n e^r with |r| <= ln 2 / 2; beyond [-708, 709.4] a double has no room for 2^n."""
        n = self.call("rint", b.fmul(x, b.splat(1 / math.log(2))))
        r = b.fsub(b.fsub(x, b.fmul(n, b.splat(LN2_HIGH))), b.fmul(n, b.splat(LN2_LOW)))
        y = polynomial(b, r, [1 / math.factorial(k) for k in range(14)])
        bits = b.operation("shl", b.operation("add", self._to_int(b, n), b.splat_int(1023)), b.splat_int(52))
        y = b.fmul(y, b.bits_as(bits, b.vector))
        y = b.select(b.compare("fcmp olt", x, b.splat(-708.0)), b.splat(0.0), y)
        return b.select(b.compare("fcmp ogt", x, b.splat(709.4)), b.splat(math.inf), y)

    def _to_int(self, b: Lines, n: Value) -> Value:
        """A whole number |n| < 2^51 as an integer: adding MAGIC leaves it in the low bits of the mantissa."""
        magic = b.splat(MAGIC)
        return b.operation("sub", b.bits_as(b.fadd(n, magic), b.integers), b.bits_as(magic, b.integers))

    def _log(self, b: Lines, x: Value) -> Value:
        """ln x = e ln 2 + 2 atanh((m - 1) / (m + 1)), x = m 2^e, m in [sqrt(1/2), sqrt(2))."""
        bits = b.bits_as(x, b.integers)
        offset = b.operation("sub", bits, b.splat_int(0x3FE6A09E667F3BCD))  # sqrt(1/2)
        exponent = b.operation("ashr", offset, b.splat_int(52))
        m = b.bits_as(b.operation("sub", bits, b.operation("shl", exponent, b.splat_int(52))), b.vector)
        magic = b.splat(MAGIC)
        e = b.fsub(b.bits_as(b.operation("add", exponent, b.bits_as(magic, b.integers)), b.vector), magic)
        f = b.fdiv(b.fsub(m, b.splat(1.0)), b.fadd(m, b.splat(1.0)))
        series = polynomial(b, b.fmul(f, f), [2 / (2 * k + 1) for k in range(12)])
        value = b.fadd(b.fmul(e, b.splat(LN2_HIGH)), b.fadd(b.fmul(f, series), b.fmul(e, b.splat(LN2_LOW))))
        value = b.select(b.compare("fcmp ult", x, b.splat(sys.float_info.min)), b.splat(-math.inf), value)
        value = b.select(b.compare("fcmp ole", x, b.splat(sys.float_info.max)), value, x)
        return b.select(b.compare("fcmp olt", x, b.splat(0.0)), b.splat(math.nan), value)

    def _sine(self, b: Lines, x: Value, quarter: int) -> Value:
        """Sine of x plus `quarter` quarter turns."""
        if x not in self._turns:
            self._turns[x] = self._turn(b, x)
        quarters, sine, cosine = self._turns[x]
        turn = b.operation("add", quarters, b.splat_int(quarter))
        odd = b.compare("icmp ne", b.operation("and", turn, b.splat_int(1)), b.splat_int(0))
        value = b.select(odd, cosine, sine)
        sign = b.operation("shl", b.operation("and", turn, b.splat_int(2)), b.splat_int(62))
        return b.bits_as(b.operation("xor", b.bits_as(value, b.integers), sign), b.vector)

    def _turn(self, b: Lines, x: Value) -> tuple[Value, Value, Value]:
        """Quarter turns in x, and sine and cosine of the remainder |r| <= pi / 4; sin(x) and cos(x) share them."""
        n = self.call("rint", b.fmul(x, b.splat(2 / math.pi)))
        r = b.fsub(x, b.fmul(n, b.splat(HALF_PI_HIGH)))
        r = b.fsub(b.fsub(r, b.fmul(n, b.splat(HALF_PI_MIDDLE))), b.fmul(n, b.splat(HALF_PI_LOW)))
        size = self.call("fabs", x)
        r = b.select(b.compare("fcmp olt", size, b.splat(1e9)), r, b.splat(math.nan))
        square = b.fmul(r, r)
        sine = b.fmul(r, polynomial(b, square, [(-1) ** k / math.factorial(2 * k + 1) for k in range(9)]))
        cosine = polynomial(b, square, [(-1) ** k / math.factorial(2 * k) for k in range(10)])
        return self._to_int(b, n), sine, cosine

    def _tanh(self, b: Lines, x: Value) -> Value:
        """tanh x = (1 - e) / (1 + e), e = exp(-2 |x|), with the sign of x; a series below 0.03."""
        size = self.call("fabs", x)
        e = self.call("exp", b.fmul(size, b.splat(-2.0)))
        value = b.fdiv(b.fsub(b.splat(1.0), e), b.fadd(b.splat(1.0), e))
        small = b.fmul(size, polynomial(b, b.fmul(x, x), [1.0, -1 / 3, 2 / 15, -17 / 315, 62 / 2835, -1382 / 155925]))
        value = b.select(b.compare("fcmp olt", size, b.splat(0.03)), small, value)
        return self.call("copysign", value, x)


def polynomial(b: Lines, x: Value, coefficients: Sequence[float]) -> Value:
    """Sum of coefficients[k] x^k, in pairs of pairs (Estrin): a chain of log2(terms) steps, Horner's has `terms`."""
    terms: list[Value] = [b.splat(c) for c in coefficients]
    while len(terms) > 1:
        pairs = [b.fadd(b.fmul(terms[k + 1], x, CONTRACT), terms[k], CONTRACT) for k in range(0, len(terms) - 1, 2)]
        terms = pairs + terms[2 * len(pairs) :]
        x = b.fmul(x, x)
    return terms[0]
