"""The likelihood of measured trials under a model, a random effort and reading noise; its maximum.

Twice the negative log-likelihood of the innovations r_k of an extended Kalman filter with variances V_k,

    cost = sum r_k^2 / V_k + log V_k,

depends on the model's parameters and on what is random (`Doubt`) alone. Parameters move by Gauss-Newton steps with the
filter's gains as they are (`identify.descent`), what is random by Fisher scoring on logarithms with differences:

    g_i = sum r r_i / V + (1 - r^2 / V) V_i / (2 V),    I_ij = sum r_i r_j / V + V_i V_j / (2 V^2),

r_i and V_i the derivatives. Both go on by turns until neither gains. Where steps by slopes for gains as they are still
promise what none of them keeps, slopes are then differences of the cost, in which gains go with the parameters: the two
are one only where a model is right, and it is the first that lead there from afar. A parameter that scales a reading
always has a slope of the second kind. What is random begins small: begun large it takes all that the model gets
wrong.

Source: Kristensen, Madsen and Jorgensen, Parameter estimation in stochastic grey-box models, Automatica 40 (2004).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.identify.covariance import widened
from fes_pin.identify.doubts import doubt_limits, first_doubt
from fes_pin.identify.fit import Fit, fit_problem
from fes_pin.identify.noise import Noise
from fes_pin.identify.problem import TOLERANCE, Linearized, Unknowns, limits_of, whitened_sse
from fes_pin.models.compile.layout import WIDTH
from fes_pin.models.model import Model
from fes_pin.models.predictor import Doubt, ForetoldTrial, Predictor
from fes_pin.workers import in_parallel

ROUNDS = 12
"""Turns of parameters and randomness, at most."""
PIECES = 40
"""Pieces of the data by whose scores a model's errors of form show: as many as tell a deviation within a tenth, and so
as long as they can be."""
LITTLE = 0.1
"""Fall of twice the log-likelihood with which turns end: a third of a standard deviation of one parameter."""
WORTH = 1.0
"""Change of twice the log-likelihood that is worth more work, as where it is promised and no step keeps it: a standard
deviation of one parameter."""
LOG_STEPS = (1e-3, 0.03)
"""Steps of the differences in logarithms: the second where the first promises what no step keeps, as where the cost is
rough: that of a play jumps where an estimate crosses its slack."""
FOLLOWED_STEP = 0.01
"""Step of a difference of the cost by a parameter of the reading, in its standard deviations."""
LONGEST_MOVE = 1.5
"""Longest step of a logarithm: randomness changes by a factor of 4.5 at most before parameters move again."""


@dataclass(frozen=True)
class _Told:
    """Innovations that were seen, of all trials end to end, with their variances; and their cost."""

    cost: float
    innovations: np.ndarray
    variances: np.ndarray


class LikelihoodProblem:
    """A model structure on trials under what is random about them; a `Problem` to `Descent`.

    Parameters
    ----------
    model
        Its structure; values are given to the methods.
    trials
        What was measured; NaN where nothing was.
    doubt
        What is random.
    free
        The parameters that move; the model's fitted ones by default.
    starts
        Trials whose first samples say where each begins, where those of `trials` are not all measured.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        doubt: Doubt,
        free: tuple[str, ...] | None = None,
        starts: Sequence[Trial] | None = None,
    ) -> None:
        self.model, self.trials, self.doubt = model, tuple(trials), doubt
        self.free = model.fitted_parameters() if free is None else free
        self.limits = limits_of(model, self.trials)
        self.unknown_names = model.own_unknowns()
        self.begins = [model.rig.initial_unknowns(t) for t in starts or self.trials]
        self.priors = [first_doubt(model, t) for t in starts or self.trials]
        self.is_sharp = False
        self._missed: np.ndarray | None = None
        self._predictor: Predictor | None = None
        self._abreast: Predictor | None = None

    @property
    def noise(self) -> dict[str, Noise]:
        """The white noise of the readings, by column."""
        return {n: Noise(std, (), std) for n, std in self.doubt.white.items()}

    @property
    def predictor(self) -> Predictor:
        """The compiled predictor, with sensitivities to `free` and to the effects' unknowns."""
        if self._predictor is None:
            columns = (*self.free, *self.unknown_names)
            self._predictor = Predictor(self.model, self.trials, columns, self.doubt.processes, self.priors)
        return self._predictor

    def start_unknowns(self) -> Unknowns:
        """What effects have of each trial's own, as known before: at their nulls."""
        return [self.model.own_nulls() for _ in self.trials]

    def completed(self, unknowns: Unknowns) -> Unknowns:
        """Unknowns of another model on these trials with what this one has besides, without what it has not."""
        both = zip(self.start_unknowns(), unknowns, strict=True)
        return [{n: known.get(n, value) for n, value in start.items()} for start, known in both]

    def innovations(
        self, values: Mapping[str, float], unknowns: Unknowns, doubt: Doubt | None = None
    ) -> list[ForetoldTrial]:
        """Every trial as foretold, with sensitivities to `free` and to the effects' unknowns."""
        own = [{**begin, **u} for begin, u in zip(self.begins, unknowns, strict=True)]
        with np.errstate(all="ignore"):
            return self.predictor.run(values, doubt or self.doubt, own)

    def told(self, values: Mapping[str, float], unknowns: Unknowns, doubts: Sequence[Doubt]) -> list[_Told]:
        """Every trial as foretold by each of several doubts."""
        return self._told([(values, unknowns, d) for d in doubts])

    def bounds(self, points: Sequence[tuple[Mapping[str, float], Unknowns]]) -> list[float]:
        """The cost at several parameter values, without sensitivities: less work than linearizing at one of them."""
        return [one.cost for one in self._told([(*point, self.doubt) for point in points])]

    def _told(self, points: Sequence[tuple[Mapping[str, float], Unknowns, Doubt]]) -> list[_Told]:
        """Every trial as foretold by each of several points, as many side by side as leave no lane idle."""
        count, trials = self.abreast, len(self.trials)
        if self._abreast is None:
            self._abreast = Predictor(self.model, self.trials * count, (), self.doubt.processes, self.priors * count)
        predictor = self._abreast

        def abreast(some: Sequence[tuple[Mapping[str, float], Unknowns, Doubt]]) -> list[_Told]:
            filled = [*some, *[some[-1]] * (count - len(some))]
            values, doubts = ([one[j] for one in filled for _ in range(trials)] for j in (0, 2))
            own = [{**begin, **u} for one in filled for begin, u in zip(self.begins, one[1], strict=True)]
            with np.errstate(all="ignore"):
                run = predictor.run(values, doubts, own)  # type: ignore[arg-type]
            return [_joined(run[j * trials : (j + 1) * trials]) for j in range(len(some))]

        told = in_parallel(abreast, [points[k : k + count] for k in range(0, len(points), count)])
        return [one for some in told for one in some]

    @property
    def abreast(self) -> int:
        """How many points are tried in one run."""
        return max(1, WIDTH // len(self.trials))

    def foretold(self, values: Mapping[str, float]) -> list[dict[str, np.ndarray]]:
        """What is foretold of each output of each trial, shape (n,), also where nothing was measured."""
        own = [{**begin, **u} for begin, u in zip(self.begins, self.start_unknowns(), strict=True)]
        with np.errstate(all="ignore"):
            return self.predictor.foretell(values, self.doubt, own)

    def linearize(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Innovations over their deviations, and sensitivities, at a parameter value."""
        parts = [self._whitened(one) for one in self.innovations(values, unknowns)]
        return self._followed(parts, values, unknowns) if self.followed else parts

    def sharpen(self) -> bool:
        """Let the slopes of all parameters be differences of the cost; False where they are, or effort itself is read.

        There a lag would take up how smooth a random effort is, which no process of first order is.
        """
        if self.is_sharp or not all(self.model.rig.unknowns(t.kind) for t in self.trials):
            return False
        self.is_sharp = True
        return True

    @property
    def least_promise(self) -> float:
        """What a step must promise to be tried once a longer one failed: slopes for gains as they are promise more."""
        return TOLERANCE if self.is_sharp else WORTH

    def score(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Improve what is random, in place; returns by how much that lowers the cost."""
        self._missed = None
        return score_doubt(self, values, unknowns)

    @property
    def followed(self) -> tuple[str, ...]:
        """Free parameters whose slopes are differences of the cost."""
        return self.free if self.is_sharp else self._scales

    @cached_property
    def _scales(self) -> tuple[str, ...]:
        """Free parameters that scale a reading: the filter's gains go with them."""
        imposed = any(t.kind == IMPOSED for t in self.trials)
        read = ("reading", "effort") if imposed else ("reading",)
        names = [f"{e.name}.{n}" for e in self.model.effects if e.scales and e.signal in read for n in e.amplitudes()]
        return tuple(n for n in names if n in self.free)

    def _followed(self, parts: list[Linearized], values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Sensitivities to `followed` without what gains that stay as they are add along the innovations.

        Where a filter takes up nearly all of what it reads, a scale of the reading seems to shrink the innovations as a
        whole, as long as the gains do not go with it. The true slope of the cost is its difference. Of a sharp problem
        what is missed is taken once a turn: it bends little.
        """
        at, squares = [self.free.index(n) for n in self.followed], sum(float(p.residual @ p.residual) for p in parts)
        if self._missed is None or not self.is_sharp:
            self._missed = self._missed_slopes(parts, at, values, unknowns)
        if not (np.isfinite(squares) and squares > 0.0):
            return parts
        return [_added(p, at, self._missed / squares) for p in parts]

    def _missed_slopes(
        self, parts: Sequence[Linearized], at: Sequence[int], values: Mapping[str, float], unknowns: Unknowns
    ) -> np.ndarray:
        """What slopes for gains as they are miss of those of half the cost, by parameter; 0 where that is no number."""
        now, out = whitened_sse(parts), np.zeros(len(at))
        sizes = np.sqrt(sum(np.sum(p.jacobian[:, at] ** 2, axis=0) for p in parts))
        felt = np.flatnonzero(sizes) if np.isfinite(now) else np.empty(0, dtype=int)
        names, steps = [self.followed[k] for k in felt], FOLLOWED_STEP / sizes[felt]
        moved = [{**values, n: values[n] + float(h)} for n, h in zip(names, steps, strict=True)]
        slopes = 0.5 * (np.array(self.bounds([(m, unknowns) for m in moved])) - now) / steps
        out[felt] = -slopes - sum(p.residual @ p.jacobian[:, at] for p in parts)[felt]
        return np.nan_to_num(out)

    def _whitened(self, one: ForetoldTrial) -> Linearized:
        """A trial's innovations over their deviations; its sensitivities are scaled where they are."""
        with np.errstate(all="ignore"):
            scale = 1.0 / np.sqrt(one.of_seen(one.variances))
            residual = one.of_seen(one.values) * scale
            moved = one.of_seen(one.sensitivities)
            moved *= -scale[:, None]
            logs = -2.0 * float(np.sum(np.log(scale)))
        split = len(self.free)
        return Linearized(residual, moved[:, :split], moved[:, split:], logs)

    def cost(self, values: Mapping[str, float], unknowns: Unknowns, doubt: Doubt | None = None) -> float:
        """Twice the negative log-likelihood."""
        return sum(one.cost() for one in self.innovations(values, unknowns, doubt))


def _added(part: Linearized, at: Sequence[int], factors: np.ndarray) -> Linearized:
    """Some columns of the sensitivities with multiples of the residual added."""
    jacobian = part.jacobian.copy()
    jacobian[:, at] += np.outer(part.residual, factors)
    return replace(part, jacobian=jacobian)


def _joined(run: Sequence[ForetoldTrial]) -> _Told:
    return _Told(
        float(sum(one.cost() for one in run)),
        np.concatenate([one.values[one.seen] for one in run]),
        np.concatenate([one.variances[one.seen] for one in run]),
    )


def score_doubt(problem: LikelihoodProblem, values: Mapping[str, float], unknowns: Unknowns, steps: int = 2) -> float:
    """Improve what is random about a problem by Fisher scoring, in place; returns by how much that lowers the cost.

    Where no step promises `LITTLE` it stays.
    """
    limits = doubt_limits(problem.model, problem.trials)
    names = tuple(problem.doubt.values())
    low, high = (np.log([limits[n][k] for n in names]) for k in (0, 1))
    z = np.clip(np.log([problem.doubt.values()[n] for n in names]), low, high)

    def at(z: np.ndarray) -> Doubt:
        return problem.doubt.with_values(dict(zip(names, (float(v) for v in np.exp(z)), strict=True)))

    def at_all(many: np.ndarray) -> list[_Told]:
        return problem.told(values, unknowns, [at(z) for z in many])

    now, *moved = at_all(z + LOG_STEPS[0] * np.eye(1 + len(z), len(z), -1))
    damping, widths, begin = 1e-3, list(LOG_STEPS), now.cost
    while math.isfinite(now.cost):
        gradient, information = _scored(now, moved, widths[0])
        held = ((z <= low) & (gradient > 0)) | ((z >= high) & (gradient < 0))
        dampings = damping * 10.0 ** np.arange(1 + len(z))
        moves = [_damped_step(information, gradient, ~held, d) for d in dampings]
        if float(gradient @ moves[0]) < LITTLE:
            break
        found = _first_below(now, np.clip(z - np.array(moves), low, high), at_all, problem.abreast)
        if found is None:
            if 2.0 * float(gradient @ moves[0]) < WORTH or len(widths) == 1:
                break
            widths.pop(0)
        else:
            k, end, after = found
            gained, steps = now.cost - after.cost, steps - 1
            z, now, damping = end, after, max(0.3 * float(dampings[k]), 1e-6)
            if gained < LITTLE or not steps:
                break
        moved = at_all(z + widths[0] * np.eye(len(z)))
    problem.doubt = at(z)
    return begin - now.cost if math.isfinite(begin) else 0.0


def _first_below(
    now: _Told, ends: np.ndarray, at_all: Callable[[np.ndarray], list[_Told]], abreast: int
) -> tuple[int, np.ndarray, _Told] | None:
    """The lowest of the first points in a run that has one below: its place, itself, and what it tells."""
    for k in range(0, len(ends), abreast):
        after = at_all(ends[k : k + abreast])
        best = int(np.argmin([one.cost for one in after]))
        if after[best].cost < now.cost:
            return k + best, ends[k + best], after[best]
    return None


def _scored(now: _Told, moved: Sequence[_Told], width: float) -> tuple[np.ndarray, np.ndarray]:
    """Gradient and expected information of half the cost, of logarithms, from differences; see the module."""
    r, v = now.innovations, now.variances
    dr = np.stack([(m.innovations - r) / width for m in moved], axis=1)
    dv = np.stack([(m.variances - v) / width for m in moved], axis=1) / v[:, None]
    gradient = (r / v) @ dr + 0.5 * (1.0 - r * r / v) @ dv
    return gradient, (dr / v[:, None]).T @ dr + 0.5 * dv.T @ dv


def _damped_step(information: np.ndarray, gradient: np.ndarray, free: np.ndarray, damping: float) -> np.ndarray:
    """A step of the logarithms, no longer than `LONGEST_MOVE`.

    Raises
    ------
    LinAlgError
        If the likelihood has no finite slope; LAPACK would print lines of its own beside.
    """
    step = np.zeros(len(gradient))
    if free.any():
        inner = information[np.ix_(free, free)]
        if not (np.isfinite(inner).all() and np.isfinite(gradient[free]).all()):
            raise np.linalg.LinAlgError("the likelihood has no finite slope by what is random")
        inner = inner + np.diag(damping * np.diag(inner) + 1e-9)
        step[free] = np.linalg.lstsq(inner, gradient[free], rcond=1e-12)[0]
    longest = float(np.abs(step).max(initial=0.0))
    return step * min(1.0, LONGEST_MOVE / max(longest, 1e-300))


class TurnsProblem(Protocol):
    """A problem to `Descent` with something random about it."""

    @property
    def is_sharp(self) -> bool:
        """True where slopes are differences of the cost."""

    def score(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Improve what is random, in place; returns by how much that lowers the cost."""

    def sharpen(self) -> bool:
        """Let slopes be differences of the cost; False where they are."""


def by_turns(
    problem: TurnsProblem,
    start: Mapping[str, float],
    unknowns: Unknowns | None = None,
    rounds: int = ROUNDS,
    iterations: int = 6,
) -> Fit:
    """Fit parameters and randomness by turns.

    Returns
    -------
    Fit
        `sse` is twice the negative log-likelihood. `converged` is False where turns ran out.
    """
    fitted = fit_problem(problem, start, unknowns, iterations)  # type: ignore[arg-type]
    for _ in range(rounds):
        before, moved = fitted.sse, problem.score(fitted.values, fitted.unknowns) >= LITTLE
        if moved or problem.is_sharp or not fitted.converged:
            fitted = fit_problem(problem, fitted.values, fitted.unknowns, iterations)  # type: ignore[arg-type]
        if fitted.sse < before - LITTLE:
            continue
        if not (fitted.gradient_norm > WORTH and problem.sharpen()):
            return fitted
        fitted = fit_problem(problem, fitted.values, fitted.unknowns, iterations)  # type: ignore[arg-type]
    return replace(fitted, converged=False)


def maximise(
    problem: LikelihoodProblem,
    start: Mapping[str, float],
    unknowns: Unknowns | None = None,
    rounds: int = ROUNDS,
) -> Fit:
    """The likelihood's maximum; see `by_turns`. The fit's `doubt` is what is random there."""
    return replace(by_turns(problem, start, unknowns, rounds), doubt=problem.doubt)


def with_honest_intervals(fitted: Fit) -> Fit:
    """The fit with intervals as wide as the scores of its trials, cut into `PIECES` pieces, scatter."""
    lengths = [len(p.residual) for p in fitted.parts]
    shares = [min(n, max(1, round(PIECES * n / sum(lengths)))) for n in lengths]
    scores = [
        piece
        for part, count in zip(fitted.parts, shares, strict=True)
        for piece in np.add.reduceat(
            part.jacobian * part.residual[:, None], np.linspace(0, len(part.residual), count, endpoint=False, dtype=int)
        )
    ]
    return replace(fitted, covariance=widened(fitted.covariance, np.array(scores)))
