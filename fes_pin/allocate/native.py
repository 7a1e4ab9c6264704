"""Plain Python functions over numbers and flat arrays, lowered to machine code through llvmlite.

The functions stay ordinary Python: they run interpreted too, slowly, which is how the tests check the machine code.
What may be used: `for ... in range`, `while`, `if`, `break`, `return` of an integer, assignment, arithmetic,
comparisons, `and`, `or`, `not` (both sides are evaluated), `x if c else y` (likewise), `abs`, `float`, flat indexing
`a[i]`, calls of functions lowered before, and `a[k:]` as their argument. Parameters are annotated `int`, `float`,
`Reals` or `Integers`; a local takes the type of its first assignment. Arrays must not overlap. Anything else is
refused.
"""

from __future__ import annotations

import ast
import ctypes
import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from fes_pin import settings

Reals = np.ndarray
"""A flat array of doubles."""
Integers = np.ndarray
"""A flat array of 64-bit integers."""
CTYPES = {"int": ctypes.c_int64, "float": ctypes.c_double, "Reals": ctypes.c_void_p, "Integers": ctypes.c_void_p}


class _Lowering(ast.NodeVisitor):
    """One function's syntax tree into one LLVM function."""

    def __init__(self, module, source: ast.FunctionDef, known: dict) -> None:
        from llvmlite import ir

        self.ir, self.known = ir, known
        self.integer, self.real = ir.IntType(64), ir.DoubleType()
        self.kinds = {a.arg: a.annotation.id for a in source.args.args}  # type: ignore[union-attr]
        scalar, element = {"int": self.integer, "float": self.real}, {"Integers": self.integer, "Reals": self.real}
        signature = [scalar.get(kind, ir.PointerType()) for kind in self.kinds.values()]
        self.function = ir.Function(module, ir.FunctionType(self.integer, signature), source.name)
        self.builder = ir.IRBuilder(self.function.append_basic_block())
        self.slots: dict = {}
        self.arrays: dict = {}
        self.exits: list = []
        for (name, kind), value in zip(self.kinds.items(), self.function.args, strict=True):
            if kind in element:
                value.add_attribute("noalias")
                self.arrays[name] = (value, element[kind])
            else:
                self.store(name, value)
        for statement in source.body:
            self.visit(statement)
        if not self.builder.block.is_terminated:
            self.builder.ret(self.integer(0))

    def store(self, name: str, value) -> None:
        if name not in self.slots:
            with self.builder.goto_entry_block():
                self.slots[name] = (self.builder.alloca(value.type), value.type)
        slot, kind = self.slots[name]
        self.builder.store(self.cast(value, kind), slot)

    def cast(self, value, kind):
        if value.type == kind:
            return value
        if kind == self.real:
            return self.builder.sitofp(value, kind)
        raise TypeError(f"cannot turn {value.type} into {kind}")

    def truth(self, node):
        value = self.visit(node)
        return value if value.type == self.ir.IntType(1) else self.builder.icmp_signed("!=", value, value.type(0))

    def place(self, node: ast.Subscript):
        array, kind = self.arrays[node.value.id]  # type: ignore[attr-defined]
        index: Any = node.slice.lower if isinstance(node.slice, ast.Slice) else node.slice
        return self.builder.gep(array, [self.visit(index)], source_etype=kind), kind

    def generic_visit(self, node):
        raise NotImplementedError(f"{type(node).__name__} cannot be lowered")

    def visit_Pass(self, node):
        return None

    def visit_Name(self, node):
        slot, kind = self.slots[node.id]
        return self.builder.load(slot, typ=kind)

    def visit_Constant(self, node):
        if isinstance(node.value, bool):
            return self.ir.IntType(1)(int(node.value))
        return self.integer(node.value) if isinstance(node.value, int) else self.real(node.value)

    def visit_Subscript(self, node):
        pointer, kind = self.place(node)
        return self.builder.load(pointer, typ=kind)

    def visit_UnaryOp(self, node):
        if isinstance(node.op, ast.Not):
            return self.builder.not_(self.truth(node.operand))
        value = self.visit(node.operand)
        return self.builder.fneg(value) if value.type == self.real else self.builder.neg(value)

    def operate(self, operator, left, right):
        b = self.builder
        if left.type == self.integer and right.type == self.integer and not isinstance(operator, ast.Div):
            return {ast.Add: b.add, ast.Sub: b.sub, ast.Mult: b.mul, ast.FloorDiv: b.sdiv, ast.Mod: b.srem}[
                type(operator)
            ](left, right)
        left, right = self.cast(left, self.real), self.cast(right, self.real)
        make = {ast.Add: b.fadd, ast.Sub: b.fsub, ast.Mult: b.fmul, ast.Div: b.fdiv}[type(operator)]
        return make(left, right, flags=("contract",))

    def visit_BinOp(self, node):
        return self.operate(node.op, self.visit(node.left), self.visit(node.right))

    def visit_Compare(self, node):
        sign = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}[
            type(node.ops[0])
        ]
        left, right = self.visit(node.left), self.visit(node.comparators[0])
        if left.type == self.integer and right.type == self.integer:
            return self.builder.icmp_signed(sign, left, right)
        compare = self.builder.fcmp_unordered if sign == "!=" else self.builder.fcmp_ordered
        return compare(sign, self.cast(left, self.real), self.cast(right, self.real))

    def visit_BoolOp(self, node):
        join = self.builder.and_ if isinstance(node.op, ast.And) else self.builder.or_
        value = self.truth(node.values[0])
        for other in node.values[1:]:
            value = join(value, self.truth(other))
        return value

    def visit_IfExp(self, node):
        left, right = self.visit(node.body), self.visit(node.orelse)
        if left.type != right.type:
            left, right = self.cast(left, self.real), self.cast(right, self.real)
        return self.builder.select(self.truth(node.test), left, right)

    def visit_Call(self, node):
        if node.func.id == "abs":
            value = self.visit(node.args[0])
            return self.builder.select(
                self.builder.fcmp_ordered("<", value, self.real(0.0)), self.builder.fneg(value), value
            )
        if node.func.id == "float":
            return self.cast(self.visit(node.args[0]), self.real)
        function = self.known[node.func.id]
        values = [self.argument(a, p.type) for a, p in zip(node.args, function.args, strict=True)]
        return self.builder.call(function, values)

    def argument(self, node, kind):
        if isinstance(node, ast.Name) and node.id in self.arrays:
            return self.arrays[node.id][0]
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Slice):
            return self.place(node)[0]
        return self.cast(self.visit(node), kind)

    def assign(self, target, value) -> None:
        if isinstance(target, ast.Name):
            self.store(target.id, value)
        else:
            pointer, kind = self.place(target)
            self.builder.store(self.cast(value, kind), pointer)

    def visit_Assign(self, node):
        value = self.visit(node.value)
        for target in node.targets:
            self.assign(target, value)

    def visit_AugAssign(self, node):
        self.assign(node.target, self.operate(node.op, self.visit(node.target), self.visit(node.value)))

    def visit_Expr(self, node):
        self.visit(node.value) if not isinstance(node.value, ast.Constant) else None

    def visit_Return(self, node):
        self.builder.ret(self.visit(node.value))

    def visit_Break(self, node):
        self.builder.branch(self.exits[-1])

    def visit_If(self, node):
        then, other, after = (self.function.append_basic_block() for _ in range(3))
        self.builder.cbranch(self.truth(node.test), then, other)
        for block, body in ((then, node.body), (other, node.orelse)):
            self.builder.position_at_end(block)
            self.run(body, after)
        self.builder.position_at_end(after)

    def run(self, body, after) -> None:
        for statement in body:
            self.visit(statement)
        if not self.builder.block.is_terminated:
            self.builder.branch(after)

    def loop(self, test: Callable, body, step: Callable) -> None:
        head, inside, tail, after = (self.function.append_basic_block() for _ in range(4))
        self.exits.append(after)
        self.builder.branch(head)
        self.builder.position_at_end(head)
        self.builder.cbranch(test(), inside, after)
        self.builder.position_at_end(inside)
        self.run(body, tail)
        self.builder.position_at_end(tail)
        step()
        self.builder.branch(head)
        self.builder.position_at_end(after)
        self.exits.pop()

    def visit_While(self, node):
        self.loop(lambda: self.truth(node.test), node.body, lambda: None)

    def visit_For(self, node):
        limits = [self.visit(a) for a in node.iter.args]
        first, last = limits if len(limits) == 2 else (self.integer(0), limits[0])
        name = node.target.id
        self.store(name, first)
        self.loop(
            lambda: self.builder.icmp_signed("<", self.visit(ast.Name(name)), last),
            node.body,
            lambda: self.store(name, self.builder.add(self.visit(ast.Name(name)), self.integer(1))),
        )


class Native:
    """Functions compiled together, by name; each takes numbers and the addresses of arrays and gives back an integer.

    Parameters
    ----------
    functions
        In the order in which they call each other.
    """

    def __init__(self, *functions: Callable) -> None:
        import llvmlite.binding as llvm
        from llvmlite import ir

        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        module = ir.Module("fes_pin")
        known: dict = {}
        kinds: dict = {}
        for function in functions:
            source = ast.parse(inspect.getsource(function)).body[0]
            assert isinstance(source, ast.FunctionDef)
            lowered = _Lowering(module, source, known)
            known[source.name] = lowered.function
            kinds[source.name] = [CTYPES[kind] for kind in lowered.kinds.values()]
        name, features = settings.target()
        machine = llvm.Target.from_default_triple().create_target_machine(cpu=name, features=features, opt=3)
        parsed = llvm.parse_assembly(str(module))
        parsed.verify()
        options = llvm.create_pipeline_tuning_options(speed_level=3)
        options.loop_vectorization = True
        builder = llvm.create_pass_builder(machine, options)
        builder.getModulePassManager().run(parsed, builder)
        self._engine = llvm.create_mcjit_compiler(parsed, machine)
        self._engine.finalize_object()
        self._calls = {
            name: ctypes.CFUNCTYPE(ctypes.c_int64, *types)(self._engine.get_function_address(name))
            for name, types in kinds.items()
        }

    def __getitem__(self, name: str) -> Callable[..., int]:
        return self._calls[name]


def address(array: np.ndarray) -> int:
    """Address of a contiguous array, to hand to a compiled function; keep the array alive."""
    if not array.flags.c_contiguous:
        raise ValueError("the array is not contiguous")
    return array.ctypes.data
