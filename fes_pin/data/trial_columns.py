"""What is asked of the columns of a trial's table: those of its rig and kind, in equal steps of time."""

from __future__ import annotations

import numpy as np

from fes_pin.data.recorded.hint import NEW_STUDY
from fes_pin.data.schema import RigSchema, is_like, unknown, unread
from fes_pin.data.table import Table, check_time


def checked_columns(
    table: Table, schema: RigSchema, kind: str, inputs_only: bool
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """A trial's columns by name, and its time, after all that is asked of them was checked."""
    _check_columns(table, schema, kind, inputs_only)
    check_time(table)
    _check_stimulus(table)
    return {name: table.column(name) for name in table.names[1:]}, table.values[:, 0]


def _check_columns(table: Table, schema: RigSchema, kind: str, inputs_only: bool) -> None:
    """Require the columns of this rig and kind, and no others: another unit and a likely typo are told as such."""
    if table.names[0] != "time_s":
        told = f"expected time_s as the first column, found {table.names[0][:40]!r}"
        raise table.error(f"{told}; {NEW_STUDY}", "time_s")
    known, stimuli = schema.columns_of(kind), schema.stimuli(kind)
    absent = [name for name in known if name not in table.names]
    for name in table.names:
        if name not in known and is_like(name, absent):
            raise table.error(unknown(name, absent), name)
    output, motion = schema.outputs[kind], schema.motion(kind)[:1]
    found = [name for name in stimuli if name in table.names]
    if schema.inputs_required and not found:
        raise table.error(f"missing; this rig needs {' or '.join(stimuli)}", stimuli[0])
    if len(found) > 1:
        raise table.error(f"expected one of {' and '.join(found)}, found both", found[1])
    for name in motion:
        if name not in table.names:
            raise table.error(f"missing; a trial of kind {kind} has its motion there", name)
    if output not in table.names and not inputs_only:
        raise table.error(f"missing; a trial of kind {kind} measures it", output)
    for name in table.names:
        if name not in known:
            raise table.error(_not_read(name, schema, kind), name)


def _not_read(name: str, schema: RigSchema, kind: str) -> str:
    """What to say of a column that a kind of trial does not read."""
    others = [one for one in schema.outputs if name in schema.columns_of(one)]
    if others:
        return f"is read in trials of kind {' and '.join(others)}, and this one is of kind {kind}"
    return unread(name, schema.columns_of(kind))


def _check_stimulus(table: Table) -> None:
    if "pulse_width_us" in table.names and (negative := table.column("pulse_width_us") < 0).any():
        sample = int(np.argmax(negative))
        width = table.column("pulse_width_us")[sample]
        raise table.error(f"expected a pulse width of at least 0 us, found {width:g}", "pulse_width_us", sample)
    if "stim" in table.names and (other := ~np.isin(table.column("stim"), (0.0, 1.0))).any():
        sample = int(np.argmax(other))
        raise table.error(f"expected 0 or 1, found {table.column('stim')[sample]:g}", "stim", sample)
