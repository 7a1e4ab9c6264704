"""A model's equations and their sensitivities as CasADi functions.

With states x, memories m, parameters p and their sensitivities S = dx/dp, R = dm/dp:

    rest     g(z; p) = 0,  dz/dp = -g_p / g_z,   x(0) = x0(z, p),  S(0) = x0_z dz/dp + x0_p
    sample   m+ = D(x, m, u, p),                 R+ = D_x S + D_m R + D_p
    rates    x' = f(x, m, u, p),                 S' = f_x S + f_m R + f_p      per time of the integration, see below
    output   y = h(x, m, p),                     dy/dp = h_x S + h_m R + h_p

Only the entries of S and R that can differ from zero are stored.

A delay of whole samples shifts the input (`shift`). A remainder f < dt makes the input jump within each sample, at f.
The J steps of a sample are stretched so that a step ends there: k of them fill [0, f] and J - k fill [f, dt], none
longer than dt / (J - 1). The stretch is part of the equations, so that the sensitivity to the delay is that of the
exact jump.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import casadi as ca

from fes_pin.models.compile.layout import Layout, Sizes
from fes_pin.models.maths import ceil, clip, where
from fes_pin.models.model import Model
from fes_pin.models.stage import Signals


@dataclass(frozen=True)
class Equations:
    """The functions of one model and kind of trial; see the module.

    Attributes
    ----------
    functions
        By name: rest, start, sample, rates and output; of a predictor also correct and follow.
    """

    layout: Layout
    functions: Mapping[str, ca.Function]

    @property
    def sizes(self) -> Sizes:
        """Lengths of the vectors of states, memories and readings, each with its sensitivities."""
        f = self.functions
        reading = f["correct"].numel_out(1) if "correct" in f else f["output"].numel_out(0)
        return Sizes(f["start"].numel_out(0), f["start"].numel_out(1), reading, f["rates"].numel_out(0))


class Symbols:
    """Symbols of one model, and the signals made of them."""

    def __init__(self, model: Model, layout: Layout, estimated: bool) -> None:
        self.model, self.layout = model, layout
        rig, kind = model.rig, layout.kind
        self.states = [*rig.states(kind), *(f"{e.name}.{n}" for e in model.effects for n in e.kept_of(e.states))]
        kept = (f"{e.name}.{n}" for e in model.effects for n in e.kept_of(e.memories))
        self.memories = [*rig.memories(kind), *kept]
        self.x, self.m = _symbols("x", self.states), _symbols("m", self.memories)
        self.p, self.c = _symbols("p", layout.values), _symbols("c", layout.constants)
        self.u, self.t, self.z = _symbols("u", layout.inputs), ca.SX.sym("t"), ca.SX.sym("z")
        self.since, self.into = ca.SX.sym("since"), ca.SX.sym("into")
        self.estimated, self.unsure = estimated, list[tuple[ca.SX, ca.SX]]()
        self.is_late = any(e.signal == "delay" for e in model.effects)
        self.slacks: dict[str, tuple[Any, Any]] = {}

    def signals(self, states: dict[str, Any], memories: dict[str, Any]) -> Signals:
        """Return signals and effects with symbols in place of numbers."""
        layout, p = self.layout, {**self.p, **dict(self.layout.fixed)}
        effects = []
        for e in self.model.effects:
            own: dict[str, Any] = {n: p[f"{e.name}.{n}"] for n in e.parameters()}
            effects.append(dataclasses.replace(e, **own))
        s = Signals(
            effects,
            kind=layout.kind,
            x=SimpleNamespace(**{n: v for n, v in states.items() if "." not in n}),
            m=SimpleNamespace(**{n: v for n, v in memories.items() if "." not in n}),
            u=SimpleNamespace(**self.u),
            c=SimpleNamespace(**self.c),
            initial=SimpleNamespace(**{n: p[n] for n in layout.unknowns if "." not in n}),
            time=self.t,
            step=self.c["step"],
            elapsed=0.0,
            pace=1.0,
            delayed=lambda now, before: now,
        )
        known = states | memories
        for e in self.model.effects:
            s.owned[e.name] = {n: known[f"{e.name}.{n}"] for n in e.kept_of((*e.states, *e.memories))}
        if self.is_late:
            s.step = s.c.dt / (s.c.dt / s.c.step - 1.0)
        return s

    def within_a_sample(self, s: Signals) -> Signals:
        """Return the signals at `into` after the start of the step that begins `since` after the sample."""
        if not self.is_late:
            s.elapsed = self.since + self.into
            s.time = s.time + s.elapsed
            return s
        steps = s.c.dt / s.c.step
        rest = s.through("delay", 0.0) - s.c.shift * s.c.dt
        before = clip(ceil(rest / s.c.dt * (steps - 1.0)), 1.0, steps - 1.0)
        jump = before * s.c.step
        early = self.since < jump - 0.5 * s.c.step
        first, second = rest / jump, (s.c.dt - rest) / (s.c.dt - jump)
        s.pace = where(early, first, second)
        begun = where(early, self.since * first, rest + (self.since - jump) * second)
        s.elapsed = begun + self.into * s.pace
        s.time = s.time + s.elapsed
        s.delayed = lambda now, past: where(early, past, now)
        return s

    def std_of(self, f: Any) -> Any:
        """Return a symbol for the standard deviation of an expression in estimated states."""
        self.unsure.append((ca.SX.sym(f"std{len(self.unsure)}"), f))
        return self.unsure[-1][0]

    def rig(self) -> Any:
        nominal: dict[str, Any] = {n: self.p[n] for n in self.layout.parameters if "." not in n}
        return dataclasses.replace(self.model.rig, **nominal)

    def at_rest(self) -> tuple[dict[str, Any], dict[str, Any], Any]:
        """Return states, memories and residual of the static equilibrium as expressions in z, without inputs."""
        rig, still = self.rig(), SimpleNamespace(**dict.fromkeys(self.u, 0.0))
        s = self.signals(dict.fromkeys(self.states, 0.0), dict.fromkeys(self.memories, 0.0))
        s.u = still
        rig.set_rest(s, self.z)
        states = dict.fromkeys(self.states, 0.0) | vars(s.x)
        memories = dict.fromkeys(self.memories, 0.0) | vars(s.m)
        for effect in s.effects:
            for n, value in effect.rest(s.of(effect)).items():
                (states if n in effect.states else memories)[f"{effect.name}.{n}"] = value
        s = self.signals(states, memories)
        s.time, s.u = 0.0, still
        rig.rates(s)
        return states, memories, rig.rest_residual(s, self.z)

    def running(self) -> tuple[list[Any], list[Any], list[Any]]:
        """Return next memories, rates of the states, and readings."""
        rig = self.rig()
        s = self.signals(self.x, self.m)
        after = rig.sample(s)
        memories = {n: after.get(n, self.m[n]) for n in self.memories}
        for effect in s.effects:
            for n, value in effect.update(s.of(effect)).items():
                memories[f"{effect.name}.{n}"] = value
            self.slacks |= {f"{effect.name}.{n}": pair for n, pair in effect.slack(s.of(effect)).items()}
        s = self.within_a_sample(self.signals(self.x, self.m))
        s.std = self.std_of if self.estimated else s.std
        rates = dict(rig.rates(s))
        for effect in s.effects:
            rates.update({f"{effect.name}.{n}": v for n, v in effect.rate(s.of(effect)).items()})
        rates = {n: s.pace * v for n, v in rates.items()} if self.is_late else rates
        readings = rig.readings(self.signals(self.x, self.m))
        return [memories[n] for n in self.memories], [rates[n] for n in self.states], list(readings)


class Tangents:
    """A model's expressions, and the propagation of sensitivities through them.

    Attributes
    ----------
    x, m, p, c, u, t, since, into, z
        Symbols of states, memories, parameters, constants, inputs, times and the unknown of the static equilibrium.
    x0, m0, after, rates, readings, g
        Initial states and memories, next memories, rates, readings, and the expression that is zero at rest.
    """

    def __init__(self, model: Model, layout: Layout, estimated: bool = False) -> None:
        self.layout, self.sym = layout, (sym := Symbols(model, layout, estimated))
        self.x, self.m, self.p, self.c, self.u = (column([*v.values()]) for v in (sym.x, sym.m, sym.p, sym.c, sym.u))
        self.t, self.since, self.into, self.z = sym.t, sym.since, sym.into, sym.z
        states, memories, residual = sym.at_rest()
        self.x0, self.m0 = column(list(states.values())), column(list(memories.values()))
        self.g = column([residual])
        self.after, self.rates, self.readings = (column(v) for v in sym.running())
        self._wanted = self.chosen(layout.columns)
        self.g_z = ca.jacobian(self.g, self.z)

    def chosen(self, names: tuple[str, ...]) -> Any:
        """Return the directions of some values in the space of all, shape (values, names)."""
        out = ca.DM(len(self.layout.values), len(names))
        for k, name in enumerate(names):
            out[self.layout.values.index(name), k] = 1.0
        return ca.sparsify(out)

    def through(self, f: Any, *inner: tuple[Any, Any], along: Any = None) -> Any:
        """Return sensitivities of an expression, from those of its variables."""
        total = ca.mtimes(ca.jacobian(f, self.p), self._wanted if along is None else along)
        for variable, sensitivity in inner:
            total = total + ca.mtimes(ca.jacobian(f, variable), sensitivity)
        return ca.sparsify(total)

    def at_start(self, f: Any, along: Any = None) -> Any:
        """Return sensitivities of initial values, with the change of the static equilibrium included."""
        return self.through(f, (self.z, -self.through(self.g, along=along) / self.g_z), along=along)

    def patterns(self, states: Any = None) -> tuple[Any, Any]:
        """Return the entries of the sensitivities of states and memories that can differ from zero.

        Parameters
        ----------
        states
            Those of the states, if known.
        """
        s_pattern = self.at_start(self.x0).sparsity() if states is None else states
        r_pattern = self.at_start(self.m0).sparsity()
        while True:
            s, r = ca.SX.sym("S", s_pattern), ca.SX.sym("R", r_pattern)
            wider_s = s_pattern.unite(self.through(self.rates, (self.x, s), (self.m, r)).sparsity())
            wider_r = r_pattern.unite(self.through(self.after, (self.x, s), (self.m, r)).sparsity())
            if wider_s.nnz() == s_pattern.nnz() and wider_r.nnz() == r_pattern.nnz():
                return s_pattern, r_pattern
            s_pattern, r_pattern = wider_s, wider_r


def derive(model: Model, layout: Layout) -> Equations:
    """Return a model's equations and sensitivities."""
    d = Tangents(model, layout)
    s_pattern, r_pattern = d.patterns()
    s, r = ca.SX.sym("S", s_pattern), ca.SX.sym("R", r_pattern)
    inner = ((d.x, s), (d.m, r))
    dy = ca.densify(d.through(d.readings, *inner))
    state = ca.vertcat(d.x, nonzeros(s, s_pattern))
    memory = ca.vertcat(d.m, nonzeros(r, r_pattern))
    y = ca.vertcat(d.readings, ca.vec(dy.T) if layout.columns else ca.SX(0, 1))
    x0 = ca.vertcat(d.x0, nonzeros(d.at_start(d.x0), s_pattern))
    m0 = ca.vertcat(d.m0, nonzeros(d.at_start(d.m0), r_pattern))
    after = ca.vertcat(d.after, nonzeros(d.through(d.after, *inner), r_pattern))
    rates = ca.vertcat(d.rates, nonzeros(d.through(d.rates, *inner), s_pattern))
    given = [d.u, d.t, d.p, d.c]
    return equations_of(
        d,
        start=([], [x0, m0]),
        sample=([state, memory, *given], [after]),
        rates=([state, memory, d.u, d.t, d.since, d.into, d.p, d.c], [rates]),
        output=([state, memory, *given], [y]),
    )


def equations_of(d: Tangents, **written: tuple[list[Any], list[Any]]) -> Equations:
    """Return functions of inputs and outputs, whose outputs are dense and share their common terms.

    The function of the static equilibrium is added; functions without inputs depend on its variables.
    """
    made = {}
    for name, (ins, outs) in {"rest": ([], [d.g, d.g_z]), **written}.items():
        made[name] = ca.Function(name, ins or [d.z, d.p, d.c], ca.cse([ca.densify(o) for o in outs]))
    return Equations(d.layout, made)


def _symbols(prefix: str, names: Any) -> dict[str, ca.SX]:
    return {n: ca.SX.sym(f"{prefix}_{n.replace('.', '_')}") for n in names}


def column(values: list[Any]) -> ca.SX:
    """Return expressions as a column."""
    return ca.vertcat(*[ca.SX(v) for v in values]) if values else ca.SX(0, 1)


def nonzeros(matrix: Any, pattern: ca.Sparsity) -> ca.SX:
    """Return the entries of `matrix` at `pattern`, as a column."""
    dense = ca.densify(matrix)
    rows, columns = pattern.get_triplet()
    entries = [dense[i, j] for i, j in zip(rows, columns, strict=True)]
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)
