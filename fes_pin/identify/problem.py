"""A model simulated freely on trials: whitened residuals with sensitivities, and the bounds of its parameters."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Self

import numpy as np

from fes_pin.data.schema import IMPOSED
from fes_pin.data.trial import Trial
from fes_pin.infer import problem as infer
from fes_pin.infer.keys import Key
from fes_pin.infer.noise import NoiseModel
from fes_pin.infer.problem import Linearized, Unknowns
from fes_pin.models.effects.coulomb_friction import STATED
from fes_pin.models.free_run import FreeRun
from fes_pin.models.model import Model
from fes_pin.models.parameters import ParameterInfo
from fes_pin.models.predictions import PredictedTrial
from fes_pin.workers import check_limit

NEXT_TO = 1e-6
"""Distance in scales that a parameter which switches on a form with a memory keeps from its null: far below what data
resolve."""


class Problem(infer.Problem):
    """A model structure on trials, simulated freely, with the noise that weights their residuals.

    Parameters
    ----------
    model
        Its structure; values are given to the methods.
    trials
        Measured trials; NaN where nothing was measured.
    noise
        Noise by output column; a column without noise has no weight.
    free
        The free parameters; by default the fitted ones of the model.
    starts
        Trials whose first samples give the initial states, where those of `trials` are not all measured.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        noise: NoiseModel,
        free: tuple[str, ...] | None = None,
        starts: Sequence[Trial] | None = None,
    ) -> None:
        self.model, self.trials, self.noise = model, tuple(trials), noise
        self.free = model.fitted_parameters() if free is None else free
        self.limits = limits_of(model, self.trials)
        self.unknown_names = unknown_names(model, self.trials, self.is_simulated)
        self.starts = tuple(starts or self.trials)
        self.begins = [model.rig.initial_unknowns(t) for t in self.starts]

    @property
    def is_simulated(self) -> bool:
        """Whether trials are simulated freely, from initial states that are fitted."""
        return True

    def on(self, trials: Sequence[Trial]) -> Self:
        """Return the same problem on other trials."""
        made = type(self)(self.model, trials, self.noise, self.free)
        made.limits = self.limits
        return made

    @cached_property
    def products(self) -> list[tuple[int, int]]:
        """Places in `free` of shapes and of the amplitudes that they multiply."""
        return products_of(self.free, self.model.parameter_info())

    def start_unknowns(self) -> Unknowns:
        """Return start values of the unknowns: initial states from first samples, effects at their null."""
        own = self.model.own_nulls()
        return [{**begin, **own} if self.is_simulated else dict(own) for begin in self.begins]

    def begun(self, unknowns: Unknowns) -> Unknowns:
        """Return the unknowns of each trial with its initial state, where that is none of them."""
        return [{**begin, **u} for begin, u in zip(self.begins, unknowns, strict=True)]

    def innovations(self, values: Mapping[str, float], unknowns: Unknowns) -> list[PredictedTrial]:
        """Return every trial as predicted, with sensitivities to `free` and the unknowns; stops at a limit of time."""
        check_limit()
        with np.errstate(all="ignore"):
            return self._run(values, self.begun(unknowns))

    @cached_property
    def _simulation(self) -> FreeRun:
        return FreeRun(self.model, self.trials, (*self.free, *self.unknown_names), self.noise)

    def _run(self, values: Mapping[str, float], unknowns: Unknowns) -> list[PredictedTrial]:
        return self._simulation.run(values, self.noise, unknowns)

    def linearize(self, values: Mapping[str, float], unknowns: Unknowns) -> list[Linearized]:
        """Return whitened residuals and their sensitivities at a parameter value."""
        return [self.whitened(one) for one in self.innovations(values, unknowns)]

    def whitened(self, one: PredictedTrial) -> Linearized:
        """Return a trial's standardised innovations and their sensitivities."""
        with np.errstate(all="ignore"):
            residual, moved = one.whitened, one.over_deviations(one.sensitivities)
        split = len(self.free)
        return Linearized(residual, moved[:, :split], moved[:, split:])


def unknown_names(model: Model, trials: Sequence[Trial], is_simulated: bool) -> tuple[str, ...]:
    """Return the unknowns of each trial by name: of its initial state, where that is fitted, and of effects."""
    begins = [n for t in trials for n in model.rig.unknowns(t.kind)] if is_simulated else []
    return (*dict.fromkeys(begins), *model.own_unknowns())


def products_of(names: Sequence[str], info: Mapping[str, ParameterInfo]) -> list[tuple[int, int]]:
    """Return places of shapes and of the amplitudes that they multiply, within one group where there are groups."""
    out = []
    for at, name in enumerate(names):
        key = Key.of(name)
        amplitude = str(key._replace(name=f"{key.name.rpartition('.')[0]}.{info[name].times}"))
        if info[name].times and amplitude in names:
            out.append((at, names.index(amplitude)))
    return out


def measured_columns(model: Model, trials: Sequence[Trial]) -> dict[str, np.ndarray]:
    """Return every measured output, imposed motion and effort, all trials end to end, by column name.

    `time` since each trial began, s, or since the trial did of which it is a part; `reading` the first output of each
    that passes a sensor; `friction` the dry friction that is stated of a rig, one value, where there is one.
    """
    out: dict[str, list[np.ndarray]] = {"time": [t.since_origin for t in trials]}
    rig = model.rig
    for trial in trials:
        for name in dict.fromkeys((*rig.outputs(trial.kind), *rig.schema.motion(trial.kind), "effort")):
            if name in trial.columns:
                out.setdefault(name, []).append(trial[name])
        if rig.output(trial.kind) in trial.columns and "reading" in rig.signals(trial.kind):
            out.setdefault("reading", []).append(trial[rig.output(trial.kind)])
    if STATED in rig.constants:
        out[STATED] = [np.array([rig.constants[STATED]])]
    return {n: np.concatenate(v) for n, v in out.items()}


def answered_columns(model: Model, trials: Sequence[Trial]) -> dict[str, np.ndarray]:
    """Return the same for a rig in closed loop, with the effort of its controller as `answer`."""
    measured = measured_columns(model, trials)
    if "effort" in measured and not any(t.kind == IMPOSED for t in trials):
        measured["answer"] = measured["effort"]
    return measured


def limits_of(model: Model, trials: Sequence[Trial]) -> dict[str, tuple[float, float]]:
    """Return bounds of every parameter on these trials, by name.

    Where a form of an effect has a state or a memory of its own, the parameter that switches it on keeps off its null:
    at the null the model is another one, without that state.
    """
    limits = {n: (i.lower, i.upper) for n, i in model.parameter_info().items()}
    measured = measured_columns(model, trials) if model.effects else {}
    for effect in model.effects:
        for n, (low, high) in effect.limits(measured).items():
            name = f"{effect.name}.{n}"
            if name in limits:  # not of each trial's own
                limits[name] = (max(limits[name][0], low), min(limits[name][1], high))
        for n in set(effect.of_form.values()) & set(effect.refined()):
            (low, high), one = limits[f"{effect.name}.{n}"], effect.parameters()[n]
            limits[f"{effect.name}.{n}"] = (min(low + NEXT_TO * one.scale, high) if low == one.null else low, high)
    return limits
