"""Checks of the time step, range and signs of trials against a model, before they are fitted or predicted."""

import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from fes_pin.data.by_itself import PULSES, STILL, before_pulses, resting
from fes_pin.data.errors import InputError, InputWarning
from fes_pin.data.plausibility import ToPredict, implausible, trials_named
from fes_pin.data.schema import IMPOSED
from fes_pin.data.study import Study
from fes_pin.data.trial import Trial
from fes_pin.data.urdf import impossible_inertias, stated_of_joint
from fes_pin.infer.levels import SEEN_DEVIATIONS
from fes_pin.models.conventions import answered_angle
from fes_pin.models.effects.coulomb_friction import STATED
from fes_pin.models.goals import check_no_goal
from fes_pin.models.model import Model
from fes_pin.models.rigs.ankle import Ankle
from fes_pin.models.rigs.base import RUN_OUT
from fes_pin.models.rigs.joint import Joint

Simulation = Callable[[Model, Trial], Trial]
"""Simulates a trial: `models.simulate.simulated_trial`, which this module cannot import."""
COARSE = 5.0
"""Longest time step, in time constants of the model: a first-order lag has then settled to less than a hundredth and
is not observable, even if its start value is wrong by half. Milliseconds in the column `time_s` give hundreds."""
SLOW_S = 0.1
"""Time step in s of a trial to predict above which a warning is given: 10 kHz in ms."""
SLOWEST_S = 1.0
"""Time step in s that is rejected: pulses come 20 to 50 times a second, and a limb swings about once."""
TURNS = 4.0
"""Turns from zero above which an angle is likelier in degrees: 4 turns are 25 rad, and 25 degrees a small swing."""
LONGEST_M = 10.0
"""Largest position and pendulum length in m in a laboratory; values in millimetres are larger."""
SWING = 2.0 * math.pi
"""Largest angle in rad between two turning points of a pendulum that is not driven: from upright round to upright."""
ROUNDED = 0.02
"""rad by which an angle may lie beyond what it can be: a degree of a goniometer's zero."""
ASKEW = 0.5
"""Angle in rad from hanging above which dry friction hardly holds a pendulum: half of its weight acts there."""
STICKS = 2.0
"""Static friction in sliding friction, at most (a round figure)."""
CALIBRATED = 0.01
"""Share of an actuator's limit within which an effort is no more than it: what a torque sensor is calibrated to."""
PEAK = 6.0
"""Deviations of the noise of an effort that no sample of a recording exceeds by chance: one in 1e9."""
SPIKE = 3
"""Samples beyond a limit that show an effort there: one or two are a spike."""

TURNED = -0.7
"""Correlation of reading and simulation at which the model would explain half of the variance with the sign changed."""


def odd_numbers(study: Study | ToPredict, model: Model, simulated: Simulation) -> list[str]:
    """Return warnings about a study, or about trials to predict, that need no fit, one line each.

    Raises
    ------
    InputError
        For data that allow no verdict, see `data.plausibility`; and for a time step much longer than the time constants
        of the model's start values.
    """
    check_no_goal(study, model.rig)
    odd = [*implausible(study), *_steps(study, model), *_range(study, model)]
    odd += _of_urdf(study, model) if isinstance(study, Study) and isinstance(model.rig, Joint) else []
    turned = [*_turned(study, model, simulated)]
    odd += answered_angle(study.trials, model.rig)
    odd += [] if any(words.startswith("angle_rad") for words in turned) else _of_ankle(study, model)
    return [*odd, *_swings(study, model), *turned, *_at_rest(study, model)]


def warn_of_odd_numbers(model: Model, trials: Sequence[Trial], simulated: Simulation) -> None:
    """Warn whoever called the caller of what is odd about trials, once and of all of it: see `odd_numbers`.

    What allows no verdict is warned of as well: a trial that can be simulated is.
    """
    try:
        odd = odd_numbers(ToPredict(trials, model.rig.described(), model.rig.constants), model, simulated)
    except InputError as error:
        odd = [str(error)]
    if odd:
        warnings.warn("\n".join(odd), InputWarning, stacklevel=3)


def _steps(study: Study | ToPredict, model: Model) -> Iterable[str]:
    slowest = max(study.trials, key=lambda t: t.dt)
    longest = max(t.duration for t in study.trials)
    if slowest.dt > SLOWEST_S:
        message = f"the time step of trial {slowest.name} is {slowest.dt:.4g} s; expected at most {SLOWEST_S:g} s"
        raise InputError(f"{message}: is time_s in ms?", file=study.folder, column="time_s")
    for name, constant in model.rig.time_constants({t.kind for t in study.trials}).items():
        said = f"the time step of trial {slowest.name} is {slowest.dt:.4g} s, and {name} {constant:.4g} s"
        # a constant that a fit found may be short, and that is no slip of units
        is_fitted = isinstance(study, ToPredict)
        if slowest.dt > COARSE * constant and not (is_fitted and slowest.dt < SLOW_S):
            message = f"{said}: is time_s in ms, or the value in [start] wrong?"
            raise InputError(message, file=study.folder, column="time_s")
        if slowest.dt > constant:
            yield f"{said}: what happens between samples is lost; is time_s in another unit?"
        if longest < constant and name != RUN_OUT:
            yield f"the longest trial lasts {longest:.4g} s, and {name} is {constant:.4g} s: is time_s in another unit?"


def _turned(study: Study | ToPredict, model: Model, simulated: Simulation) -> Iterable[str]:
    """Yield a warning for readings that fall where the muscle pulls."""
    if model.rig.constants.get("torque_sign", 1.0) < 0.0:
        yield "torque_nm falls where the muscle pulls: it is read with the opposite sign, as the torque on the ankle"
    found: dict[str, list[str]] = {}
    for trial in study.trials:
        name = model.rig.output(trial.kind)
        if trial.kind == IMPOSED or name not in trial or not any(n in trial and np.ptp(trial[n]) for n in PULSES):
            continue
        expected, measured = simulated(model, trial)[name], trial[name]
        if not np.isfinite(expected).all() or not np.ptp(expected) > 0.0 or not np.ptp(measured) > 0.0:
            continue
        if np.corrcoef(expected, measured)[0, 1] < TURNED:
            found.setdefault(name, []).append(trial.name)
    for name, names in found.items():
        yield f"{name} falls where it should rise in {trials_named(names)}: is its sign turned round (scale = -1)?"


def _of_urdf(study: Study, model: Model) -> list[str]:
    """Return what is taken from the URDF of a joint's study, and what of it contradicts the study, one line each."""
    if study.urdf is None:
        return []
    unit, stated = model.parameter_info()["damping"].unit, stated_of_joint(study.urdf)
    said = [f"the URDF, row {e.row}, link {e.column}: {e.message}" for e in impossible_inertias(study.urdf)]
    if stated.get("damping", 0.0) > 0.0 and study.start.get("damping") == stated["damping"]:
        said.append(f"damping starts at the URDF's {stated['damping']:.4g} {unit}")
    if STATED in model.rig.constants:
        known = f"dry friction of {model.rig.constants[STATED]:.4g} {model.rig.units()['effort']} is known of the URDF"
        said.append(f"{known}: coulomb_friction is what there is beyond it, below 0 what it is too much")
    if (most := stated.get("effort")) is not None:
        said += _beyond(study, most, model.rig.units()["effort"])
    return said


def _beyond(study: Study, most: float, unit: str) -> Iterable[str]:
    """Yield a warning for efforts beyond the limit of an actuator, by more than their noise and longer than a spike."""
    found = dict[str, float]()
    for trial in study.trials:
        if "effort" not in trial or len(trial) < SPIKE:
            continue
        size = np.abs(trial["effort"])
        noise = 1.4826 * float(np.median(np.abs(np.diff(trial["effort"], 2)))) / math.sqrt(6.0)
        if np.sum(size > most * (1.0 + CALIBRATED) + PEAK * noise) >= SPIKE:
            found[trial.name] = float(size.max())
    if found:
        said = f"the effort goes to {max(found.values()):.4g} {unit} in {trials_named([*found])}"
        yield f"{said}, and the URDF's limit is {most:.4g}: is its unit another, or that limit a placeholder?"


def _range(study: Study | ToPredict, model: Model) -> Iterable[str]:
    if "revolute" not in model.rig.constants:
        return
    most = max((float(np.abs(t["position"]).max()) for t in study.trials if "position" in t), default=0.0)
    most = max(most, *(abs(t.conditions.get("position0", 0.0)) for t in study.trials))
    if model.rig.constants["revolute"] and _weight(model) > 0.0 and most > TURNS * 2.0 * math.pi:  # a wheel may turn on
        yield f"position reaches {most:.4g} rad, {most / (2.0 * math.pi):.1f} turns: is it in degrees?"
    if not model.rig.constants["revolute"] and most > LONGEST_M:
        yield f"position reaches {most:.4g} m: is it in mm?"


def _of_ankle(study: Study | ToPredict, model: Model) -> Iterable[str]:
    """Yield a warning for angles that no foot has to its leg: a dynamometer counts from the foot at right angles."""
    if not isinstance(model.rig, Ankle):
        return
    found = {t.name: t["angle_rad"] for t in study.trials if "angle_rad" in t}
    found |= {t.name: np.array([t.conditions["angle_rad"]]) for t in study.trials if "angle_rad" in t.conditions}
    odd = {name: q for name, q in found.items() if np.min(q) < -ROUNDED or np.max(q) > math.pi + ROUNDED}
    if odd:
        least, most = (math.degrees(f(f(q) for q in odd.values())) for f in (min, max))
        counts = "an ankle's counts from 0, folded back on the leg, over 90, hanging, to 180 degrees"
        how = "zero = -90 in [columns], or scale = -1 and zero = 90 of dorsiflexion, reads 0 at right angles as 90"
        yield f"angle_rad is {least:.3g} to {most:.3g} degrees in {trials_named([*odd])}: {counts}; {how}"


def _weight(model: Model) -> float:
    """Greatest moment of the weight of what a joint carries, N m; 0 of a balanced wheel."""
    return math.hypot(model.rig.constants.get("gravity_cos", 0.0), model.rig.constants.get("gravity_sin", 0.0))


def _swings(study: Study | ToPredict, model: Model) -> Iterable[str]:
    """Yield warnings for motion that no pendulum has by itself: wide swings, or rest off hanging."""
    c = model.rig.constants
    if not c.get("revolute") or not _weight(model) > 0.0 or model.parameters().get("gravity_scale", 1.0) == 0.0:
        return
    free = [t for t in study.trials if "position" in t and ("effort" not in t or not t["effort"].any())]
    if wide := [t.name for t in free if _widest_swing(t["position"]) > SWING]:
        yield f"position swings back by more than a turn, and nothing drives it, in trial {wide[0]}: is it in degrees?"
        return
    hangs = math.atan2(-c["gravity_cos"], c["gravity_sin"])
    rests = {t.name: end[0] for t in free if (end := resting(t, "position", slice(-len(t) // 10, None)))}
    if off := {n: rest for n, rest in rests.items() if math.cos(rest - hangs) < math.cos(ASKEW)}:
        said = f"position comes to rest at {_ends(off)} rad, and by the URDF it hangs at {hangs + 0.0:.4g}, in"
        zero = f"zero in [columns], {math.degrees(np.mean([*off.values()]) - hangs):.3g} of degrees"
        asks = f"is its zero elsewhere ({zero}), its sign another, or does a torque hold it?"
        yield f"{said} {trials_named([*off])}: {asks}"
        return
    length = c["inertia"] * 9.81 / _weight(model)
    if length > LONGEST_M:
        yield f"by its URDF the rig swings like a pendulum of {length:.4g} m: is the URDF in mm?"


def _at_rest(study: Study | ToPredict, model: Model) -> Iterable[str]:
    """Yield warnings for a force before the first pulse, and for an effort that neither gravity nor friction asks for.

    Friction is the work along a trial over its way.
    """
    found, c = dict[str, dict[str, float]](), model.rig.constants
    for trial in study.trials:
        if "force_n" in trial and trial.kind != IMPOSED:
            rest, free, rubs = before_pulses(trial, "force_n"), trial["force_n"], 0.0
            words = "the force is {} N before any pulse"
        elif {"effort", "position"} <= set(trial.columns) and "revolute" in c:
            angle, way = c["revolute"] * trial["position"], np.gradient(trial["position"])
            weight = c["gravity_cos"] * np.cos(angle) + c["gravity_sin"] * np.sin(angle)
            free = trial["effort"] - model.parameters().get("gravity_scale", 1.0) * weight
            rubs = STICKS * abs(float(free @ way)) / max(float(np.abs(way).sum()), 1e-300)
            rest = resting(trial.with_columns(effort=free), "effort", slice(len(trial) // 10))
            words = "the effort differs from gravity's by {} before anything moves (another zero of its sensor?)"
        else:
            continue
        if rest and abs(rest[0]) > max(SEEN_DEVIATIONS * rest[1], STILL * float(np.ptp(free)), rubs):
            found.setdefault(words, {})[trial.name] = rest[0]
    for words, some in found.items():
        yield f"{words.format(_ends(some))} in {trials_named([*some])}"


def _ends(found: Mapping[str, float]) -> str:
    """Return the least and the largest of some values, once where they are printed alike."""
    return " to ".join(dict.fromkeys(f"{v:.3g}" for v in (min(found.values()), max(found.values()))))


def _widest_swing(position: np.ndarray) -> float:
    """Return the largest angle between two turning points, rad; small ripples are no turning points."""
    from scipy.signal import find_peaks  # noqa: PLC0415 - half a second, for rigs under gravity alone

    ripple = 0.05 * float(np.ptp(position))
    turns = np.sort(np.concatenate([find_peaks(side * position, prominence=ripple)[0] for side in (1.0, -1.0)]))
    return float(np.max(np.abs(np.diff(position[turns.astype(int)])), initial=0.0))
