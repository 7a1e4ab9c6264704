"""`fes-pin urdf` and `fes-pin pulses`: what a diagnosis found, for simulators and stimulators."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fes_pin.cli.options import Force, output


def urdf(
    model: Annotated[Path, typer.Argument(help="model.toml of a diagnosis of a joint.")],
    believed: Annotated[Path, typer.Argument(help="The URDF of its study.")],
    out: Annotated[Path, output("URDF to write.")],
    force: Force = False,
) -> None:
    """Write a fitted joint as URDF: inertia and weight as fitted, damping and friction in <dynamics>."""
    from fes_pin.data.outputs import Outputs
    from fes_pin.models.store import load_model
    from fes_pin.models.urdf_out import extended_urdf

    text, left_out, changed = extended_urdf(load_model(model), believed)
    Outputs("urdf", force).write_file(out, text)
    typer.echo(f"wrote {out}")
    if changed:
        typer.echo(changed)
    if left_out:
        typer.echo(f"URDF has no words for {', '.join(left_out)}: what is simulated with it lacks that")


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
    """Write a trial as a list of pulses within stated limits; one beyond them is refused."""
    from fes_pin.data.outputs import Outputs
    from fes_pin.data.pulses import PulseLimits, pulse_list
    from fes_pin.data.tabular import check_table, table_bytes
    from fes_pin.data.trial import read_trial

    check_table(out)
    limits = PulseLimits(max_width, max_rate, max_charge, current)
    given = read_trial(trial, rig="muscle", inputs_only=True)
    listed = pulse_list(given, limits, rate, width)
    Outputs("pulses", force).write_file(out, table_bytes(listed, out))
    typer.echo(f"wrote {len(listed['time_s'])} pulses to {out}")
