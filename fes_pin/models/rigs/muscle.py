"""A muscle held at one length, or by a lever that imposes its length: stimulus in, force out."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fes_pin.data.channels import CHANNELS, RATE, VOLUNTARY, recruitment_keys
from fes_pin.data.errors import InputError
from fes_pin.data.schema import IMPOSED, START_S, RigSchema, positive
from fes_pin.data.stimulus import is_stimulated
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.models.parameters import HELD, parameter
from fes_pin.models.rigs.base import Rig, imposed_now, stated
from fes_pin.models.rigs.stimuli import at_start, recruited_in, recruited_now, rest_muscle, trains, usual_period
from fes_pin.models.stage import Signals


@dataclass(frozen=True)
class Muscle(Rig):
    """A muscle: recruitment by pulse width, amplitude or charge, or by the pulses themselves, and a first-order lag.

        r         = clip((w - threshold) / (saturation - threshold), 0, 1), or the recorded pulses
        tau da/dt = r - a
        F         = gain a

    A recorded pulse (`stim`) is an impulse of area P, the usual pulse period of the study: there a train averages
    r = 1, and `gain` is the mean force that it settles to; one of twice the rate averages r = 2. Where a lever imposes
    its length the nominal force does not depend on that; causes count it from `length_m`, the middle of the study's.

    The envelope of an EMG is r of a voluntary muscle: `gain` is then its force at an envelope of 1.
    """

    gain: float = parameter(30.0, unit="N", lower=1e-6, upper=1e5, scale=5.0)
    time_constant_s: float = parameter(0.05, unit="s", lower=2e-3, upper=2.0, scale=0.01)

    name = "muscle"
    schema = RigSchema(
        constants=recruitment_keys(),
        start={"gain": positive(""), "time_constant_s": positive("s")},
        conditions=START_S,
        default_kind="isometric",
        outputs={"isometric": "force_n", IMPOSED: "force_n"},
        inputs=("pulse_width_us", "stim", "amplitude_ma", "charge_uc", RATE, *VOLUNTARY),
        imposed=("length_m",),
    )
    elsewhere = "record the same force with another sensor, or let the muscle move a joint"

    @classmethod
    def of_study(cls, study: Study) -> "Muscle":
        pulsed = [t for t in study.trials if "stim" in t.columns]
        period = {"pulse_period_s": pulse_period(pulsed)} if pulsed else usual_period(study.trials)
        ends = [f(t["length_m"]) for t in study.trials if "length_m" in t for f in (np.min, np.max)]
        middle = {"length_m": 0.5 * float(min(ends) + max(ends))} if ends else {}
        start: dict[str, Any] = dict(study.start)
        if not any(is_stimulated(t) or t.kind != IMPOSED for t in study.trials):
            words = "no trial is stimulated, and this rig models what a stimulus adds; expected rig joint, on a slide"
            raise InputError(words, file=study.folder, column="rig")
        return cls(constants={**study.constants, **period, **middle}, **start)

    @classmethod
    def steered(cls, study: Study) -> str | None:
        found = super().steered(study)
        return found if found in (*CHANNELS, RATE) else None

    @classmethod
    def other_stimuli(cls, study: Study, time: np.ndarray) -> Iterator[dict[str, np.ndarray]]:
        yield from ({"stim": train} for train in trains(time))

    def driving_sizes(self, trials: Sequence[Trial]) -> dict[str, float]:
        forces = [t["force_n"] for t in trials if "force_n" in t.columns]
        return {"force": max(math.sqrt(max((float(np.nanmean(f**2)) for f in forces), default=0.0)), 1e-9)}

    def units(self) -> Mapping[str, str]:
        return HELD

    def signals(self, kind: str) -> tuple[str, ...]:
        nerve = ("pulse_width", "recruitment", "delay", "time_constant")
        if kind == IMPOSED:
            stretched = ("fibres", "force", "fibre", "torque", "pull", "reading")
            return (*nerve, "sensitivity", "summation", "activation", *stretched)
        return (*nerve, "summation", "activation", "force", "pull", "reading")

    def changeable(self, kind: str, inputs: tuple[str, ...]) -> tuple[str, ...]:
        return self.driven_signals(self.signals(kind), inputs)

    def states(self, kind: str) -> tuple[str, ...]:
        return ("act",)

    def memories(self, kind: str) -> tuple[str, ...]:
        return ("r", "r_before")

    def constant_names(self, kind: str) -> tuple[str, ...]:
        return (*self.ends(), "pulse_period_s", "length_m")

    def trial_constants(self, trial: Trial) -> dict[str, float]:
        period = pulse_period([trial] if "stim" in trial.columns else [])
        known = {"pulse_period_s": period, "length_m": 0.0, **at_start(trial), **self.constants}
        return stated(known, self.constant_names(trial.kind), trial)

    def recruited(self, trial: Trial) -> np.ndarray:
        return recruited_in(trial, self.channel, self.trial_constants(trial))

    def set_rest(self, s: Signals, z: Any) -> None:
        rest_muscle(s)
        s.q, s.sensed = 0.0, self.gain * s.x.act

    def sample(self, s: Signals) -> dict[str, Any]:
        return {"r": s.through("recruitment", recruited_now(s, self.channel)), "r_before": s.m.r}

    def rates(self, s: Signals) -> dict[str, Any]:
        s.r = s.delayed(s.m.r, s.m.r_before)
        s.act, s.q, s.v, s.force_scale = s.x.act, 0.0, 0.0, self.gain
        if s.kind == IMPOSED:
            s.q, rate, _ = imposed_now(s)
            in_series = sum((e.elongation(s.of(e)) for e in s.effects if e.signal == "fibre"), start=0.0)
            s.stretching, s.bent = rate, s.q - s.c.length_m - in_series
        s.time_constant = s.through("time_constant", self.time_constant_s)
        s.act_rate = (s.r - s.act) / s.time_constant
        felt = s.through("sensitivity", s.act) if s.kind == IMPOSED else s.act
        s.drive = s.through("activation", s.through("summation", felt))
        if s.kind == IMPOSED:
            s.isometric = s.through("force", s.through("fibres", s.force_scale * s.drive))
            s.tendon = self._tendon_force(s)
            passive = -s.through("torque", 0.0)
            s.force = s.sensed = s.through("pull", s.tendon + passive)
        else:
            s.force = s.sensed = s.through("pull", s.through("force", s.force_scale * s.drive))
        return {"act": s.act_rate}

    def _tendon_force(self, s: Signals) -> Any:
        """The fibres' force at the speed at which it is also that of what is in series with them.

        A spring of tension y and softness C with a damping time of half a step e holds y + e (u - U) / C, with U the
        speed at which the muscle shortens and u that of the fibres.
        """
        speed = -s.stretching
        damped = next((e for e in s.effects if hasattr(e, "factor")), None)
        for elastic in (e for e in s.effects if e.signal == "fibre"):
            slope = 0.5 * s.step / elastic.softness(s.of(elastic))
            at_rest = s.own.tension - slope * speed
            if damped is None:
                return s.isometric
            speed = damped.balanced(s.isometric, at_rest, slope)
        return s.isometric if damped is None else s.isometric * damped.factor(speed)

    def readings(self, s: Signals) -> tuple[Any, ...]:
        self.rates(s)
        s.rest_reading = 0.0
        return (s.through("reading", s.force),)


def pulse_period(trials: Sequence[Trial]) -> float:
    """The usual time between two pulses of recorded trains, s: the median; a sample where there are no two pulses."""
    between = [np.diff(t.time[t["stim"] > 0.5]) for t in trials]
    joined = np.concatenate(between) if between else np.empty(0)
    return float(np.median(joined)) if len(joined) else min((t.dt for t in trials), default=0.0)
