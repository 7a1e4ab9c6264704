"""Programs as machine code: a whole trial, with sensitivities, several lanes at a time."""

import ctypes
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial

import casadi as ca
import numpy as np
from llvmlite import ir

from fes_pin.models.compile.equations import Equations
from fes_pin.models.compile.layout import REST_ITERATIONS, REST_STEP, Layout, Sizes
from fes_pin.models.compile.lower import Staged, lowered
from fes_pin.models.compile.machine import MachineCode, compile_object

LOOPED = ("sample", "correct", "output", "rates", "follow")
"""Functions that are called again and again."""
DOUBLE, INT64 = ir.DoubleType(), ir.IntType(64)


class NativeProgram:
    """Machine code of one model structure, kind of trial, set of sensitivity columns and number of lanes."""

    def __init__(self, layout: Layout, object_code: bytes) -> None:
        head, _, body = object_code.partition(b"\n")
        self.layout, self.sizes = layout, Sizes(**json.loads(head))
        self._code = MachineCode(body)
        pointer = ctypes.c_void_p
        self._run = self._code.function("simulate", ctypes.c_int64, ctypes.c_int64, *[pointer] * 6)

    def run(
        self, inputs: np.ndarray, values: np.ndarray, constants: np.ndarray, guess: np.ndarray, substeps: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Simulate all lanes; see `Program`."""
        width, n = self.layout.width, inputs.shape[0]
        out = np.empty((n, self.sizes.reading, width))
        given = [np.ascontiguousarray(a, dtype=float) for a in (inputs, values, constants)]
        rest, scratch = np.array(guess, dtype=float), np.zeros((self.sizes.scratch, width))
        memory = (*given, rest, out, scratch)  # a name for each: they must live until the machine code returns
        self._run(n, substeps, *[a.ctypes.data for a in memory])
        return self.layout.parted(out)


def compile_equations(equations: Equations) -> bytes:
    """Content of a `NativeProgram`: its sizes in one line, then object code."""
    text, sizes = emit(equations)
    return json.dumps(asdict(sizes)).encode() + b"\n" + compile_object(text)


def emit(equations: Equations) -> tuple[str, Sizes]:
    """LLVM assembly of a program, and its sizes: static equilibrium, then samples of Runge-Kutta steps."""
    made = {n: lowered(f, known=_known(n, f), width=equations.layout.width) for n, f in equations.functions.items()}
    sizes = replace(equations.sizes, kept=sum(one.kept for one in made.values()))
    declared = {name: line for one in made.values() for name, line in one.declared.items()}
    loop = _Loop(equations, made, sizes).module
    return "\n".join([str(loop), *declared.values(), *(one.text for one in made.values())]), sizes


def _known(name: str, function: ca.Function) -> list[set[int]]:
    """Inputs of a function that a run does not change; of rates, also those that an integration step does not."""
    if name not in LOOPED:
        return []
    last = function.n_in()
    once = {last - 2, last - 1}  # parameters and constants
    return [once, set(range(1, last)) - {last - 3}] if name == "rates" else [once]  # all but the states and `into`


class _Loop:
    """The time loop around a model's functions."""

    def __init__(self, equations: Equations, made: Mapping[str, Staged], sizes: Sizes) -> None:
        self.module, self.equations, self.made, self.sizes = ir.Module(name="fes_pin"), equations, made, sizes
        self.vector = ir.VectorType(DOUBLE, equations.layout.width)
        double, elsewhere = ir.PointerType(self.vector), ir.Module()  # the parts are text: here they are names
        self.parts = dict[str, ir.Function]()
        for n, f in equations.functions.items():
            for part in made[n].parts.values():
                read = f.n_in() + 1 + (f.n_out() if part == n else 0)
                kind = ir.FunctionType(ir.VoidType(), [double] * read)
                self.parts[part] = ir.Function(elsewhere, kind, part)
        function = ir.Function(self.module, ir.FunctionType(ir.VoidType(), [INT64, INT64] + [double] * 6), "simulate")
        self.n, self.substeps, self.u, self.p, self.c, self.z, self.y, scratch = function.args
        self.b = ir.IRBuilder(function.append_basic_block())
        self._carve(scratch)
        names = equations.layout.constants
        self.t0, self.dt, self.step = (self._load(self.c, names.index(n)) for n in ("t0", "dt", "step"))
        self._rest()
        self._samples()
        self.b.ret_void()

    def _carve(self, scratch: ir.Value) -> None:
        """Vectors in the scratch memory: stage states and rates, their sum, states and memories twice, what is kept."""
        state, memory = self.sizes.state + 1, self.sizes.memory + 1
        self.stage, self.rate, self.total, *both = (self._at(scratch, k * state) for k in range(5))
        self.memory, self.after = (self._at(scratch, 5 * state + k * memory) for k in range(2))
        self.kept, at = dict[str, ir.Value](), 5 * state + 2 * memory
        for name, one in self.made.items():
            self.kept[name], at = self._at(scratch, at), at + one.kept
        self._states = [self.b.alloca(both[0].type) for _ in both]
        for where, pointer in zip(self._states, both, strict=True):
            self.b.store(pointer, where)
        self.t = self.b.alloca(self.vector)
        self.since, self.into = self.b.alloca(self.vector), self.b.alloca(self.vector)
        self.g = self.b.alloca(self.vector, ir.Constant(INT64, 2))

    @property
    def state(self) -> ir.Value:
        """Return the pointer to the states."""
        return self.b.load(self._states[0])

    def _next_state(self, name: str, given: Sequence[ir.Value], *written: ir.Value) -> None:
        """Call what gives the next states first of all: they are where the states were before the last."""
        now, other = (self.b.load(one) for one in self._states)
        self._call(name, [now, *given], [other, *written])
        for where, pointer in zip(self._states, (other, now), strict=True):
            self.b.store(pointer, where)

    def _at(self, pointer: ir.Value, index: int | ir.Value) -> ir.Value:
        return self.b.gep(pointer, [ir.Constant(INT64, index) if isinstance(index, int) else index])

    def _load(self, pointer: ir.Value, index: int | ir.Value = 0) -> ir.Value:
        return self.b.load(self._at(pointer, index), align=8)

    def _store(self, value: ir.Value, pointer: ir.Value, index: int | ir.Value = 0) -> None:
        self.b.store(value, self._at(pointer, index), align=8)

    def _call(self, name: str, given: Sequence[ir.Value], written: Sequence[ir.Value]) -> None:
        """A function of the model, once what can be known before is."""
        self.b.call(self.parts[name], [*given, self.kept[name], *written])

    def _before(self, name: str, given: Sequence[ir.Value], stage: int) -> None:
        """Return the part of a function that an earlier stage can compute, if any."""
        part = self.made[name].parts.get(stage, name)
        if part != name:
            self.b.call(self.parts[part], [*given, self.kept[name]])

    def _count(self, end: ir.Value, body: Callable[[ir.Value], None]) -> None:
        """for k in range(end): body(k)."""
        b = self.b
        before, loop, done = b.block, b.append_basic_block(), b.append_basic_block()
        b.cbranch(b.icmp_signed(">", end, ir.Constant(INT64, 0)), loop, done)
        b.position_at_end(loop)
        k = b.phi(INT64)
        k.add_incoming(ir.Constant(INT64, 0), before)
        body(k)
        following = b.add(k, ir.Constant(INT64, 1))
        k.add_incoming(following, b.block)
        b.cbranch(b.icmp_signed("<", following, end), loop, done)
        b.position_at_end(done)

    def _number(self, k: ir.Value) -> ir.Value:
        """An integer as lanes of doubles."""
        nothing, first = ir.Constant(self.vector, ir.Undefined), ir.Constant(ir.IntType(32), 0)
        one = self.b.insert_element(nothing, self.b.sitofp(k, DOUBLE), first)
        mask = ir.Constant(ir.VectorType(ir.IntType(32), self.vector.count), [0] * self.vector.count)
        return self.b.shuffle_vector(one, one, mask)

    def _rest(self) -> None:
        b = self.b

        def newton(_: ir.Value) -> None:
            self._call("rest", [self.z, self.p, self.c], [self.g, self._at(self.g, 1)])
            step = b.fdiv(self._load(self.g), self._load(self.g, 1))
            for beyond, most in ((">", self._splat(REST_STEP)), ("<", self._splat(-REST_STEP))):
                step = b.select(b.fcmp_ordered(beyond, step, most), most, step)
            self._store(b.fsub(self._load(self.z), step), self.z)

        self._count(ir.Constant(INT64, REST_ITERATIONS), newton)
        self._call("start", [self.z, self.p, self.c], [self.state, self.memory])
        for name in LOOPED:
            if name in self.made:
                known = [self.p, self.c]
                self._before(name, [self.state] * (self.equations.functions[name].n_in() - len(known)) + known, 0)

    def _samples(self) -> None:
        b, inputs = self.b, len(self.equations.layout.inputs)

        def sample(n: ir.Value) -> None:
            t = b.fadd(self.t0, b.fmul(self._number(n), self.dt))
            b.store(t, self.t, align=8)
            u = self._at(self.u, b.mul(n, ir.Constant(INT64, inputs)))
            y = self._at(self.y, b.mul(n, ir.Constant(INT64, self.sizes.reading)))
            self._call("sample", [self.state, self.memory, u, self.t, self.p, self.c], [self.after])
            size = ir.Constant(INT64, self.sizes.memory)
            self._count(size, lambda i: self._store(self._load(self.after, i), self.memory, i))
            given = [self.memory, u, self.t, self.p, self.c]
            if "correct" in self.made:
                self._next_state("correct", given, y)
            else:
                self._call("output", [self.state, *given], [y])
            self._count(self.substeps, lambda j: self._step(j, u))

        self._count(self.n, sample)

    def _step(self, j: ir.Value, u: ir.Value) -> None:
        """From one integration step to the next."""
        b = self.b
        b.store(b.fmul(self._number(j), self.step), self.since, align=8)
        if "follow" not in self.made:
            self._runge_kutta(u, self.state)
            return
        self._runge_kutta(u, self.total)
        b.store(b.fmul(self.step, self._splat(0.5)), self.into, align=8)
        times = [self.t, self.since, self.into]
        self._next_state("follow", [self.total, self.memory, u, *times, self.p, self.c])

    def _runge_kutta(self, u: ir.Value, end: ir.Value) -> None:
        """One step of the classical Runge-Kutta method of order four, from the state to `end`."""
        b = self.b
        size = ir.Constant(INT64, self.sizes.integrated)
        times = [self.t, self.since, self.into]
        begun = [self.state] if "follow" in self.made else []
        fixed = [*begun, self.memory, u, *times, self.p, self.c]
        self._before("rates", [self.state, *fixed], 1)
        for weight, ahead, at, source in (
            (1 / 6, 0.5, 0.0, self.state),
            (1 / 3, 0.5, 0.5, self.stage),
            (1 / 3, 1.0, 0.5, self.stage),
            (1 / 6, 0.0, 1.0, self.stage),
        ):
            b.store(b.fmul(self.step, self._splat(at)), self.into, align=8)
            self._call("rates", [source, *fixed], [self.rate])
            share, forward = b.fmul(self.step, self._splat(weight)), b.fmul(self.step, self._splat(ahead))
            self._count(size, partial(self._advance, at=at, share=share, forward=forward, end=end))

    def _advance(self, i: ir.Value, at: float, share: ir.Value, forward: ir.Value, end: ir.Value) -> None:
        """Add a stage to the sum, and go to the next stage or, after the last, to the next step."""
        b = self.b
        rate, state = self._load(self.rate, i), self._load(self.state, i)
        total = state if at == 0.0 else self._load(self.total, i)
        total = b.fadd(total, b.fmul(share, rate))
        if at == 1.0:
            self._store(total, end, i)
            return
        self._store(total, self.total, i)
        self._store(b.fadd(state, b.fmul(forward, rate)), self.stage, i)

    def _splat(self, value: float) -> ir.Constant:
        """Return the same number in every lane."""
        return ir.Constant(self.vector, [value] * self.vector.count)
