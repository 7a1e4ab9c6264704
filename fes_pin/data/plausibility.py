"""Implausible numbers of a study, found before anything is fitted: errors, and warnings of one line each.

Rejected, as no verdict could follow from it: no stimulus above threshold in any trial, outputs that never change or go
to and fro between two counts, too few samples, a load that only grams explain, an imposed motion that never moves; and
what `check_trial` refuses of each trial: an angle that only degrees explain. Everything else is a warning, and the
diagnosis goes on. Trials that are only to be predicted, or fitted by themselves, are held to the same list, but for
what a study needs: they may be few, and nothing need drive them.
"""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fes_pin.data.by_itself import PULSES
from fes_pin.data.channels import CHANNELS, RATE, WIDTH
from fes_pin.data.checks import check_values
from fes_pin.data.counts import hunts
from fes_pin.data.errors import InputError
from fes_pin.data.imposed import imposed_motion
from fes_pin.data.repeats import effort_of_repeats
from fes_pin.data.rests import MATTERS, rest_share
from fes_pin.data.schema import IMPOSED, RigSchema
from fes_pin.data.stimulus import is_stimulated
from fes_pin.data.stuck import RUN
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial, check_trial
from fes_pin.data.units import own_unit
from fes_pin.data.urdf import is_revolute

SAMPLES_EACH = 10
"""Samples for each value that is fitted, at least: a standard deviation that is estimated from fewer is itself
uncertain by more than a quarter (one over the root of twice their number)."""
FEW = 16
"""Samples of a trial below which it can hardly show a motion: a warning."""
STRONGEST_N = 1e4
"""Force in N that no limb exerts: the strongest knee extensions measured come to about 3 kN at the shank."""
STRONGEST_NM = 1e3
"""Torque in N m that no joint exerts: those 3 kN at the shank, a third of a metre from the knee."""
HEAVIEST_KG, IMPOSSIBLE_KG = 100.0, 300.0
"""Load in kg that nobody hangs on an ankle: a warning; and one that weighs as much as those 3 kN: it is in grams."""
SHORTEST_US = 10.0
"""Pulse width in us that excites no nerve through the skin: widths that never exceed it are in ms or s."""
COMMON = 0.05
"""Share of equal neighbours from which a reading is coarse: equal samples in a row then say nothing."""
CLIPPED = 0.01
"""Share of a column's samples at its very largest or smallest value from which it counts as clipped."""
A_COUNT, SLOWLY = 1.5, 0.1
"""Steps of a reading that comes to rest or leaves it: at most so many of its least, or that share of its usual ones."""
COUNTS = 20
"""Different whole numbers from which on a column of nothing else is a counter's, not a quantity in SI units."""
SHORTEST, JUMP = 5, 3.0
"""Samples that a dropout stands still for, at least; and by how many of its largest usual steps it then jumps."""
STILL = 6.0
"""Deviations of its noise that an imposed motion must exceed to count as one."""
RATE_RATIO = 5.0
"""Factor by which a velocity may differ from the slope of its position: filters make less, degrees make 57."""
NEVER = "a muscle that is never stimulated shows nothing"
"""Why a study without a stimulus above the threshold is rejected."""
PIECES = 8
"""Pieces of a trial that velocity and slope are compared over: over one sample the position's noise would be all."""


@dataclass(frozen=True)
class ToPredict:
    """Trials that a model is to predict, to be judged like those of a study.

    Parameters
    ----------
    trials, schema, constants
        Of the model's rig; the trials may have no outputs.
    folder
        Where they come from, for errors.
    start
        What is fitted: nothing.
    """

    trials: Sequence[Trial]
    schema: RigSchema
    constants: Mapping[str, float]
    folder: Path | None = None
    start: Mapping[str, float] = field(default_factory=dict)


def implausible(study: Study | ToPredict) -> list[str]:
    """Warnings about trials, one line each.

    Raises
    ------
    InputError
        For what no verdict could follow from; see the module.
    """
    for trial in study.trials if isinstance(study, ToPredict) else ():  # those of a study were checked with it
        check_trial(trial, study.schema, inputs_only=True, threshold_us=-math.inf)
    _check_rows(study)
    done = [(t, remark) for t in study.trials for remark in t.remarks]  # to samples, when they were read
    few = [(t, f"fewer than {FEW} samples") for t in study.trials if len(t) < FEW]
    driven_by = (*_inputs(study), *_units(study), *_imposed(study))
    return [*_each("", [*done, *few]), *driven_by, *_outputs(study), *_rates(study.trials), *_rests(study)]


def _outputs(study: Study | ToPredict) -> Iterable[str]:
    """Remarks on readings; that none changes, or that they show two counts alone, is an InputError."""
    outputs = tuple(dict.fromkeys((*study.schema.outputs.values(), "velocity")))
    driving = study.schema.driving
    measured = [(t, n) for t in study.trials for n in outputs if n in t and n not in driving(t.kind, t.columns)]
    moving = [(t, n) for t, n in measured if np.ptp(t[n]) > 0.0]
    _check_counts(study, moving)
    if not moving and not isinstance(study, ToPredict):
        raise InputError("no output changes in any trial; there is nothing to compare a model with", file=study.folder)
    yield from _each("does not change at all", [(t, n) for t, n in measured if not np.ptp(t[n]) > 0.0])
    yield from _each("is cut off at its largest or smallest value (clipping?)", [m for m in moving if _is_clipped(*m)])
    yield from _each("holds whole numbers only: are they an encoder's counts?", [m for m in moving if _is_counted(*m)])
    for trial, name in moving:
        yield from dropouts(trial, name) or _held(trial, name)


def _rests(study: Study | ToPredict) -> Iterable[str]:
    """How long the driven trials of a study stand still, where that is most of the time; free motion settles."""
    if isinstance(study, ToPredict):
        return
    read = study.schema.outputs
    driving = study.schema.driving
    measured = [t for t in study.trials if read.get(t.kind) in t and driving(t.kind, t.columns)]
    moved = {t.name: [n for n in study.schema.motion(t.kind) if n in t] for t in measured}
    share = rest_share([(t, (read[t.kind], *moved[t.name]), _stimuli(study, t)) for t in measured])
    if share > MATTERS:
        little = "what moves is known from the others alone"
        yield f"these trials rest for {share:.0%} of the time: neither reading nor input changes, and {little}"


def _check_counts(study: Study | ToPredict, moving: Sequence[tuple[Trial, str]]) -> None:
    """Raise InputError for outputs that hardly do more than go to and fro between two counts: they show no motion."""
    columns = [t[n] for t, n in moving]
    hunting = [hunts(c) for c in columns]
    others = sum(int(np.sum(~h & (np.diff(c, prepend=np.nan) != 0.0))) for c, h in zip(columns, hunting, strict=True))
    wanted = SAMPLES_EACH * len(study.start)
    most = sum(int(h.sum()) for h in hunting) > 0.5 * sum(map(len, hunting))
    if most and others < wanted:
        names = ", ".join(dict.fromkeys(n for _, n in moving))
        expected = f"expected at least {wanted} other readings, {SAMPLES_EACH} for each value of [start]"
        message = f"{names} only goes to and fro between two counts: {expected}; found {others}"
        raise InputError(message, file=study.folder)


def _stimuli(study: Study | ToPredict, trial: Trial) -> tuple[str, ...]:
    """Columns that a trial has as stimuli."""
    return tuple(n for n in study.schema.stimuli(trial.kind) if n in trial)


def _each(what: str, found: Sequence[tuple[Trial, str]]) -> list[str]:
    """One warning for each column, however many trials have it."""
    by_column: dict[str, list[str]] = {}
    for trial, name in found:
        by_column.setdefault(f"{name} {what}".rstrip(), []).append(trial.name)
    return [f"{words} in {trials_named(names)}" for words, names in by_column.items()]


def trials_named(names: Sequence[str]) -> str:
    """One trial by its name, several by their number, the first and the last."""
    return f"trial {names[0]}" if len(names) == 1 else f"{len(names)} trials ({names[0]} to {names[-1]})"


def _check_rows(study: Study | ToPredict) -> None:
    """Raise InputError for too few samples for what is fitted."""
    fitted = [t for t in study.trials if t.role != "held_out"]
    wanted = SAMPLES_EACH * len(study.start)
    found = sum(map(len, fitted))
    if fitted and found < wanted:
        expected = f"expected at least {wanted} samples, {SAMPLES_EACH} for each value of [start]"
        raise InputError(f"{expected}, in all trials together; found {found}", file=study.folder)


def _inputs(study: Study | ToPredict) -> Iterable[str]:
    """Remarks on inputs; a muscle that is never stimulated is an InputError."""
    alone = isinstance(study, ToPredict)  # trials that nothing drives are then no oddity, but for a muscle at rest
    names = dict.fromkeys(n for t in study.trials for n in _stimuli(study, t) if n in PULSES or not alone)
    if not names and not alone and not any(t.kind == IMPOSED for t in study.trials):
        if study.schema.inputs_required:
            raise InputError(f"no trial is stimulated; {NEVER}", file=study.folder)
        column = " or ".join(study.schema.inputs)
        yield f"no trial is driven: there is no column {column}, and the motion is taken for free"
    for name in names:
        yield from _input(study, name, len(names) > 1)


def _input(study: Study | ToPredict, name: str, has_others: bool) -> Iterable[str]:
    """Remarks on one input, by the trials that it does not drive; with others a rate may be 0 throughout."""
    threshold = study.constants.get(CHANNELS[name].ends[0], 0.0) if name in CHANNELS else 0.0
    zero = f"never above the threshold of {threshold:g} {own_unit(name)}" if threshold else "zero throughout"
    trials = [t for t in study.trials if name in _stimuli(study, t)]
    idle = [t for t in trials if not (np.abs(t[name]) > threshold).any()]
    if len(idle) == len(trials):
        if name != RATE or not has_others:
            yield _undriven(study, name, threshold, f"{name} is {zero}")
    elif idle and name in PULSES:  # a joint may swing free between driven trials
        for trial in idle:
            check_values({name: trial[name]}, study.schema, trial.error, threshold)
        yield f"{name} is {zero} in {trials_named([t.name for t in idle])}"


def _undriven(study: Study | ToPredict, name: str, threshold: float, idle: str) -> str:
    """What is said of an input that drives no trial; InputError for a muscle that is never stimulated."""
    if name not in PULSES:
        return f"no trial is driven: {idle}"
    most = max(float(np.abs(t[name]).max()) for t in study.trials if name in t)
    if most == 0.0 and all(t.kind == IMPOSED for t in study.trials):
        return f"{idle} in all trials: the muscle is passive"
    is_short = name == WIDTH.column and 0.0 < most < SHORTEST_US
    if isinstance(study, ToPredict) and not is_short:
        return f"{idle}: nothing is stimulated"
    unit = "ms" if threshold < 1e3 * most else "s"
    hint = f" (it reaches {most:.4g}: is it in {unit}?)" if is_short else ""
    raise InputError(f"{idle} in all trials{hint}; {NEVER}", file=study.folder)


def _units(study: Study | ToPredict) -> Iterable[str]:
    """Ranges that another unit would explain."""
    for name, most, unit, small in (("force_n", STRONGEST_N, "N", "mN"), ("torque_nm", STRONGEST_NM, "N m", "mN m")):
        strong = [t.name for t in study.trials if name in t and float(np.abs(t[name]).max()) > most]
        if strong:
            limit = f"{most:g} {unit}, which no limb exerts"
            yield f"{name} is beyond {limit}, in {trials_named(strong)}: is it in {small}?"
    whole = [t.name for t in study.trials if t.dt >= 1.0 and (t.time == np.rint(t.time)).all()]
    if whole:
        yield f"time_s counts whole numbers in {trials_named(whole)}: is it in ms, or a number of the sample?"
    loads = {t.name: t.conditions.get("load_kg", 0.0) for t in study.trials}
    if max(loads.values(), default=0.0) > IMPOSSIBLE_KG:
        name = max(loads, key=lambda n: loads[n])
        message = f"trial {name}: load_kg is {loads[name]:.4g} kg; no ankle holds so much: is it in g?"
        raise InputError(message, file=study.folder, column="load_kg")
    if heavy := [name for name, load in loads.items() if load > HEAVIEST_KG]:
        yield f"load_kg is above {HEAVIEST_KG:g} kg in {trials_named(heavy)}: is it in g?"


def _imposed(study: Study | ToPredict) -> Iterable[str]:
    """Remarks on imposed motions; a motion that never moves is an InputError."""
    trials = [t for t in study.trials if t.kind == IMPOSED]
    if not trials or isinstance(study, ToPredict):
        return
    name = study.schema.imposed[0]
    motions = [imposed_motion(t, study.schema.imposed) for t in trials]
    moved = float(np.ptp(np.concatenate([m.values[0] for m in motions])))
    longest = max(float(np.abs(t[name]).max()) for t in trials)
    if not moved > max(STILL * max(m.std[0] for m in motions), 1e-9 * longest):
        message = f"{name} never moves in any imposed trial: nothing but noise of {motions[0].std[0]:.2g} is in it"
        raise InputError(message, file=study.folder, column=name)
    bands = [m.bandwidth_hz for m in motions]
    band = f"{min(bands):.2g} Hz" if max(bands) < 1.1 * min(bands) else f"{min(bands):.2g} to {max(bands):.2g} Hz"
    yield f"velocity and acceleration of {name} are those of smoothing splines with a bandwidth of {band}"
    yield from _unrepeated(study, [t for t in trials if not is_stimulated(t)])


def _unrepeated(study: Study, trials: Sequence[Trial]) -> Iterable[str]:
    """Efforts of trials that nothing stimulates and that differ between equal cycles of their imposed motion."""
    found = {t.name: effort_of_repeats(t, study.schema) for t in trials}
    if odd := {n: one for n, one in found.items() if one is not None and one.is_no_mechanism}:
        most = max(odd.values(), key=lambda one: one.share)
        effort = study.schema.outputs[IMPOSED]
        unit = own_unit(effort, is_revolute(study.urdf))
        differs = f"{effort} differs by {most.size:.2g} {unit} between equal cycles"
        share = f"{100.0 * most.share:.0f} % of what it does in one, in {trials_named(list(odd))}"
        yield f"{differs} of the motion, {share}: no passive mechanism does, so that voluntary effort is likely"


def _comes_to_rest(values: np.ndarray, at: np.ndarray) -> bool:
    """Return whether a column slows down before it stays at a value, and goes on as slowly: it was read, not held.

    Parameters
    ----------
    at
        Where it stays, shape (n,).
    """
    steps = np.abs(np.diff(values))
    moved = steps[steps > 0.0]
    entered = steps[np.diff(at.astype(int)) != 0]
    if not len(moved) or not len(entered):
        return False
    return bool(np.median(entered) <= max(A_COUNT * moved.min(), SLOWLY * np.median(moved)))


def _is_clipped(trial: Trial, name: str) -> bool:
    """Return whether a column arrives at an extreme at speed, and stays far more often than it stays elsewhere."""
    values = trial[name]
    still = np.diff(values) == 0.0
    for extreme in (values.max(), values.min()):
        at = values[1:] == extreme
        if np.count_nonzero(at & still) < max(CLIPPED * len(values), RUN):
            continue
        elsewhere = still[~at]
        stays = len(elsewhere) and np.mean(still[at]) > 0.5 and np.mean(elsewhere) < COMMON
        if stays and not _comes_to_rest(values, values == extreme):
            return True
    return False


def _is_counted(trial: Trial, name: str) -> bool:
    """Return whether a column takes many values, all of them whole."""
    values = trial[name]
    return bool((values == np.rint(values)).all()) and len(np.unique(values)) > COUNTS


def dropouts(trial: Trial, name: str) -> list[str]:
    """Stretches in which a reading stands still and then jumps: what was not recorded, its last value held.

    Whatever stands still by itself goes on from where it stood; an encoder that is coarse stands still as often
    elsewhere, and steps by what it always steps by.
    """
    values = trial[name]
    steps = np.abs(np.diff(values))
    changes = np.flatnonzero(steps)
    if len(changes) < 2 * RUN:
        return []
    lengths = np.diff(np.r_[-1, changes])  # samples of each value but the last
    usual = float(np.quantile(lengths, 0.95))
    sizes = steps[changes]
    jump = JUMP * float(np.quantile(sizes, 0.99))
    found = np.flatnonzero((lengths >= max(SHORTEST, 3.0 * usual)) & (sizes > jump))
    if not len(found):
        return []
    first = int(changes[found[0]])
    begin = float(trial.time[first - lengths[found[0]] + 1])
    more = f", and {len(found) - 1} times more" if len(found) > 1 else ""
    held = f"{name} stays at {values[first]:.4g} for {lengths[found[0]]} samples from {begin:.4g} s on and then jumps"
    return [f"{held}{more} in trial {trial.name}: a dropout, its last value held?"]


def _held(trial: Trial, name: str) -> list[str]:
    """A reading that repeats its values: in step, as sampled at a lower rate, or once, as where a sensor drops out."""
    values = trial[name]
    changes = np.flatnonzero(np.diff(values) != 0.0)
    still = 1.0 - len(changes) / max(len(values) - 1, 1)
    every = np.diff(changes)
    if still > 0.4 and len(every) > 3 and (count := int(np.median(every))) > 1 and np.mean(every % count == 0) > 0.95:
        held = f"{name} changes only every {count} samples in trial {trial.name}"
        return [f"{held}: it was sampled more slowly, and held"]
    ends = np.r_[-1, changes, len(values) - 1]
    lengths = np.diff(ends)
    longest = int(np.argmax(lengths))
    inside = values[ends[longest] + 1]
    apart = 1.0 - (len(changes) + lengths[longest] - 1) / max(len(values) - 1, 1)
    if lengths[longest] >= RUN and apart < COMMON and values.min() < inside < values.max():
        rows = np.arange(len(values))
        if _comes_to_rest(values, (rows > ends[longest]) & (rows <= ends[longest + 1])):
            return []
        begin = float(trial.time[ends[longest] + 1])
        held = f"{name} stays at {inside:.4g} for {lengths[longest]} samples"
        return [f"{held} from {begin:.4g} s on in trial {trial.name}"]
    return []


def _rates(trials: Sequence[Trial]) -> Iterable[str]:
    """A measured velocity that is not the slope of its position, by the mean of each over pieces of a trial."""
    wrong: dict[str, list[str]] = {"is": [], "has": []}
    for trial in trials:
        if not {"position", "velocity"} <= set(trial.columns) or len(trial) < FEW:
            continue
        ends = np.linspace(0, len(trial) - 1, PIECES + 1).astype(int)
        slopes = np.diff(trial["position"][ends]) / np.diff(trial.time[ends])
        means = np.array([trial["velocity"][a : b + 1].mean() for a, b in itertools.pairwise(ends)])
        power, both = float(slopes @ slopes), float(slopes @ means)
        if power > 0.0 and not power / RATE_RATIO < both < power * RATE_RATIO:
            wrong["has" if power / RATE_RATIO < -both < power * RATE_RATIO else "is"].append(trial.name)
    if names := wrong["is"]:
        yield f"velocity is not the slope of position in {trials_named(names)}: is one of them in another unit?"
    if names := wrong["has"]:
        turned = "does one of them count the other way (scale = -1 in [columns])?"
        yield f"velocity has the other sign than the slope of position in {trials_named(names)}: {turned}"
