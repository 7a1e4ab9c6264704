"""Fits by the likelihood of one-step predictions: parameters, with process and measurement noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fes_pin.data.trial import Trial
from fes_pin.identify.fit import Fit, ended
from fes_pin.identify.likelihood import LikelihoodProblem, is_simulated
from fes_pin.identify.process_noise import slowest_of_all, without_memory
from fes_pin.infer.levels import CLAIM_LEVEL, DRIVEN_LEVEL, PARAMETER_PENALTY
from fes_pin.infer.maximise import ROUNDS, alternate, together
from fes_pin.infer.optimum import Optimum, minimise
from fes_pin.infer.problem import Unknowns
from fes_pin.models.predictor import StateSpaceNoise


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class LikelihoodFit(Fit):
    """A model with parameters and noise fitted by the likelihood of one-step predictions.

    Attributes
    ----------
    noise
        Process noise and, by output column, measurement noise. `sse` holds the log-determinant.
    """

    noise: StateSpaceNoise

    @property
    def _has_profile(self) -> bool:
        return is_simulated(self.noise, self.trials)

    def _problem(self) -> LikelihoodProblem:
        problem = LikelihoodProblem(self.model, self.trials, self.noise, self.free)
        problem.limits |= self.bounds
        return problem

    def _cost(self) -> float:
        return self.sse

    @property
    def noise_degrees(self) -> int:
        """Number of estimated parameters of the noise: of each output and process, and of autoregressions."""
        known = [f"{part}.{n}" for part in ("std", "time") for n in self.noise.still]
        known += [f"time.{n}" for n in self.noise.timed]
        return len(self.noise.parameters().keys() - known) + sum(map(len, self.noise.ar.values()))

    @property
    def criterion(self) -> float:
        """Twice the negative log-likelihood, with a penalty for each degree of freedom and for process noise."""
        return self.sse + PARAMETER_PENALTY * (self.degrees + 2 * len(self.noise.acting))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the causes, in alphabetical order."""
        return tuple(sorted(e.name for e in self.model.effects if not e.is_fault))

    @property
    def level(self) -> float:
        """Family-wise level of a claim in this fit, or of its lack of fit.

        It is stricter with process noise, which is of first order in the model, while that of the rig is not known.
        """
        return DRIVEN_LEVEL if self.noise.acting else CLAIM_LEVEL

    def unknowns_of(self, trial: Trial) -> Unknowns | None:
        """Return the unknowns of a trial that was fitted by free simulation, from its first sample on; else None.

        Its initial state is among them. A trial may have been fitted without its spikes, or its later samples.
        """
        return super().unknowns_of(trial) if is_simulated(self.noise, [trial]) else None


def fit_of(problem: LikelihoodProblem, found: Optimum) -> LikelihoodFit:
    """Return the fit of a problem at its optimum, with the noise of the problem."""
    return LikelihoodFit(**ended(problem.model, found), trials=problem.trials, noise=problem.noise)


def at_noise(fitted: Fit, noise: StateSpaceNoise) -> LikelihoodFit:
    """Return a fit, with its parameters, at another noise."""
    problem = LikelihoodProblem(fitted.model, fitted.trials, noise)
    return fit_of(problem, minimise(problem, fitted.values, fitted.unknowns, 0))


def at_values(fitted: LikelihoodFit, values: Mapping[str, float]) -> LikelihoodFit:
    """Return a fit at other values of some parameters, with the noise that is likeliest there."""
    problem = LikelihoodProblem(fitted.model.with_parameters(values), fitted.trials, fitted.noise)
    problem.noise_step(problem.model.parameters(), fitted.unknowns)
    return fit_of(problem, minimise(problem, problem.model.parameters(), fitted.unknowns, 0))


def maximise(
    problem: LikelihoodProblem, unknowns: Unknowns | None = None, rounds: int = ROUNDS, near: bool = False
) -> LikelihoodFit:
    """Maximise the likelihood from the values of the problem's model, and return the fit.

    It is done by `infer.maximise.alternate`, or by `together` alone if the maximum is near.
    """
    start = problem.model.parameters()
    if near and not problem.is_final:
        return fit_of(problem, together(problem, start, unknowns))
    return fit_of(problem, alternate(problem, start, unknowns, rounds))


def maximum_from(
    fitted: LikelihoodFit, trials: Sequence[Trial], noise: StateSpaceNoise | None = None, rounds: int = ROUNDS
) -> LikelihoodFit:
    """Maximise the likelihood of a fit's model on trials similar to its own, from the values of the fit.

    Parameters
    ----------
    noise
        Start values of the noise; by default that of the fit.
    rounds
        Most alternations of parameters and noise.
    """
    problem = LikelihoodProblem(fitted.model, trials, noise or fitted.noise)
    return maximise(problem, fitted.unknowns, rounds, fitted.together)


def refit(fitted: LikelihoodFit, trials: Sequence[Trial]) -> LikelihoodFit:
    """Return the fit of the same model to other trials, with the noise of these."""
    problem, unknowns = problem_on(fitted, trials)
    return maximise(problem, unknowns, near=True)


def problem_on(fitted: LikelihoodFit, trials: Sequence[Trial]) -> tuple[LikelihoodProblem, Unknowns]:
    """Return the problem of a fit's model on other trials, and start values of their unknowns."""
    known = {id(t): u for t, u in zip(fitted.trials, fitted.unknowns, strict=True)}
    problem = LikelihoodProblem(fitted.model, trials, fitted.noise)
    return problem, [known.get(id(t), u) for t, u in zip(trials, problem.start_unknowns(), strict=True)]


def with_slow_process_noise(fitted: LikelihoodFit) -> LikelihoodFit:
    """Fit the same model to the same trials with process noise as slow as all trials together tell."""
    noise = replace(fitted.noise, slowest_s=slowest_of_all(fitted.trials))
    return maximise(LikelihoodProblem(fitted.model, fitted.trials, noise), fitted.unknowns)


def with_white_process_noise(fitted: LikelihoodFit) -> LikelihoodFit:
    """Fit the same model to the same trials with white process noise.

    The size of the noise is fitted before the parameters: if it is too small, parameters follow every error; if it is
    too large, measurement noise biases inertia.
    """
    problem = LikelihoodProblem(fitted.model, fitted.trials, without_memory(fitted.noise, fitted.trials))
    problem.noise_step(fitted.values, fitted.unknowns)
    return maximise(problem, fitted.unknowns)
