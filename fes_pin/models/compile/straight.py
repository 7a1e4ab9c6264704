"""Straight-line LLVM assembly on lanes, written as text.

What a model's equations are is thousands of instructions without a branch. llvmlite's builder makes several objects for
each and formats them one by one; here an instruction is a line. The time loop, which branches, is llvmlite's.
"""

import struct
from collections.abc import Sequence
from functools import partialmethod
from typing import NamedTuple

from fes_pin.models.compile.layout import WIDTH


class Value(NamedTuple):
    """A value: its type, and its name or what it is."""

    type: str
    text: str


class Lines:
    """The instructions of one function on so many lanes, line by line."""

    def __init__(self, width: int = WIDTH) -> None:
        self.width, self.lines = width, list[str]()
        self.vector, self.integers, self._mask = (f"<{width} x {one}>" for one in ("double", "i64", "i1"))
        self.declared: dict[str, str] = {}

    def splat(self, value: float) -> Value:
        """Return the same number in every lane."""
        bits = struct.unpack("<Q", struct.pack("<d", value))[0]
        return self._everywhere(self.vector, f"double 0x{bits:016x}")

    def splat_int(self, value: int) -> Value:
        """Return the same integer in every lane."""
        return self._everywhere(self.integers, f"i64 {int(value)}")

    def _everywhere(self, kind: str, text: str) -> Value:
        return Value(kind, f"<{', '.join([text] * self.width)}>")

    def _made(self, kind: str, text: str) -> Value:
        name = f"%v{len(self.lines)}"
        self.lines.append(f"  {name} = {text}")
        return Value(kind, name)

    def operation(self, name: str, one: Value, other: Value, flags: Sequence[str] = ()) -> Value:
        """Return an operation on two values of a type: fadd, fsub, fmul, fdiv, add, sub, shl, ashr, and, or, xor."""
        return self._made(one.type, f"{' '.join((name, *flags))} {one.type} {one.text}, {other.text}")

    fadd, fsub = partialmethod(operation, "fadd"), partialmethod(operation, "fsub")
    fmul, fdiv = partialmethod(operation, "fmul"), partialmethod(operation, "fdiv")

    def fneg(self, one: Value) -> Value:
        """The number with its sign turned round."""
        return self._made(one.type, f"fneg {one.type} {one.text}")

    def compare(self, relation: str, one: Value, other: Value) -> Value:
        """Mask: true where a relation holds, in LLVM's words; `fcmp olt` is false of NaN, `fcmp ult` true."""
        return self._made(self._mask, f"{relation} {one.type} {one.text}, {other.text}")

    def select(self, mask: Value, yes: Value, no: Value) -> Value:
        """`yes` where the mask holds, else `no`, lane by lane."""
        return self._made(yes.type, f"select {self._mask} {mask.text}, {yes.type} {yes.text}, {no.type} {no.text}")

    def bits_as(self, one: Value, kind: str) -> Value:
        """Return the same bits as another type."""
        return self._made(kind, f"bitcast {one.type} {one.text} to {kind}")

    def intrinsic(self, name: str, args: Sequence[Value]) -> Value:
        """LLVM's own function on lanes."""
        return self._called(self.vector, f"llvm.{name}.v{self.width}f64", args)

    def per_lane(self, name: str, args: Sequence[Value]) -> Value:
        """A function of the C library, lane by lane."""
        out = Value(self.vector, "undef")
        for lane in range(self.width):
            each = [self._made("double", f"extractelement {a.type} {a.text}, i32 {lane}") for a in args]
            value = self._called("double", name, each)
            out = self._made(self.vector, f"insertelement {self.vector} {out.text}, double {value.text}, i32 {lane}")
        return out

    def _called(self, kind: str, name: str, args: Sequence[Value]) -> Value:
        self.declared[name] = f'declare {kind} @"{name}"({", ".join([kind] * len(args))})'
        return self._made(kind, f'call {kind} @"{name}"({", ".join(f"{a.type} {a.text}" for a in args)})')

    def load(self, pointer: str, place: int) -> Value:
        """A vector from an array of them."""
        return self._made(self.vector, f"load {self.vector}, {self.vector}* {self._element(pointer, place)}, align 8")

    def store(self, value: Value, pointer: str, place: int) -> None:
        """A vector into an array of them."""
        element = self._element(pointer, place)
        self.lines.append(f"  store {value.type} {value.text}, {self.vector}* {element}, align 8")

    def _element(self, pointer: str, place: int) -> str:
        return self._made("", f"getelementptr {self.vector}, {self.vector}* {pointer}, i64 {place}").text

    def function(self, name: str, inputs: Sequence[str], outputs: Sequence[str], linkage: str = "internal") -> str:
        """The lines as a function of pointers to lanes, by their names, that returns nothing."""
        arguments = [f"{self.vector}* {n}" for n in inputs] + [f"{self.vector}* noalias {n}" for n in outputs]
        head = f'define {linkage} void @"{name}"({", ".join(arguments)})'
        return "\n".join([head, "{", *self.lines, "  ret void", "}", ""])
