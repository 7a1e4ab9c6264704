"""`fes-pin allocate`: from wanted joint torques to pulse widths."""

from pathlib import Path
from typing import Annotated

import typer

from fes_pin.cli.group import needs
from fes_pin.cli.options import numbers_of, pairs
from fes_pin.cli.progress import print_found, print_text
from fes_pin.data.errors import InputError
from fes_pin.data.numbers import between

MOST_NM, MOST_DEG_S = 1e5, 1e4
"""No body's joint has more torque, N m, nor turns faster, degrees per second."""


def joint_numbers(words: list[str] | None, what: str, most: float) -> dict[str, float]:
    """Numbers by name from `name=number`.

    Raises
    ------
    InputError
        Not of that form, a joint that is none or is named twice, a number that is not finite or larger than `most`.
    """
    from fes_pin.body.joints import known_joint

    given = numbers_of(what, pairs(what, words))
    for name, number in given.items():
        known_joint(name)
        between(number, -most, most, f"{what} of {name}")
    return given


@needs(
    **dict.fromkeys(("angle", "rate", "least", "as_json", "threshold_us", "saturation_us"), "torque"), passive="walk"
)
def allocate(
    torque: Annotated[
        list[str] | None, typer.Argument(help="Wanted torques, joint=N m, such as left_knee_flexion=-40.")
    ] = None,
    nerve: Annotated[list[str] | None, typer.Option(help="A nerve to stimulate, repeatable; all by default.")] = None,
    angle: Annotated[list[str] | None, typer.Option(help="Posture, joint=degrees, repeatable.")] = None,
    rate: Annotated[list[str] | None, typer.Option(help="Its rates, joint=degrees per second, repeatable.")] = None,
    least: Annotated[float | None, typer.Option(help="Least reliable recruitment: off, or at least this.")] = None,
    strength: Annotated[
        float | None, typer.Option(help="Strength, 1 is a healthy adult's; paralysed muscle (0.5) by default.")
    ] = None,
    threshold_us: Annotated[float, typer.Option(help="Threshold of the recruitment curve, us.")] = 180.0,
    saturation_us: Annotated[float, typer.Option(help="Saturation of the recruitment curve, us.")] = 1000.0,
    walk: Annotated[
        Path | None, typer.Option(help="Instead of a torque: the folder of the measured walk; how much is attained.")
    ] = None,
    passive: Annotated[
        float | None,
        typer.Option(help="With --walk: what joints give by themselves, 1 for healthy legs; 0 by default."),
    ] = None,
    nerves: Annotated[bool, typer.Option(help="List the nerves and what they turn, and end.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="The answer to a torque as JSON.")] = False,
) -> None:
    """Pulse widths for wanted joint torques, what is short, and why."""
    from math import degrees, radians

    from fes_pin.allocation.allocate import allocate as solve
    from fes_pin.body.joints import joint_limits
    from fes_pin.muscles.nerves import STRONGEST, Nerves
    from fes_pin.muscles.recruitment import RANGES, LinearRecruitment

    _alone(walk=walk is not None, nerves=nerves, torques=bool(torque))
    if strength is not None:
        between(strength, 0.0, STRONGEST, "--strength")
    if least is not None:
        between(least, 0.0, 1.0, "--least")
    between(threshold_us, *RANGES["threshold_us"], "--threshold-us")
    between(saturation_us, *RANGES["saturation_us"], "--saturation-us")
    if threshold_us >= saturation_us:
        raise InputError(f"--threshold-us must lie below --saturation-us, got {threshold_us:g} and {saturation_us:g}")
    channels = Nerves(nerve or None, strength=strength)
    if nerves:
        print_text(str(channels))
        return
    if walk is not None:
        typer.echo(walk_table(walk, channels, 0.0 if passive is None else between(passive, 0.0, 10.0, "--passive")))
        return
    wanted = joint_numbers(torque, "a torque", MOST_NM)
    posture = {name: radians(value) for name, value in joint_numbers(angle, "--angle", 360.0).items()}
    for name, value in posture.items():
        low, high = joint_limits(name)
        if not low <= value <= high:
            raise InputError(f"--angle: {name} must lie within {degrees(low):.0f} to {degrees(high):.0f} degrees")
    rates = {name: radians(value) for name, value in joint_numbers(rate, "--rate", MOST_DEG_S).items()}
    curve = LinearRecruitment(threshold_us, saturation_us)
    answer = solve(wanted, channels, posture, least=least, recruitment=curve, v=rates or None)
    print_found(answer, as_json)


def _alone(walk: bool, nerves: bool, torques: bool) -> None:
    """One question at a time: a torque, --walk or --nerves."""
    asked = [word for word, given in (("a torque", torques), ("--walk", walk), ("--nerves", nerves)) if given]
    if not asked:
        raise InputError("no torque is wanted: give joint=N m, or --walk, or --nerves")
    if len(asked) > 1:
        raise InputError(f"choose one of {' and '.join(asked)}")


def walk_table(folder: Path, nerves, passive: float = 0.0) -> str:
    """Per joint of the measured walk: peak torque, rms shortfall, share of samples within 10 % of the peak."""
    import numpy as np

    from fes_pin.allocation.walk import allocate_walk
    from fes_pin.body.joints import JOINT_NAMES
    from fes_pin.body.measured_walk import read_walk
    from fes_pin.body.passive import PassiveLegs

    walk = read_walk(folder).active(PassiveLegs(passive))
    result = allocate_walk(walk.torque, nerves, walk.q, walk.rates, weights=walk.known.astype(float))
    low, high = (nerves.assumed_strength * factor for factor in nerves.strength_band)
    done = f"{len(walk.time)} samples, {nerves.n} channels, optimal to {result.residual.max():.0e}"
    strong = f"{nerves.assumed_strength:g} of a healthy adult's strength ({low:.2g} to {high:.2g})"
    lines = [f"{done}; {strong}", *nerves.held(walk.q)]
    lines.append(f"{'joint':28s}{'peak':>9s}{'short, rms':>12s}{'within 10 %':>13s}")
    for j in np.flatnonzero(walk.known):
        peak, short = np.abs(walk.torque[:, j]).max(), result.shortfall[:, j]
        share = (np.abs(short) <= max(0.1 * peak, 1.0)).mean()
        lines.append(f"{JOINT_NAMES[j]:28s}{peak:6.1f} Nm{np.sqrt((short**2).mean()):9.1f} Nm{100 * share:11.0f} %")
    return "\n".join(lines)
