"""One-step predictor of a model, an extended Kalman filter, and the sensitivities of its innovations.

Between samples x' = f(x, m, u, p) is integrated by Runge-Kutta steps of order four and length h. Sensitivities and
covariance are propagated with A = f_x and B = f_m R + f_p at the middle of each step, taken as constant over it:

    F = 1 + (h A / 2) (1 + (h A / 3) (1 + h A / 4)),   M = 1 + h F A
    S <- S + h F (A S + B)
    P <- M P M' + h (M G M' + G) / 2,                 G the intensities of the process noise

which is exact to the order of h^4 where f is linear and to that of h^2 where it is not.

f may depend on the standard deviation of an estimate, as dry friction does: sqrt(g_x N P N' g_x') of g(x), with P at
the beginning of a step and N = 1 + t A at the time t into the step, from the rows of A without such a deviation.

At a sample, for each measured output y_k in turn, with H = dh_k/dx at its prediction:

    r = y_k - h_k,   V = H P H' + n white_k^2,   K = P H' / V
    x <- x + K r,    P <- P - K V K',    dr/dp = -(H S + h_m R + h_p),   S <- S + K dr/dp

Sensitivities are computed at constant gains K: a parameter changes the gains' effect through past innovations alone,
which are white and independent of the predictions where the model is right (Ljung, System Identification, 2nd ed.,
section 7.4). A sample that was not measured corrects nothing. The same count n times in a row, as of an encoder at
rest, is one reading and not n, as its error is the same each time. So are n samples that hunt between two counts, which
only state that the position is near the edge of both. The initial covariance follows from the prior of a trial's
unknowns, which is that of their readings: P = X diag(prior / g)^2 X', with X the sensitivities of the first states to
them and g the slope of the reading. A scale of the reading is then not distinguished from an inertia that undoes it.

A memory that depends on states, as the play of a gear does, is as uncertain as they are. It is treated as a state that
changes at samples only, m+ = D(x, m). Where D is nonlinear within that uncertainty its derivative is not enough: mean,
slope and residual variance are those of finite differences as long as the uncertainty, see `_spread`. A memory that
follows with slack and is read is updated together with the first reading of a sample: see `compile.slack`.

Source: Jazwinski, Stochastic Processes and Filtering Theory, 1970, section 8.3; Kristensen, Madsen and Jorgensen,
Parameter estimation in stochastic grey-box models, Automatica 40 (2004).
"""

from collections.abc import Sequence
from typing import Any

import casadi as ca

from fes_pin.models.compile.equations import Equations, Tangents, column, equations_of, nonzeros
from fes_pin.models.compile.layout import Layout
from fes_pin.models.compile.slack import LEAST, Gaussian, Slack, read_across
from fes_pin.models.model import Model

REACH = 3.0**0.5
"""Half length of the differences, in standard deviations: right for a Gaussian's fourth moment (Norgaard et al.)."""


class _Uncertainty:
    """Covariance of the states as symbols, and the process noise that adds to it."""

    def __init__(self, d: "Carried", model: Model) -> None:
        self.d, self.count = d, d.x.numel()
        self.spread = self._diagonal(model, "intensities")
        self.lower = ca.SX.sym("P", ca.Sparsity.lower(self.count))
        self.covariance = ca.tril2symm(self.lower)

    def _diagonal(self, model: Model, method: str) -> Any:
        """What a method of effects gives for their states, as a diagonal matrix: of intensities, G."""
        out = ca.SX(self.count, 1)
        for e in model.effects:
            for state, value in getattr(e, method)(self.d.sym.c).items():
                out[self.d.sym.states.index(f"{e.name}.{state}")] = value
        return ca.diag(out)

    def widened(self, f: Any) -> Any:
        """Return rates with standard deviations in place of their symbols; states move at the rates without these."""
        d, unsure = self.d, self.d.sym.unsure
        if not unsure:
            return f
        symbols = ca.vertcat(*(symbol for symbol, _ in unsure))
        known = ca.DM([not ca.depends_on(f[k], symbols) for k in range(f.numel())])
        moved = ca.SX.eye(self.count) + d.into * ca.mtimes(ca.diag(known), ca.jacobian(f, d.x))
        for symbol, one in reversed(unsure):  # a later one may contain an earlier one
            slope = ca.mtimes(ca.jacobian(one, d.x), moved)
            variance = ca.mtimes([slope, self.covariance, slope.T])
            f = ca.substitute(f, symbol, ca.sqrt(ca.fmax(variance, 0.0) + LEAST))
        return f

    def at_start(self, model: Model) -> Any:
        """Return the covariance of the initial states."""
        d, layout, c = self.d, self.d.layout, self.d.sym.c
        unknowns = model.rig.unknowns(layout.kind)
        moved = ca.densify(d.at_start(d.x0, d.chosen(unknowns)))
        slopes = self._read_slopes(moved)
        priors = [(c[f"prior.{n}"] / g) ** 2 for n, g in zip(unknowns, slopes, strict=False)]
        out = ca.mtimes([moved, ca.diag(ca.vertcat(*priors)), moved.T]) if unknowns else ca.SX(self.count, self.count)
        out = out + self._diagonal(model, "stationary_variances")
        for k, variance in d.start_variances(*(self._moves(unknowns, fast) for fast in (False, True))):
            out[k, k] = out[k, k] + variance
        return out

    def _moves(self, unknowns: Sequence[str], fast: bool) -> Any:
        """Range or speed of a trial with an unknown initial state; 0 where it is known."""
        return next((self.d.sym.c[f"prior.{n}"] for n in unknowns if ("velocity" in n) == fast), 0.0)

    def _read_slopes(self, moved: Any) -> list[Any]:
        """Return the slope of the reading of each initial unknown: of its own reading, or else of the first output."""
        d, layout = self.d, self.d.layout
        none = [(v, ca.SX.zeros(v.numel())) for v in (d.u, d.t, d.since)]
        out = []
        for k in range(moved.shape[1]):
            own = k if k < len(layout.outputs) and layout.outputs[k] in layout.measured else 0
            slope = ca.mtimes(ca.jacobian(d.readings[own], d.x), moved[:, own])
            for symbol, value in [(d.x, d.x0), (d.m, d.m0), *none]:
                slope = ca.substitute(slope, symbol, value)
            size = ca.fabs(slope)
            out.append(ca.if_else(size > LEAST, size, 1.0))
        return out


class Carried(Tangents):
    """A model's expressions with the memories that depend on states treated as states.

    Attributes
    ----------
    carried
        Places of those memories among the states.
    followed
        Expression of each after a sample.
    slacks
        Places of those that follow with slack, with their targets and half the slack.
    """

    def __init__(self, model: Model, layout: Layout) -> None:
        super().__init__(model, layout, estimated=True)
        felt = ca.jacobian(self.after, self.x)
        places = [k for k in range(self.m.numel()) if felt[k, :].nnz()]
        others = [k for k in range(self.m.numel()) if k not in places]
        states = self.x.numel()
        self.carried = [states + k for k in range(len(places))]
        self.followed = [self.after[k] for k in places]
        self._names = [self.sym.memories[k] for k in places]
        named = zip(self.carried, self._names, strict=True)
        self.slacks = {k: self.sym.slacks[n] for k, n in named if n in self.sym.slacks}
        self.x = column([*ca.vertsplit(self.x), *(self.m[k] for k in places)])
        self.x0 = column([*ca.vertsplit(self.x0), *(self.m0[k] for k in places)])
        self.rates = column([*ca.vertsplit(self.rates), *[0.0] * len(places)])
        self.m, self.m0, self.after = (column([v[k] for k in others]) for v in (self.m, self.m0, self.after))

    def start_variances(self, reach: Any, speed: Any) -> list[tuple[int, Any]]:
        """Return places among the states, and the initial variance of the state or memory there."""
        effects = self.sym.signals(self.sym.x, self.sym.m).effects
        known = {f"{e.name}.{n}": variance for e in effects for n, variance in e.start_variances(reach, speed).items()}
        places = [*enumerate(self.sym.states), *zip(self.carried, self._names, strict=True)]
        return [(k, known[n]) for k, n in places if n in known]


def derive_predictor(model: Model, layout: Layout) -> Equations:
    """Return the equations of a model's predictor; see the module."""
    d = Carried(model, layout)
    uncertain = _Uncertainty(d, model)
    count, width = uncertain.count, len(layout.columns)
    whole = ca.Sparsity.dense(count, width)
    _, r_pattern = d.patterns(whole)
    s, r = ca.SX.sym("S", whole), ca.SX.sym("R", r_pattern)
    inner = ((d.x, s), (d.m, r))
    lower = ca.Sparsity.lower(count)
    state = ca.vertcat(d.x, nonzeros(s, whole), nonzeros(uncertain.lower, lower))
    memory = ca.vertcat(d.m, nonzeros(r, r_pattern))

    def packed(x: Any, sensitivities: Any, covariance: Any) -> Any:
        return ca.vertcat(x, nonzeros(sensitivities, whole), nonzeros(covariance, lower))

    held = ca.vertcat(ca.SX.sym("held", count), nonzeros(s, whole), nonzeros(uncertain.lower, lower))
    d.rates = uncertain.widened(d.rates)
    x0 = packed(d.x0, d.at_start(d.x0), uncertain.at_start(model))
    m0 = ca.vertcat(d.m0, nonzeros(d.at_start(d.m0), r_pattern))
    after = ca.vertcat(d.after, nonzeros(d.through(d.after, *inner), r_pattern))
    reached = ca.SX.sym("x1", count)
    given = [state, memory, d.u, d.t, d.p, d.c]
    during = [memory, d.u, d.t, d.since, d.into, d.p, d.c]
    return equations_of(
        d,
        start=([], [x0, m0]),
        sample=(given, [after]),
        rates=([d.x, held, *during], [d.rates]),
        output=(given, [d.readings]),
        correct=(given, _corrected(d, uncertain, s, inner, packed)),
        follow=([state, reached, *during], [packed(reached, *_followed(d, uncertain, s, r, reached))]),
    )


def _followed(d: Carried, uncertain: _Uncertainty, s: Any, r: Any, reached: Any) -> tuple[Any, Any]:
    """Return sensitivities and covariance after an integration step; see the module."""
    middle = 0.5 * (d.x + reached)
    slope, direct = (ca.substitute(e, d.x, middle) for e in (ca.jacobian(d.rates, d.x), d.through(d.rates, (d.m, r))))
    h, one = d.sym.c["step"], ca.SX.eye(uncertain.count)
    grown = one
    for k in (4.0, 3.0, 2.0):
        grown = one + h / k * ca.mtimes(slope, grown)
    through = one + h * ca.mtimes(grown, slope)
    moved = s + h * ca.mtimes(grown, ca.mtimes(slope, s) + direct)
    spread = 0.5 * h * (ca.mtimes([through, uncertain.spread, through.T]) + uncertain.spread)
    return moved, ca.mtimes([through, uncertain.covariance, through.T]) + spread


def _corrected(d: Carried, uncertain: _Uncertainty, s: Any, inner: tuple[Any, ...], packed: Any) -> list[Any]:
    """Return the state after the measurements of a sample; innovations, their variances and their sensitivities."""
    slack = _read_with_slack(d)
    now, covariance, moved = _remembered(d, uncertain.covariance, s, inner, slack)
    x, u, c = now, d.sym.u, d.sym.c
    read: list[tuple[Any, Any, Any]] = []
    for name in d.layout.measured:
        reading = d.readings[d.layout.outputs.index(name)]
        given = (u[f"measured.{name}"], u[f"repeated.{name}"] * c[f"white.{name}"] ** 2, u[f"seen.{name}"])
        known = Gaussian(x, covariance)
        if slack is not None and ca.depends_on(reading, d.x[slack]):
            one, x, covariance, moved = _across_slack(d, slack, reading, given, known, moved, inner)
            slack, now = None, x
        else:
            one, x, covariance, moved = _linear(d, now, reading, given, known, moved, inner)
        read.append(one)
    innovations, variances, slopes = ([one[k] for one in read] for k in range(3))
    dr = ca.vertcat(*slopes)
    y = ca.vertcat(column(innovations), column(variances), ca.vec(dr.T) if d.layout.columns else ca.SX(0, 1))
    return [packed(x, moved, covariance), y]


def _linear(
    d: Carried, now: Any, reading: Any, given: tuple[Any, Any, Any], known: Gaussian, moved: Any, inner: tuple[Any, ...]
) -> tuple[tuple[Any, Any, Any], Any, Any, Any]:
    """Return innovation, its variance and sensitivities; state, covariance and sensitivities, linear about `now`."""
    measured, noise, seen = given
    expressions = (reading, ca.jacobian(reading, d.x), d.through(reading, *inner[1:]))
    predicted, row, direct = (ca.substitute(one, d.x, now) for one in expressions)
    innovation = measured - (predicted + ca.mtimes(row, known.mean - now))
    left, gain, variance = known.seen(row, innovation, noise, seen)
    slope = ca.densify(-(direct + ca.mtimes(row, moved)))
    return (innovation, variance, slope), left.mean, left.covariance, moved + ca.mtimes(gain, slope)


def _read_with_slack(d: Carried) -> int | None:
    """Return the place of the first memory that follows with slack and is read; None if there is none."""
    read = [d.readings[d.layout.outputs.index(n)] for n in d.layout.measured]
    return next((k for k in d.slacks if any(ca.depends_on(one, d.x[k]) for one in read)), None)


def _across_slack(
    d: Carried, k: int, reading: Any, given: tuple[Any, Any, Any], known: Gaussian, moved: Any, inner: tuple[Any, ...]
) -> tuple[tuple[Any, Any, Any], Any, Any, Any]:
    """Return innovation, its variance and sensitivities; state, covariance and sensitivities; see `compile.slack`."""
    mean, (measured, noise, _) = ca.SX.sym("mean", d.x.numel()), given
    predicted, left = read_across(Slack(k, *d.slacks[k]), d.x, reading, given, Gaussian(mean, known.covariance))

    def through(f: Any) -> Any:
        return ca.substitute(d.through(f, *inner[1:]) + ca.mtimes(ca.jacobian(f, mean), moved), mean, known.mean)

    slope, turned = ca.densify(-through(predicted.mean)), through(left.mean)
    both = (predicted.mean, predicted.covariance, left.mean, left.covariance)
    value, spread, x, covariance = (ca.substitute(e, mean, known.mean) for e in both)
    return (measured - value, spread + noise, slope), x, covariance, turned


def _remembered(d: Carried, covariance: Any, s: Any, inner: tuple[Any, ...], but: int | None) -> tuple[Any, Any, Any]:
    """Return states, covariance and sensitivities after the memories among them, except one, are updated."""
    x, moved = d.x, s
    for k, after in zip(d.carried, d.followed, strict=True):
        if k == but:
            continue
        mean, slope, rest = _spread(after, d.x, covariance)
        turned = ca.SX.eye(d.x.numel())
        turned[k, :] = slope
        covariance = ca.mtimes([turned, covariance, turned.T])
        covariance[k, k] = covariance[k, k] + rest
        own = d.through(mean, (d.x, s), *inner[1:])
        x, moved = _with_row(x, k, mean), _with_row(moved, k, own)
    return x, covariance, moved


def _with_row(matrix: Any, k: int, row: Any) -> Any:
    return ca.vertcat(matrix[:k, :], row, matrix[k + 1 :, :])


def _spread(f: Any, x: Any, covariance: Any) -> tuple[Any, Any, Any]:
    """Return mean, slope and residual variance of f(x) for a Gaussian x, by finite differences of its width.

    With L L' = P of the variables that f depends on, h = REACH and f+-, the values at x +- h L_j,

        mean = f + sum (f+ + f- - 2 f) / (2 h^2),   slope' L_j = (f+ - f-) / (2 h),
        rest = sum (h^2 - 1) / (4 h^4) (f+ + f- - 2 f)^2

    which is exact where f is linear.

    Source: Norgaard, Poulsen and Ravn, New developments in state estimation for nonlinear systems, Automatica 36
    (2000).
    """
    at = ca.jacobian(f, x).sparsity().get_triplet()[1]
    root = _root([[covariance[i, j] for j in at] for i in at])
    mean, rest, along = f, ca.SX(0), []
    for j in range(len(at)):
        ahead, behind = (_moved(f, x, at, [sign * REACH * row[j] for row in root]) for sign in (1.0, -1.0))
        bend = ahead + behind - 2.0 * f
        mean, rest = mean + bend / (2.0 * REACH**2), rest + (REACH**2 - 1.0) / (4.0 * REACH**4) * bend**2
        along.append((ahead - behind) / (2.0 * REACH))
    slope = ca.SX(1, x.numel())
    for i in reversed(range(len(at))):
        known = sum((root[j][i] * slope[at[j]] for j in range(i + 1, len(at))), ca.SX(0))
        slope[at[i]] = (along[i] - known) / root[i][i]
    return mean, slope, rest


def _root(p: list[list[Any]]) -> list[list[Any]]:
    """Return the lower Cholesky factor of a small matrix of expressions, with `LEAST` added to its variances."""
    size = len(p)
    out = [[ca.SX(0)] * size for _ in range(size)]
    for i in range(size):
        for j in range(i):
            out[i][j] = (p[i][j] - sum((out[i][k] * out[j][k] for k in range(j)), ca.SX(0))) / out[j][j]
        out[i][i] = ca.sqrt(ca.fmax(p[i][i] - sum((v**2 for v in out[i][:i]), ca.SX(0)), 0.0) + LEAST)
    return out


def _moved(f: Any, x: Any, at: list[int], steps: list[Any]) -> Any:
    """Return f with some of its variables moved."""
    there = ca.SX(x)
    for i, step in zip(at, steps, strict=True):
        there[i] = there[i] + step
    return ca.substitute(f, x, there)
