"""The likelihood of measured trials under a model with process and measurement noise.

Twice the negative log-likelihood of the innovations r_k of an extended Kalman filter with variances V_k,

    cost = sum r_k^2 / V_k + log V_k - (1 - 1 / n_k) log N_k,

depends on the model's parameters and on process and measurement noise (`StateSpaceNoise`) alone. `infer.maximise`
maximises it. The last term is 0 unless a count is read n times in a row: that is one reading, to which the filter gives
the variance N = n white^2 each time (`models.compile.predictor`). Its one error has one logarithm, and not n of them.

Source: Kristensen, Madsen and Jorgensen, Parameter estimation in stochastic grey-box models, Automatica 40 (2004).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.identify.problem import Problem
from fes_pin.identify.process_noise import noise_limits, spread_of_start
from fes_pin.infer.noise import ORDERS, SAMPLES_EACH, likeliest_autoregression
from fes_pin.infer.problem import Linearized, Unknowns, whitened_sse
from fes_pin.infer.scoring import Evaluation, NoisyProblem, Point, fisher_scoring
from fes_pin.models.compile.layout import WIDE
from fes_pin.models.free_run import FreeRun, with_noise
from fes_pin.models.predictions import PredictedOutput, PredictedTrial
from fes_pin.models.predictor import Predictor, StateSpaceNoise
from fes_pin.workers import check_limit, in_parallel

NOISE_STEPS = 2
"""Steps of the noise between those of parameters."""
FOLLOWED_STEP = 0.01
"""Step of a difference of the cost by a parameter of the reading, in its standard deviations."""
MOST = 8
"""Highest order of an autoregression of measurement noise. A few coefficients whiten the noise of a sensor. Tens of
coefficients (`infer.noise.ORDERS`) would also model process noise, which is a part of the model here, and a hum with a
phase of each trial's own, which is a cause of the library and is found with these few
(`tests/driven/test_stimulated.py`)."""


class LikelihoodProblem(Problem, NoisyProblem):
    """The likelihood of a model structure on trials, with process and measurement noise.

    Parameters
    ----------
    model
        Its structure; values are given to the methods.
    trials
        Measured trials; NaN where nothing was measured.
    noise
        Process and measurement noise.
    free, starts
        As in `Problem`.
    """

    noise: StateSpaceNoise

    @property
    def is_simulated(self) -> bool:
        """Whether there is no process noise."""
        return is_simulated(self.noise, self.trials)

    @cached_property
    def priors(self) -> list[dict[str, float]]:
        """Prior standard deviation of each initial state, by trial."""
        return [spread_of_start(self.model, t) for t in self.starts]

    @cached_property
    def _linearized(self) -> Predictor | FreeRun:
        return self._made(1, (*self.free, *self.unknown_names))

    @cached_property
    def _batched(self) -> Predictor | FreeRun:
        return self._made(self.batch, ())

    @cached_property
    def _predictor(self) -> Predictor:
        """The filter, which estimates the state also without process noise."""
        return Predictor(self.model, self.trials, (), self.noise.processes, self.priors, self.noise.correlation_s)

    def _made(self, count: int, columns: tuple[str, ...]) -> Predictor | FreeRun:
        """Return the predictor of `count` copies of the trials, with sensitivities to some parameters and unknowns."""
        if self.is_simulated:
            return FreeRun(self.model, self.trials * count, columns, self.noise)
        own = (self.noise.processes, self.priors * count, self.noise.correlation_s)
        return Predictor(self.model, self.trials * count, columns, *own)

    def _run(self, values: Mapping[str, float], unknowns: Unknowns) -> list[PredictedTrial]:
        return self._linearized.run(values, self.noise, unknowns)

    @property
    def noise_parameters(self) -> dict[str, float]:
        """Parameters of the noise that may change, by name; not those of an output that no trial has."""
        known, given = self.noise_limits, [f"time.{n}" for n in self.noise.timed]
        given += [f"{part}.{n}" for part in ("std", "time") for n in self.noise.still]
        return {n: v for n, v in self.noise.parameters().items() if n in known and n not in given}

    @property
    def noise_limits(self) -> dict[str, tuple[float, float]]:
        """Return bounds of these parameters."""
        return noise_limits(self.model, self.trials, self.noise)

    def evaluate(self, points: Sequence[Point]) -> list[Evaluation]:
        """Return one-step predictions of all trials at each of several points."""
        with np.errstate(all="ignore"):
            return [Evaluation.joined([_evaluation(one) for one in run]) for run in self._runs(points)]

    def _runs(self, points: Sequence[Point]) -> list[list[PredictedTrial]]:
        """Return every trial as predicted at each of several points, in batches that fill all lanes."""
        count, trials, predictor = self.batch, len(self.trials), self._batched

        def in_batch(some: Sequence[Point]) -> list[list[PredictedTrial]]:
            check_limit()
            filled = [*some, *[some[-1]] * (count - len(some))]
            values = [one for one, _, _ in filled for _ in range(trials)]
            noises = [noise for *_, one in filled for noise in [self.noise.with_values(one)] * trials]
            own = [whole for _, unknowns, _ in filled for whole in self.begun(unknowns)]
            with np.errstate(all="ignore"):
                run = predictor.run(values, noises, own)
            return [run[j * trials : (j + 1) * trials] for j in range(len(some))]

        runs = in_parallel(in_batch, [points[k : k + count] for k in range(0, len(points), count)])
        return [one for some in runs for one in some]

    @property
    def batch(self) -> int:
        """Number of points that are tried in one run."""
        return max(1, WIDE // len(self.trials))

    def predicted(
        self, values: Mapping[str, float], unknowns: Unknowns | None = None
    ) -> list[dict[str, PredictedOutput]]:
        """Return the prediction of each output of each trial, also where nothing was measured."""
        own = self.begun(self.start_unknowns() if unknowns is None else unknowns)
        with np.errstate(all="ignore"):
            return self._predictor.predict(values, self.noise, own)

    def linearize(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Return standardised innovations and their sensitivities at a parameter value."""
        parts = super().linearize(values, unknowns)
        if self.is_simulated:
            return [self._marginal(p, prior) for p, prior in zip(parts, self.priors, strict=True)]
        return self._followed(parts, values, unknowns) if self._scales else parts

    def _marginal(self, part: Linearized, prior: Mapping[str, float]) -> Linearized:
        """Return a simulated trial with its unknown initial state integrated out, as a filter does.

        With H the information on the initial state and S the standard deviations of its prior, Laplace's method gives
        the likelihood at the likeliest state divided by |1 + S H S|^(1/2). Fits with and without process noise can then
        be compared.
        """
        own = [k for k, n in enumerate(self.unknown_names) if n in prior]
        if not own:
            return part
        with np.errstate(all="ignore"):
            scaled = part.local[:, own] * [prior[self.unknown_names[k]] for k in own]
            _, logarithm = np.linalg.slogdet(np.eye(len(own)) + scaled.T @ scaled)
        return replace(part, log_determinant=part.log_determinant + float(logarithm))

    @property
    def is_final(self) -> bool:
        """Whether a descent ends without other slopes, as effort itself is read.

        With other slopes a lag would fit the smoothness of process noise, which a process of first order does not have.
        """
        return self.is_simulated or not all(self.model.rig.unknowns(t.kind) for t in self.trials)

    def noise_step(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Improve the noise, in place; return by how much the cost falls."""
        if self.is_simulated:
            return self.renew(values, unknowns)
        reached = fisher_scoring(self, values, unknowns, {}, NOISE_STEPS)
        self.set_noise(reached.noise)
        return reached.gained + (self.renew(values, unknowns) if any(self.noise.ar.values()) else 0.0)

    def renew(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Estimate measurement noise again from the innovations, in place; return by how much the cost falls.

        Its autoregressions keep their orders. The variance of its innovations is estimated where there is no other
        noise.
        """
        run = self.residual_run(values, unknowns)
        orders, limits = {n: (len(ar),) for n, ar in self.noise.ar.items()}, self.noise_limits
        found = replace(self.noise, ar={**self.noise.ar, **autoregressions(run, orders)})
        if self.is_simulated:
            powers = residual_powers([with_noise(one, found) for one in run])
            white = {f"white.{n}": found.white[n] * math.sqrt(power) for n, power in powers.items()}
            found = found.with_values({n: float(np.clip(v, *limits[n])) for n, v in white.items()})
        before, after = (sum(one.cost() for one in some) for some in (run, [with_noise(one, found) for one in run]))
        if not after < before:
            return 0.0
        self.noise = found
        return before - after

    def residual_run(self, values: Mapping[str, float], unknowns: Unknowns) -> list[PredictedTrial]:
        """Return every trial as predicted, of which the noise of simulated trials is estimated."""
        (run,) = self._runs([(values, unknowns, {})])
        return run

    def with_orders(self, values: Mapping[str, float], unknowns: Unknowns) -> StateSpaceNoise:
        """Return the noise with autoregressions of the orders that the innovations support."""
        run = self.residual_run(values, unknowns)
        return replace(self.noise, ar=autoregressions(run, dict.fromkeys(self.noise.white, ORDERS)))

    def set_noise(self, parameters: Mapping[str, float]) -> None:
        """Change parameters of the noise, in place."""
        self.noise = self.noise.with_values(parameters)

    @cached_property
    def _scales(self) -> tuple[str, ...]:
        """Free parameters that scale a reading, and the filter's gains with it."""
        if self.is_simulated:  # there are no gains
            return ()
        imposed = any(t.kind == IMPOSED for t in self.trials)
        read = ("reading", "effort") if imposed else ("reading",)
        names = [f"{e.name}.{n}" for e in self.model.effects if e.scales and e.signal in read for n in e.amplitudes()]
        return tuple(n for n in names if n in self.free)

    def _followed(self, parts: list[Linearized], values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Return sensitivities to `_scales` corrected for filter gains that are taken as constant.

        Where a filter follows its readings closely, a scale of the reading seems to shrink all innovations as long as
        the gains are constant. The correction makes the slope of the cost equal to its finite difference.
        """
        at, squares = [self.free.index(n) for n in self._scales], sum(float(p.residual @ p.residual) for p in parts)
        if not (np.isfinite(squares) and squares > 0.0):
            return parts
        now, along = whitened_sse(parts), np.zeros(len(self.free))
        sizes = np.sqrt(sum(np.sum(p.jacobian[:, at] ** 2, axis=0) for p in parts))
        felt = np.flatnonzero(sizes) if np.isfinite(now) else np.empty(0, dtype=int)
        names, steps = [self._scales[k] for k in felt], FOLLOWED_STEP / sizes[felt]
        moved = [{**values, n: values[n] + float(h)} for n, h in zip(names, steps, strict=True)]
        slopes = 0.5 * (np.array(self.costs([(m, unknowns) for m in moved])) - now) / steps
        missed = -slopes - sum(p.residual @ p.jacobian[:, at] for p in parts)[felt]
        along[np.array(at)[felt]] = np.nan_to_num(missed) / squares
        return [replace(p, jacobian=p.jacobian + np.outer(p.residual, along)) for p in parts]

    def whitened(self, one: PredictedTrial) -> Linearized:
        """Return the same with the logarithms of the variances."""
        with np.errstate(all="ignore"):
            return replace(super().whitened(one), log_determinant=float(np.sum(one.logarithms)))

    def cost(self, values: Mapping[str, float], unknowns: Unknowns) -> float:
        """Return twice the negative log-likelihood."""
        return sum(one.cost() for one in self.innovations(values, unknowns))


def is_simulated(noise: StateSpaceNoise, trials: Sequence[Trial]) -> bool:
    """Return whether there is no process noise: one-step predictions are then a free simulation."""
    return not noise.processes and all(t.kind != IMPOSED for t in trials)


def _evaluation(one: PredictedTrial) -> Evaluation:
    return Evaluation(one.cost(), one.whitened, one.seen_variances, one.repeated_noise, one.readings.again)


def autoregressions(run: Sequence[PredictedTrial], orders: Mapping[str, Sequence[int]]) -> dict[str, tuple[float, ...]]:
    """Return the likeliest autoregression of each measured output, of one of its orders, from all trials together.

    No white share is assumed: with one of 0.3 % the innovations of coloured noise were 2 to 9 % larger, and the fit
    made up for that by process noise that did not exist.
    """
    out = {}
    for name, own in orders.items():
        with np.errstate(all="ignore"):
            left = [one.standardised(one.values)[:, one.outputs.index(name)] for one in run if name in one.outputs]
        if left:
            most = min(MOST, min(map(len, left)) // SAMPLES_EACH)
            out[name], _ = likeliest_autoregression(left, [p for p in own if p <= most] or [0])
    return out


@np.errstate(over="ignore")  # of a model that diverges
def residual_powers(run: Sequence[PredictedTrial]) -> dict[str, float]:
    """Return, by output, the factor on the variance of its noise that maximises the likelihood of its innovations.

    A count that was read n times in a row is one reading, with one error.
    """
    out = {}
    for name in dict.fromkeys(n for one in run for n in one.outputs):
        squares = count = 0.0
        for one in run:
            if name in one.outputs:
                own = one.of_seen(np.broadcast_to(np.array(one.outputs) == name, one.seen.shape))
                squares += float(np.sum(one.whitened[own] ** 2))
                count += float(np.sum(1.0 - one.readings.again[own]))
        if 0.0 < squares < math.inf:
            out[name] = squares / count
    return out
