"""The experiment that would tell confounded causes apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.identify.fit import Fit
from fes_pin.identify.problem import Problem, normal_equations

DECIDED = 1.645**2 * 4.0
"""Separation (squared) of two fitted models at which a likelihood ratio decides between them 95 times in 100."""
SECONDS = 8.0


@dataclass(frozen=True)
class NextExperiment:
    """A trial that separates two causes, or the reason why none does.

    Attributes
    ----------
    why
        In words.
    separates
        The pair.
    trial
        Its inputs and conditions, without outputs; None where no input of the rig separates the pair.
    """

    why: str
    separates: tuple[str, str]
    trial: Trial | None


def next_experiment(best: Fit, rival: Fit, pair: tuple[str, str], study: Study) -> NextExperiment:
    """The feasible trial on which two fitted models differ most, after the rival has been fitted to it as well.

    The separation is the squared distance of the predictions in units of the noise, less what the rival's parameters
    can take up without leaving the data that it was fitted to.
    """
    best_trial, best_distance = None, 0.0
    for trial in candidates(study):
        distance = separation(best, rival, trial)
        if distance > best_distance:
            best_trial, best_distance = trial, distance
    names = f"{pair[0]} and {pair[1]}"
    if best_trial is None or best_distance < 1.0:
        why = (
            f"no stimulus or load of this rig separates {names}: the models differ by {best_distance:.2g} squared "
            "noise units at most; turn the rig's base, or add a sensor on the other side of the joint or frame"
        )
        return NextExperiment(why, pair, None)
    repeats = max(1, int(np.ceil(DECIDED / best_distance)))
    often = "once decides" if repeats == 1 else f"{repeats} repeats decide"
    why = f"on this trial {names} differ by {best_distance:.3g} squared noise units; {often} 95 times in 100"
    return NextExperiment(why, pair, best_trial)


def separation(best: Fit, rival: Fit, trial: Trial) -> float:
    """Squared distance between what two fits predict of a trial, after the rival is adapted."""
    size = {n: v for n, v in best.unknowns[0].items() if n in best.model.own_unknowns()}
    start = {**best.model.initial_unknowns(trial), **size}
    (one,) = Problem(best.model, [trial], best.noise, ()).simulator.run(best.values, [start])
    names = best.model.rig.outputs(trial.kind)
    measured = trial.with_columns(**{n: one.readings[:, k] for k, n in enumerate(names)})
    parts = Problem(rival.model, [measured], best.noise, rival.free).linearize(
        rival.values, [rival.model.initial_unknowns(measured)]
    )
    known, new = normal_equations(rival.parts), normal_equations(parts)
    hessian = known.hessian + new.hessian
    step = np.linalg.lstsq(hessian, new.gradient, rcond=1e-12)[0]
    return float(max(new.sse - new.gradient @ step, 0.0))


def candidates(study: Study) -> Iterator[Trial]:
    """Trials that the rig can run as it is: its loads and held angles, with a dozen stimuli."""
    first = study.trials[0]
    dt = first.dt
    time = np.arange(0.0, SECONDS, dt)
    seen = {(t.kind, tuple(sorted((n, v) for n, v in t.conditions.items() if n != "start_s"))) for t in study.trials}
    if study.rig == "joint":
        starts = [float(t["position"][0]) for t in study.trials]
        seen = {("motion", (("position0", round(p, 4)), ("velocity0", 0.0))) for p in (min(starts), max(starts))}
    for kind, conditions in sorted(_widened(seen)):
        for column, values in _stimuli(study, time):
            yield Trial("next", kind, {column: values} if column else {}, time, dict(conditions))


def _widened(seen: set[tuple[str, tuple[tuple[str, float], ...]]]) -> set[tuple[str, tuple[tuple[str, float], ...]]]:
    """The conditions of a study, and half and once and a half its loads."""
    out = set(seen)
    for kind, conditions in seen:
        values = dict(conditions)
        if "load_kg" in values:
            for factor in (0.5, 1.5):
                out.add((kind, tuple(sorted({**values, "load_kg": round(factor * values["load_kg"], 3)}.items()))))
    return out


def _stimuli(study: Study, time: np.ndarray) -> Iterator[tuple[str | None, np.ndarray]]:
    if "pulse_width_us" in study.trials[0].columns:
        low = float(study.constants.get("threshold_us", 180.0))
        high = float(study.constants.get("saturation_us", 1000.0))
        for shape in _shapes(time):
            yield "pulse_width_us", np.where(shape > 0, low + (high - low) * shape, 0.0)
    elif "stim" in study.trials[0].columns:
        for rate_hz in (8.0, 15.0, 31.0, 45.0):
            pulse = np.diff(np.floor(time * rate_hz), prepend=-1.0) > 0
            for on_s, pause_s in ((7.0, 1.0), (1.0, 1.0), (0.3, 0.7)):
                on = (time % (on_s + pause_s) < on_s) & (time < SECONDS - 0.8)
                yield "stim", np.where(pulse & on, 1.0, 0.0)
    elif "effort" in study.trials[0].columns:
        size = max(float(np.abs(t["effort"]).max()) for t in study.trials)
        for shape in _shapes(time):
            yield "effort", size * (2.0 * shape - 1.0)
    else:
        yield None, time


def _shapes(time: np.ndarray) -> Sequence[np.ndarray]:
    """Stimuli between 0 and 1: steps, staircases, ramps, sines, trains and a random sequence."""
    t = time / time[-1]
    rng = np.random.default_rng(45)
    held = np.repeat(rng.random(40), -(-len(time) // 40))[: len(time)]
    on = (t > 0.1) & (t < 0.6)
    return [
        np.where(on, 0.3, 0.0),
        np.where(on, 0.6, 0.0),
        np.where(on, 1.0, 0.0),
        np.clip(np.floor(10.0 * t) / 8.0, 0.0, 1.0),
        1.0 - np.abs(2.0 * t - 1.0),
        np.where(t < 0.9, 0.5 + 0.5 * np.sin(2 * np.pi * 0.5 * time), 0.0),
        np.where(t < 0.9, 0.5 + 0.3 * np.sin(2 * np.pi * 1.5 * time), 0.0),
        np.where((time % 1.0 < 0.5) & (t < 0.9), 0.8, 0.0),
        np.where((time % 0.4 < 0.2) & (t < 0.9), 0.5, 0.0),
        np.where(t < 0.9, held, 0.0),
    ]
