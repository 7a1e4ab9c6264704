"""`fes-pin body`: the modes of a walking body, which nerves control them, and the body to look at."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import Signature, signature
from pathlib import Path
from typing import Annotated

import typer

from fes_pin.cli.group import Commands, release_output
from fes_pin.data.errors import InputError

app = typer.Typer(cls=Commands, help="The walking body: modes, nerves, view.")


def _body_options(
    posture: Annotated[str, typer.Option(help="neutral, initial_contact, loading, mid_stance, ...")] = "mid_stance",
    mass: Annotated[float, typer.Option("--mass", help="kg")] = 72.6,
    height: Annotated[float, typer.Option("--height", help="m")] = 1.80,
    sex: Annotated[str, typer.Option(help="male or female: which segment table")] = "male",
    stance: Annotated[str, typer.Option(help="left or right: the foot on the ground")] = "right",
    segments: Annotated[Path | None, typer.Option(help="table of segments (JSON) instead of mass, height, sex")] = None,
    urdf: Annotated[Path | None, typer.Option(help="URDF of the body instead")] = None,
    slope: Annotated[
        tuple[float, float], typer.Option(help="alpha beta: horizontal parts of the ground's unit normal")
    ] = (0.0, 0.0),
    brace: Annotated[list[str] | None, typer.Option(help="orthosis or joint that is locked; may be repeated")] = None,
):
    """The linearized body that the options common to all commands name."""
    from fes_pin.body.build import Body
    from fes_pin.body.linearize import linearize
    from fes_pin.body.minimal_sets import ORTHOSES

    if segments is not None and urdf is not None:
        raise InputError("give a table of segments or a URDF, not both")
    if urdf is not None:
        body = Body.from_urdf(urdf)
    elif segments is not None:
        body = Body.from_segments(segments, stance)
    else:
        body = Body.from_subject(mass, height, sex, stance)
    linear = linearize(body, posture, slope)
    joints = [joint for name in brace or [] for joint in ORTHOSES.get(name, (name,))]
    return linear.brace(list(dict.fromkeys(joints))) if joints else linear


def _of_a_body(command: Callable) -> Callable:
    """The options of `_body_options` before the command's own; its first argument is what they make."""
    common = signature(_body_options, eval_str=True).parameters
    own = list(signature(command, eval_str=True).parameters.values())[1:]

    @wraps(command)
    def run(**given):
        return command(_body_options(**{name: given.pop(name) for name in common}), **given)

    run.__signature__ = Signature([*own, *common.values()])  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in (*own, *common.values())}
    return run


@app.command()
@_of_a_body
def modes(
    linear,
    goniometers: Annotated[bool, typer.Option("--goniometers", help="also the fewest that see every fall")] = False,
) -> None:
    """How the body falls and swings at a posture: the eigenpairs of A^-1 B."""
    typer.echo(f"{linear}\n\n{linear.modes()}")
    if goniometers:
        from fes_pin.body.observability import fewest_goniometers

        best = fewest_goniometers(linear)
        typer.echo(f"\nFewest goniometers that see every fall ({len(best)} such sets; the best):\n{best[0]}")


@app.command()
@_of_a_body
def nerves(
    linear,
    name: Annotated[list[str] | None, typer.Argument(help="nerves to use; all of the table if none is named")] = None,
    horizon: Annotated[float, typer.Option(help="time allowed to bring a mode back, s")] = 0.3,
    influence: Annotated[str | None, typer.Option(help="table of influence on `joints` or `modes`")] = None,
    map_to: Annotated[Path | None, typer.Option("--map", help="heat map of influence: image file")] = None,
    fewest: Annotated[bool, typer.Option("--fewest", help="search the fewest nerves (with the braces given)")] = False,
    max_braces: Annotated[int, typer.Option(help="with --fewest: try so many further orthoses (minutes)")] = 0,
    lean: Annotated[float, typer.Option(help="lean that the fewest nerves must hold, degrees")] = 1.0,
) -> None:
    """Which nerves control which modes, what they can hold, and the fewest that do."""
    from fes_pin.body.attainable import attainable
    from fes_pin.body.controllability import controllability
    from fes_pin.body.inputs import Inputs
    from fes_pin.body.minimal_sets import ORTHOSES, minimal_sets, pareto
    from fes_pin.muscles.nerve_inputs import subject_nerves
    from fes_pin.view.influence import influence_table, plot_influence

    chosen = subject_nerves(linear.body, name or ())
    result = controllability(linear, chosen, horizon)
    typer.echo(f"{linear}\n\n{result}\n")
    weak, strong = (
        attainable(linear, Inputs.of(chosen, linear).scaled(f)).least_lean_deg for f in chosen.strength_band
    )
    typer.echo(f"With these nerves {attainable(linear, chosen)}")
    typer.echo(
        f"Strengths are known to a factor of 1.8: the least of these leans is {weak:.1f} to {strong:.1f} degrees."
    )
    if influence is not None:
        typer.echo(f"\n{influence_table(result, influence)}")
    if map_to is not None:
        try:
            plot_influence(result, map_to)
        except (OSError, ValueError) as error:
            raise InputError(f"cannot be written: {str(error).splitlines()[0]}", file=map_to) from None
        typer.echo(f"wrote {map_to}")
    if fewest:
        free = [name for name, joints in ORTHOSES.items() if set(joints) <= set(linear.joint_names)]
        some = {"braces": free, "max_braces": max_braces} if max_braces else {"alternatives": 3}
        found = minimal_sets(linear, chosen, lean_deg=lean, **some)
        found = pareto(found) if max_braces else found
        typer.echo(f"\nFewest nerves that hold the posture and a lean of {lean:g} degrees in every fall:")
        typer.echo(
            "\n".join(map(str, found)) or "none of these nerves' sets does; brace more joints (--brace corset ...)"
        )


@app.command()
@_of_a_body
def view(
    linear,
    out: Annotated[Path | None, typer.Argument(help="HTML page to write")] = None,
    mode: Annotated[int | None, typer.Option(help="show this mode (1 falls fastest) in motion")] = None,
    nerve: Annotated[str | None, typer.Option(help="show what this nerve turns")] = None,
    walk: Annotated[Path | None, typer.Option(help="play OpenSim coordinates (CSV with q_<coordinate>, rad)")] = None,
    live: Annotated[bool, typer.Option("--live", help="serve it to a browser until interrupted")] = False,
) -> None:
    """A page with the body, or a live one: a posture, a mode in motion, a nerve's influence, or measured walking."""
    from fes_pin.muscles.nerve_inputs import subject_nerves
    from fes_pin.view.viewer import Scene, show_influence, show_mode

    if sum(choice is not None for choice in (mode, nerve, walk)) > 1:
        raise InputError("choose one of --mode, --nerve and --walk")
    if out is None and not live:
        raise InputError("give the page to write, or --live")
    if mode is not None:
        found = linear.modes()
        if not 1 <= mode <= len(found):
            raise InputError(f"must be between 1 and {len(found)}, got {mode}", column="--mode")
        scene = show_mode(linear, found[mode - 1])
    elif nerve is not None:
        scene = show_influence(linear, subject_nerves(linear.body, [nerve]), nerve)
    elif walk is not None:
        scene = _walking(linear.body, walk)
    else:
        scene = Scene(linear.body, caption=str(linear.body)).pose(linear.whole_posture)
    if out is not None:
        try:
            scene.write(out)
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}", file=out) from None
        typer.echo(f"wrote {out}")
    if live:
        _serve(scene)


def _serve(scene) -> None:
    from fes_pin.view.live import LiveViewer

    with LiveViewer() as viewer:
        viewer.show(scene)
        try:  # from the first sign that it can be interrupted
            typer.echo(f"{scene.caption}\n{viewer.url} (Ctrl-C ends it)")
            release_output()
            viewer.wait()
        except KeyboardInterrupt:
            typer.echo("ended")


def _walking(body, path: Path):
    import numpy as np

    from fes_pin.body.gait import pelvis_turns, postures_of_walk
    from fes_pin.body.joints import JOINT_NAMES
    from fes_pin.view.viewer import show_walk

    try:
        table = np.atleast_1d(np.genfromtxt(path, delimiter=",", names=True))
        columns = {name: table[name] for name in table.dtype.names or ()}
        time = columns["time"] if "time" in columns else columns["time_s"]
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InputError(f"cannot be read as coordinates: {str(error).splitlines()[0]}", file=path) from None
    if len(time) < 2 or not (np.diff(time) > 0.0).all():
        raise InputError("needs two or more samples, and times that rise", file=path)
    try:
        postures, turns = postures_of_walk(columns, body.stance, flat_foot=False), pelvis_turns(columns)
    except InputError as error:
        raise InputError(error.message, file=path, column=error.column) from None
    order = [JOINT_NAMES.index(name) for name in body.joint_names]
    rate = int(np.clip(round(1.0 / float(np.median(np.diff(time)))), 1, 120))
    return show_walk(body, postures[:, order], rate, f"{path.name} ({body.label})", turns)
