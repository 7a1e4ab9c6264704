"""`fes-pin urdf` and `fes-pin pulses`: what a diagnosis found, for simulators and stimulators."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fes_pin.cli.group import python_names
from fes_pin.cli.options import Force, Libraries, output
from fes_pin.cli.progress import catalogue_with, say_whose_code
from fes_pin.data.outputs import URDF_ENDINGS, Outputs

if TYPE_CHECKING:
    from fes_pin.data.trial import Trial


@python_names(library="--library")
def urdf(
    model: Annotated[Path, typer.Argument(help="model.toml of a diagnosis of a joint.")],
    believed: Annotated[Path, typer.Argument(help="The URDF of its study.")],
    out: Annotated[Path, output("URDF to write.")],
    library: Libraries = None,
    force: Force = False,
) -> None:
    """Write a fitted joint as URDF: inertia and weight as fitted, damping and friction in <dynamics>."""
    from fes_pin.models.store import load_model
    from fes_pin.models.urdf_out import extended_urdf

    catalogue = catalogue_with(library)
    text, left_out, changed = extended_urdf(load_model(model, library=catalogue), believed)
    Outputs("urdf", force).write_file(out, text, URDF_ENDINGS)
    say_whose_code(catalogue)
    typer.echo(f"wrote {out}")
    if changed:
        typer.echo(changed)
    if left_out:
        typer.echo(f"URDF has no words for {', '.join(left_out)}: what is simulated with it lacks that")


@python_names(
    **{"limits.width_us": "--max-width", "limits.rate_hz": "--max-rate", "limits.charge_uc": "--max-charge"},
    **{"limits.current_ma": "--current", "rate_hz": "--rate", "width_us": "--width"},
)
def pulses(
    trial: Annotated[Path, typer.Argument(help="CSV of a trial with pulse_width_us or stim: next_trial.csv.")],
    out: Annotated[Path, output("CSV or Parquet to write, one row a pulse.")],
    max_width: Annotated[float, typer.Option(help="No pulse is wider, us.")],
    max_rate: Annotated[float, typer.Option(help="No pulses come faster, Hz.")],
    max_charge: Annotated[float, typer.Option(help="No pulse has more charge, uC.")],
    current: Annotated[float, typer.Option(help="Amplitude of the pulses, mA.")],
    rate: Annotated[float | None, typer.Option(help="Hz, for a trial of pulse widths.")] = None,
    width: Annotated[float | None, typer.Option(help="us, for a trial of single pulses.")] = None,
    force: Force = False,
) -> None:
    """Write a trial as a list of pulses within stated limits; a trial beyond them is an input error."""
    from fes_pin.data.pulses import PulseLimits, pulse_list
    from fes_pin.data.table import table_bytes

    limits, outputs = PulseLimits(max_width, max_rate, max_charge, current), Outputs("pulses", force)
    listed = pulse_list(_stimulated(trial), limits, rate, width)
    outputs.check_file(out)
    outputs.write_file(out, table_bytes(listed, out))
    typer.echo(f"wrote {len(listed['time_s'])} pulses to {out}")


def _stimulated(path: Path) -> Trial:
    """A trial of any rig that is stimulated, whatever else its file holds of the rig."""
    from dataclasses import replace

    from fes_pin.data.by_itself import PULSES
    from fes_pin.data.recorded.sniff import read_csv_or_hint
    from fes_pin.data.schema import known_rigs, schema_of
    from fes_pin.data.trial_files import read_trial

    names = set(read_csv_or_hint(path).names)
    kinds = [(one, kind) for one in known_rigs().values() for kind in one.outputs]
    pulsed = [(one, kind) for one, kind in kinds if set(PULSES) & set(one.stimuli(kind))]
    fits = [(one, kind) for one, kind in pulsed if names <= set(one.columns_of(kind))]
    schema, kind = fits[0] if fits else (schema_of("muscle"), None)
    return read_trial(path, rig=replace(schema, needed={}), kind=kind, inputs_only=True)
