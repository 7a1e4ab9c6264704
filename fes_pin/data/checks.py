"""What is asked of a trial and of what a study says of its rig, wherever they come from.

The reader of a file and the objects themselves ask the same: a file adds its name, the row and the column, an object
the trial and the sample.
"""

import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from fes_pin.data.channels import CHANNELS, WIDTH
from fes_pin.data.errors import KeyFault
from fes_pin.data.motion import GROUND_REACTION, OPTIONAL, REQUIRED, TRANSLATIONS, knees_bend_positively
from fes_pin.data.schema import IMPOSED, ROLES, RigSchema, is_like, number_or_none, one_of, positive, unknown, unread
from fes_pin.data.table import Fault
from fes_pin.data.units import own_unit

LOW_PASS = "low_pass_hz"
LABELS = {"role": None, "group": None, LOW_PASS: None, "remarks": ()}
"""What is said of a trial but for name, kind and conditions, and what holds of one that says nothing."""
TURN = 2.0 * math.pi
"""Angle in rad that no joint turns by."""
JOINTS = tuple(f"q_{one}" for one in REQUIRED if one not in (*TRANSLATIONS, "pelvis_rotation"))
"""Angles of a walk, but for the heading: one may walk in circles."""
LONGEST_MUSCLE_M = 1.0
"""Length in m that no muscle with its tendon has: the longest, sartorius, comes to about half a metre."""
TOGETHER = ({"pulse_width_us", "amplitude_ma", "frequency_hz"}, {"charge_uc", "frequency_hz"})
"""Stimuli that one trial may hold together."""
BEYOND = 1e100
"""Nothing that is measured is so large in any unit. Sums of squares of such samples overflow."""
LARGEST = {"amplitude_ma": 500.0, "charge_uc": 1e4, "frequency_hz": 1e4, "emg_envelope": 10.0}
"""What no stimulator gives: of surface stimulators 150 mA is the most; a larger amplitude is in uA."""
SHORTEST_PULSE_US = 2.0
"""Pulse width in us that recruits nothing: surface stimulators give 50 to 1000 us, and 2 is a long one in ms."""
LONGEST_PULSE_US = 1e5
"""Pulse width in us that no nerve is given: as long as the pause between pulses at 10 Hz; 100 us in ns."""


def checked_mapping(value: Any, error: KeyFault, key: str) -> dict[Any, Any]:
    """Names with their values.

    Raises
    ------
    InputError
        Made by `error`, for anything else; for a name that is there twice, as of two columns of a frame.
    """
    if not callable(getattr(value, "items", None)):
        raise error(key, f"expected a mapping of names to values, found a {type(value).__name__}")
    pairs = list(value.items())
    if twice := [name for name, count in Counter(name for name, _ in pairs).items() if count > 1]:
        raise error(str(twice[0]), "this name is there twice; expected it once")
    return dict(pairs)


def checked_label(value: object, error: KeyFault, key: str = "group", what: str = "a label") -> str:
    """A name or label: one line of text.

    Raises
    ------
    InputError
        Made by `error`, for anything else.
    """
    if not (isinstance(value, str) and value.strip() and value.isprintable()):
        raise error(key, f"expected {what}, one line of text")
    return value


def checked_labels(name: object, said: Mapping[str, Any], error: KeyFault) -> dict[str, Any]:
    """The name of a trial, and what is `said` of it as a whole by the keys of LABELS; what is missing has its default.

    Raises
    ------
    InputError
        Made by `error`.
    """
    labels = {key: said.get(key, default) for key, default in LABELS.items()}
    checked_label(name, error, "name", "a name")
    if labels["role"] is not None:
        one_of(labels["role"], ROLES, partial(error, "role"))
    if labels["group"] is not None:
        checked_label(labels["group"], error)
    if not isinstance(labels["remarks"], Sequence) or isinstance(labels["remarks"], str):
        raise error("remarks", "expected texts, one for each remark")
    labels["remarks"] = tuple(checked_label(r, error, "remarks", "a remark") for r in labels["remarks"])
    labels[LOW_PASS] = number_or_none(labels[LOW_PASS], positive("Hz", False), LOW_PASS, error)
    return {"name": name, **labels}


def check_columns(names: Sequence[str], schema: RigSchema, kind: str, inputs_only: bool, error: Fault) -> None:
    """Require the columns of this rig and kind, and no others; the error names another unit or a likely typo.

    Parameters
    ----------
    names
        Of the columns, without the time.
    inputs_only
        Do not require the measured outputs.
    """
    if len(schema.recordings) > 1:
        _check_body_columns(names, inputs_only, error)
        return
    known = schema.columns_of(kind)[1:]
    absent = [name for name in known if name not in names]
    for name in names:
        if name not in known and is_like(name, absent):
            raise error(unknown(name, absent), name, None)
    _check_stimuli(names, schema, kind, error)
    needed = dict.fromkeys(schema.motion(kind)[:1], "has its motion there")
    if not inputs_only:
        needed[schema.outputs[kind]] = "measures it"
    for name, why in needed.items():
        if name not in names:
            raise error(f"missing; a trial of kind {kind} {why}", name, None)
    for name in names:
        if name not in known:
            raise error(_not_read(name, schema, kind), name, None)


def _check_stimuli(names: Sequence[str], schema: RigSchema, kind: str, error: Fault) -> None:
    """Require a stimulus of a rig that needs one, and no two that one trial may not hold together."""
    stimuli = schema.stimuli(kind)
    found = [name for name in stimuli if name in names]
    if schema.inputs_required and not found and kind != IMPOSED:
        raise error(f"missing; this rig needs {' or '.join(stimuli)}", stimuli[0], None)
    if len(found) > 1 and not any(set(found) <= together for together in TOGETHER):
        raise error(f"expected one of {' and '.join(found)}, found both", found[1], None)


def _check_body_columns(names: Sequence[str], inputs_only: bool, error: Fault) -> None:
    """Require the coordinates of a walk and its ground reaction; rates of coordinates may be there as well."""
    for name in (*(f"q_{one}" for one in REQUIRED), *(() if inputs_only else GROUND_REACTION)):
        if name not in names:
            raise error("missing", name, None)
    known = [f"q_{one}" for one in (*REQUIRED, *OPTIONAL)]
    for name in names:
        if name not in GROUND_REACTION and not name.startswith(("q_", "qd_", "qdd_")):
            raise error("unknown; expected q_<coordinate>, its rates qd_ and qdd_, and the ground reaction", name, None)
        if name.startswith("q_") and name not in known and is_like(name, known, cutoff=0.92):
            raise error(unknown(name, known), name, None)


def _not_read(name: str, schema: RigSchema, kind: str) -> str:
    """What to say of a column that a kind of trial does not read."""
    others = [one for one in schema.outputs if name in schema.columns_of(one)]
    if others and name != "time_s":
        return f"is read in trials of kind {' and '.join(others)}, and this one is of kind {kind}"
    return unread(name, schema.columns_of(kind))


def check_values(
    columns: Mapping[str, np.ndarray], schema: RigSchema, error: Fault, threshold_us: float = math.inf
) -> None:
    """Refuse what no stimulator, joint or muscle does: it is in another unit.

    Parameters
    ----------
    columns
        By name, each of shape (n,), finite.
    schema
        Of the rig.
    threshold_us
        Of its recruitment, where that is known: widths above it are in its unit.
    """
    if WIDTH.column in columns:
        _check_widths(columns[WIDTH.column], threshold_us, error)
    _check_sizes(columns, error)
    if "stim" in columns and (other := ~np.isin(columns["stim"], (0.0, 1.0))).any():
        sample = int(np.argmax(other))
        raise error(f"expected 0 or 1, found {columns['stim'][sample]:g}", "stim", sample)
    is_walk = len(schema.recordings) > 1
    if is_walk and knees_bend_positively(columns):
        raise error("its knees bend positively; expected flexion below 0, as gait2354 has it", "q_knee_angle_r", None)
    for name in JOINTS if is_walk else ("angle_rad",):
        if name in columns and (most := float(np.abs(columns[name]).max())) > TURN:
            message = f"reaches {most:.4g}; no {'joint' if is_walk else 'ankle'} turns so far: is it in degrees?"
            raise error(message, name, int(np.argmax(np.abs(columns[name]))))
    if "length_m" in columns:
        _check_lengths(columns["length_m"], error)


def _check_widths(width: np.ndarray, threshold_us: float, error: Fault) -> None:
    """Refuse widths of pulses, (n,), below 0 us, and those that are in ms, s or ns."""
    least, most = float(width.min()), float(width.max())
    if least < 0.0:
        message = f"expected a pulse width of at least 0 us, found {least:g}"
        raise error(message, WIDTH.column, int(np.argmax(width < 0.0)))
    if 0.0 < most <= min(SHORTEST_PULSE_US, threshold_us):
        message = f"reaches {most:.4g} us, and no pulse is so short: is it in {'ms' if most > 0.002 else 's'}?"
        raise error(message, WIDTH.column, int(np.argmax(width)))
    if most > LONGEST_PULSE_US:
        raise error(f"reaches {most:g} us, and no pulse is so long: is it in ns?", WIDTH.column, int(width.argmax()))


def _check_lengths(length: np.ndarray, error: Fault) -> None:
    """Refuse lengths of a muscle, (n,) m, of 0 and less, and those that are in mm."""
    if (most := float(length.max())) > LONGEST_MUSCLE_M:
        raise error(f"reaches {most:.4g} m; no muscle is so long: is it in mm?", "length_m", int(length.argmax()))
    if not (least := float(length.min())) > 0.0:
        raise error(f"is {least:.4g} m; expected the whole length, above 0", "length_m", int(length.argmin()))


def _check_sizes(columns: Mapping[str, np.ndarray], error: Fault) -> None:
    """Refuse amplitudes, charges and rates that no stimulator gives, and what nothing measures."""
    for name, values in columns.items():
        if (beyond := np.abs(values) >= BEYOND).any():
            sample = int(np.argmax(beyond))
            raise error(f"expected a number below {BEYOND:g}, found {values[sample]:g}", name, sample)
    for name, limit in LARGEST.items():
        if name in columns and ((columns[name] < 0.0) | (columns[name] > limit)).any():
            sample = int(np.argmax((columns[name] < 0.0) | (columns[name] > limit)))
            expected = f"expected 0 to {limit:g} {own_unit(name)}, found {columns[name][sample]:g}"
            raise error(expected, name, sample)


def check_constants(schema: RigSchema, constants: Mapping[str, float], files: Collection[str], error: KeyFault) -> None:
    """What the numbers and files of a rig must be together: a curve with two ends, a body with its size.

    Parameters
    ----------
    files
        Keys of the files that are there.
    """
    _check_recruitment(constants, error)
    if absent := [key for key in schema.either if key not in constants and not files]:
        expected = ", or ".join((" and ".join(schema.either), *schema.files))
        raise error(absent[0], f"missing; expected {expected}")
    for key, required in schema.files.items():
        if required and key not in files:
            raise error(key, "missing; expected the path of a file")


def _check_recruitment(constants: Mapping[str, float], error: KeyFault) -> None:
    """Require both ends of one channel's recruitment, saturation above threshold, where any end is stated."""
    stated = [c for c in CHANNELS.values() if any(end in constants for end in c.ends)]
    if len(stated) > 1:
        one, other = (c.ends[0] for c in stated[:2])
        raise error(other, f"expected the ends of recruitment in one unit, found {one} as well")
    for channel in stated:
        low, high = channel.ends
        if low not in constants or high not in constants:
            raise error(low if low not in constants else high, f"missing; {low} and {high} go together")
        if constants[high] <= constants[low]:
            message = f"expected a saturation above the threshold of {constants[low]:g} {channel.unit}"
            raise error(high, f"{message}, found {constants[high]:g}")


def check_same_inputs(
    trials: Sequence[tuple[str, Mapping[str, np.ndarray]]],
    schema: RigSchema,
    constants: Collection[str],
    error: Callable,
) -> None:
    """What only all trials together show: the same inputs in each, and a recruitment curve for what recruits.

    A trial whose motion is imposed may be without a stimulus. What is 0 in all trials needs no curve.

    Parameters
    ----------
    trials
        Kind and columns of each.
    constants
        Those that the rig has.
    error
        Makes the error of a trial's place (None: of the rig), a key and a message.
    """
    given = [(k, kind, columns) for k, (kind, columns) in enumerate(trials) if _is_driven(kind, columns, schema)]
    first = {kind: columns for _, kind, columns in reversed(given)}
    for place, kind, columns in given:
        for column in schema.stimuli(kind) if len(schema.recordings) == 1 else ():
            if (column in columns) != (column in first[kind]):
                there, others = ("has", "has not") if column in columns else ("lacks", "has it")
                message = f"this trial {there} the column {column} and the first {others}; expected all or none"
                raise error(place, schema.recordings[0], message)
    for channel in CHANNELS.values():
        name, low = channel.column, channel.ends[0]
        if low not in constants and any(name in columns and np.any(columns[name]) for _, columns in trials):
            raise error(None, low, f"missing; trials with {name} need threshold and saturation")


def _is_driven(kind: str, columns: Collection[str], schema: RigSchema) -> bool:
    """Return whether a trial must hold what the others do: all but an imposed motion without a stimulus."""
    return kind != IMPOSED or any(n in columns for n in schema.stimuli(kind))
