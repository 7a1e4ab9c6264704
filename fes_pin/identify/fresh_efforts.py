"""What a model explains by itself: its fit beside random efforts that are new in every sample.

The likelihood gives what a model gets wrong to a random effort, and an error of form is none: friction behind an
elastic drive is wrong for a moment at every reversal. Where readings are fine, a random effort that lasts makes that
likelier than any other does, and takes what is slow in the motion with it, of which inertia, damping and friction are
known; these then bend to the moments. Beside efforts that are new in every sample, parameters are those that leave the
least effort unexplained, whatever it is, as those of an inverse dynamic model (Khalil and Dombre, Modeling,
Identification and Control of Robots, 2002, chapter 12): calibration in the mean square, which a wrong model is the
nearest to what is measured by (Tuo and Wu, Efficient calibration for imperfect computer models, Annals of Statistics
43, 2015). Where a random effort does last, it is known for what it is by the errors ahead, which then are smaller
beside it (`diagnose.form_errors`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fes_pin.data.trial import Trial
from fes_pin.identify.likelihood import LikelihoodProblem
from fes_pin.identify.likelihood_fit import LikelihoodFit, maximise
from fes_pin.models.predictor import Doubt


def step_s(noise: Doubt, trials: Sequence[Trial]) -> float:
    """From one reading to the next, s."""
    return max(noise.lasts_s, *(t.dt for t in trials))


def fresh(noise: Doubt, trials: Sequence[Trial]) -> Doubt:
    """The same with random efforts that are new in every reading, of the power that they have at rest: 2 std^2 time."""
    step = step_s(noise, trials)
    std = {n: v * (noise.time[n] / step) ** 0.5 for n, v in noise.std.items()}
    return replace(noise, std=std, time=dict.fromkeys(noise.time, step), timed=noise.processes)


def beside_fresh_efforts(fitted: LikelihoodFit) -> LikelihoodFit:
    """A fit of the same model to the same trials, with random efforts that are new in every reading.

    How large they are is found before anything moves: too small, parameters would go after every error, and too large,
    inertia would be what noise of the reading makes of it.
    """
    problem = LikelihoodProblem(fitted.model, fitted.trials, fresh(fitted.noise, fitted.trials))
    problem.noise_step(fitted.values, fitted.unknowns)
    return maximise(problem, fitted.values, fitted.unknowns)


__all__ = ["beside_fresh_efforts", "fresh", "step_s"]
