"""A muscle held at constant length: stimulus in, force out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fes_pin.data.schema import START_S, RigSchema, not_negative, positive
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.models.maths import clip
from fes_pin.models.parameters import HELD, parameter
from fes_pin.models.rigs.base import Rig
from fes_pin.models.rigs.stimuli import pulse_widths, trains
from fes_pin.models.stage import Signals


@dataclass(frozen=True)
class Muscle(Rig):
    """Isometric muscle: recruitment by pulse width, or by the pulses themselves, and a first-order lag.

        r         = clip((w - threshold) / (saturation - threshold), 0, 1), or the recorded pulses
        tau da/dt = r - a
        F         = gain a

    A recorded pulse (`stim`) is an impulse of area P, the usual pulse period of the study: there a train averages
    r = 1, and `gain` is the mean force that it settles to; one of twice the rate averages r = 2.
    """

    gain: float = parameter(30.0, unit="N", lower=1e-6, upper=1e5, scale=5.0)
    time_constant_s: float = parameter(0.05, unit="s", lower=2e-3, upper=2.0, scale=0.01)

    name = "muscle"
    schema = RigSchema(
        constants={"threshold_us": not_negative("us", False), "saturation_us": positive("us", False)},
        start={"gain": positive(""), "time_constant_s": positive("s")},
        conditions=START_S,
        default_kind="isometric",
        outputs={"isometric": "force_n"},
        inputs=("pulse_width_us", "stim"),
    )
    elsewhere = "record the same force with another sensor, or let the muscle move a joint"

    @classmethod
    def of_study(cls, study: Study) -> Muscle:
        pulsed = [t for t in study.trials if "stim" in t.columns]
        period = {"pulse_period_s": pulse_period(pulsed)} if pulsed else {}
        start: dict[str, Any] = dict(study.start)
        return cls(constants={**study.constants, **period}, **start)

    @classmethod
    def steered(cls, study: Study) -> str | None:
        return "pulse_width_us" if "pulse_width_us" in study.trials[0] else None

    @classmethod
    def driven(cls, study: Study, shape: np.ndarray) -> np.ndarray:
        return pulse_widths(study, shape)

    @classmethod
    def other_stimuli(cls, study: Study, time: np.ndarray) -> Iterator[dict[str, np.ndarray]]:
        yield from ({"stim": train} for train in trains(time))

    def units(self) -> Mapping[str, str]:
        return HELD

    def signals(self, kind: str) -> tuple[str, ...]:
        return ("pulse_width", "recruitment", "delay", "time_constant", "activation", "force", "reading")

    def changeable(self, kind: str, inputs: tuple[str, ...]) -> tuple[str, ...]:
        without_width = {"pulse_width", "recruitment"} if "stim" in inputs else set()
        return tuple(s for s in self.signals(kind) if s not in without_width)

    def states(self, kind: str) -> tuple[str, ...]:
        return ("act",)

    def memories(self, kind: str) -> tuple[str, ...]:
        return ("r", "r_before")

    def outputs(self, kind: str) -> tuple[str, ...]:
        return ("force_n",)

    def input_columns(self, trial: Trial) -> tuple[str, ...]:
        return ("stim",) if "stim" in trial.columns else ("pulse_width_us",)

    def constant_names(self, kind: str) -> tuple[str, ...]:
        return ("threshold_us", "saturation_us", "pulse_period_s")

    def trial_constants(self, trial: Trial) -> dict[str, float]:
        pulsed = [trial] if "stim" in trial.columns else []
        return {
            "threshold_us": float(self.constants.get("threshold_us", 0.0)),
            "saturation_us": float(self.constants.get("saturation_us", 1.0)),
            "pulse_period_s": float(self.constants.get("pulse_period_s", pulse_period(pulsed))),
        }

    def set_rest(self, s: Signals, z: Any) -> None:
        s.x.act = s.m.r = s.m.r_before = 0.0
        s.q = s.sensed = 0.0

    def rest_residual(self, s: Signals, z: Any) -> Any:
        return z

    def sample(self, s: Signals) -> dict[str, Any]:
        if hasattr(s.u, "stim"):
            r = s.u.stim * s.c.pulse_period_s / s.c.dt
        else:
            s.commanded = s.u.pulse_width_us
            width = s.through("pulse_width", s.commanded)
            r = clip((width - s.c.threshold_us) / (s.c.saturation_us - s.c.threshold_us), 0.0, 1.0)
        return {"r": s.through("recruitment", r), "r_before": s.m.r}

    def rates(self, s: Signals) -> dict[str, Any]:
        s.r = s.delayed(s.m.r, s.m.r_before)
        s.act, s.q, s.v, s.force_scale = s.x.act, 0.0, 0.0, self.gain
        s.time_constant = s.through("time_constant", self.time_constant_s)
        s.act_rate = (s.r - s.act) / s.time_constant
        s.drive = s.through("activation", s.act)
        s.force = s.sensed = s.through("force", s.force_scale * s.drive)
        return {"act": s.act_rate}

    def readings(self, s: Signals) -> tuple[Any, ...]:
        self.rates(s)
        s.rest_reading = 0.0
        return (s.through("reading", s.force),)


def pulse_period(trials: Sequence[Trial]) -> float:
    """The usual time between two pulses of recorded trains, s: the median; a sample where there are no two pulses."""
    between = [np.diff(t.time[t["stim"] > 0.5]) for t in trials]
    joined = np.concatenate(between) if between else np.empty(0)
    return float(np.median(joined)) if len(joined) else min((t.dt for t in trials), default=0.0)
