"""`fes-pin allocate`: from wanted joint torques to pulse widths."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fes_pin.data.errors import InputError


def pairs(values: list[str], what: str) -> dict[str, float]:
    """Numbers by name from `name=number`.

    Raises
    ------
    InputError
        Not of that form.
    """
    result = {}
    for value in values:
        name, equal, number = value.partition("=")
        try:
            result[name.strip()] = float(number)
        except ValueError:
            equal = ""
        if not equal:
            raise InputError(f"{what} must read name=number, got {value!r}")
    return result


def allocate(
    torque: Annotated[
        list[str] | None, typer.Argument(help="Wanted torques, joint=N m, such as left_knee_flexion=-40.")
    ] = None,
    nerve: Annotated[list[str] | None, typer.Option(help="A nerve to stimulate, repeatable; all by default.")] = None,
    angle: Annotated[list[str] | None, typer.Option(help="Posture, joint=degrees, repeatable.")] = None,
    least: Annotated[float | None, typer.Option(help="Least reliable recruitment: off, or at least this.")] = None,
    strength: Annotated[float, typer.Option(help="Strength, 1 is the healthy adult of the table.")] = 1.0,
    threshold_us: Annotated[float, typer.Option(help="Threshold of the recruitment curve, us.")] = 180.0,
    saturation_us: Annotated[float, typer.Option(help="Saturation of the recruitment curve, us.")] = 1000.0,
    walk: Annotated[
        Path | None, typer.Option(help="Instead of a torque: the folder of the measured walk; how much is attained.")
    ] = None,
    passive: Annotated[
        float,
        typer.Option(help="With --walk: what joints give by themselves, 1 for healthy legs."),
    ] = 0.0,
    nerves: Annotated[bool, typer.Option(help="List the nerves and what they turn, and end.")] = False,
) -> None:
    """Pulse widths for wanted joint torques, what is short, and why."""
    from math import degrees, radians

    from fes_pin.allocate.allocate import allocate as solve
    from fes_pin.body.joints import known_joint, limits_of
    from fes_pin.muscles.nerves import Nerves
    from fes_pin.muscles.recruitment import LinearRecruitment

    channels = Nerves(tuple(nerve or ()), strength=strength)
    if nerves:
        typer.echo(str(channels))
        return
    if walk is not None:
        typer.echo(walk_table(walk, channels, passive))
        return
    if not torque:
        raise InputError("no torque is wanted: give joint=N m, or --walk, or --nerves")
    posture = {name: radians(value) for name, value in pairs(angle or [], "--angle").items()}
    for name, value in posture.items():
        low, high = limits_of(known_joint(name))
        if not low <= value <= high:
            raise InputError(f"{name} must lie within {degrees(low):.0f} to {degrees(high):.0f} degrees")
    curve = LinearRecruitment(threshold_us, saturation_us)
    typer.echo(str(solve(pairs(torque, "a torque"), channels, posture, least=least, recruitment=curve)))


def walk_table(folder: Path, nerves, passive: float = 0.0) -> str:
    """Per joint of the measured walk: peak torque, rms shortfall, share of samples within 10 % of the peak."""
    import numpy as np

    from fes_pin.allocate.walk import allocate_walk
    from fes_pin.body.joints import JOINT_NAMES
    from fes_pin.body.measured_walk import read_walk
    from fes_pin.body.passive import PassiveLegs

    if not 0.0 <= passive <= 10.0:
        raise InputError(f"--passive must lie between 0 and 10, got {passive}")
    walk = read_walk(folder).active(PassiveLegs(passive))
    result = allocate_walk(walk.torque, nerves, walk.q, weights=walk.known.astype(float))
    lines = [f"{len(walk.time)} samples, {nerves.n} channels, optimal to {result.residual.max():.0e}"]
    lines.append(f"{'joint':28s}{'peak':>9s}{'short, rms':>12s}{'within 10 %':>13s}")
    for j in np.flatnonzero(walk.known):
        peak, short = np.abs(walk.torque[:, j]).max(), result.shortfall[:, j]
        share = (np.abs(short) <= max(0.1 * peak, 1.0)).mean()
        lines.append(f"{JOINT_NAMES[j]:28s}{peak:6.1f} Nm{np.sqrt((short**2).mean()):9.1f} Nm{100 * share:11.0f} %")
    return "\n".join(lines)
