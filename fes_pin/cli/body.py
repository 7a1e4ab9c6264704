"""`fes-pin body`: the modes of a walking body, which nerves control them, and the body to look at."""

from collections.abc import Callable
from functools import wraps
from inspect import Signature, signature
from pathlib import Path
from typing import Annotated

import typer

from fes_pin.cli.group import App, needs, python_names, release_output
from fes_pin.cli.options import Force, output
from fes_pin.cli.progress import print_text
from fes_pin.data.errors import InputError, errors_of
from fes_pin.data.numbers import between
from fes_pin.data.outputs import HTML, Outputs

app = App(help="The walking body: modes, nerves, view.")


def _body_options(
    posture: Annotated[
        str, typer.Option(help="to stand in: standing (both feet), one_leg, neutral; of a walk: mid_stance, ...")
    ] = "mid_stance",
    mass: Annotated[float | None, typer.Option("--mass", help="kg; 72.6 by default")] = None,
    height: Annotated[float | None, typer.Option("--height", help="m; 1.80 by default")] = None,
    sex: Annotated[str | None, typer.Option(help="male (default) or female: which segment table")] = None,
    stance: Annotated[str | None, typer.Option(help="left or right (default): the foot on the ground")] = None,
    segments: Annotated[Path | None, typer.Option(help="table of segments (JSON) instead of mass, height, sex")] = None,
    urdf: Annotated[Path | None, typer.Option(help="URDF of the body instead")] = None,
    slope: Annotated[
        tuple[float, float], typer.Option(help="alpha beta: horizontal parts of the ground's unit normal")
    ] = (0.0, 0.0),
    brace: Annotated[list[str] | None, typer.Option(help="orthosis or joint that is locked; may be repeated")] = None,
    passive: Annotated[float, typer.Option(help="passive torque of the legs: 1 healthy, 0 none")] = 0.0,
):
    """The linearized body that the options common to all commands name."""
    from fes_pin.body.build import Body
    from fes_pin.body.linearize import linearize
    from fes_pin.body.minimal_sets import ORTHOSES
    from fes_pin.body.passive import PassiveLegs

    if urdf is not None:
        body = Body.from_urdf(urdf)
    elif segments is not None:
        body = Body.from_segments(segments, stance or "right")
    else:
        kg, m = 72.6 if mass is None else mass, 1.80 if height is None else height
        body = Body.from_subject(kg, m, sex or "male", stance or "right")
    legs = PassiveLegs(passive) if between(passive, 0.0, 10.0, "--passive") else None
    linear = linearize(body, posture, slope, passive=legs)
    joints = [joint for name in brace or [] for joint in ORTHOSES.get(name, (name,))]
    return linear.brace(list(dict.fromkeys(joints))) if joints else linear


def _of_a_body(command: Callable) -> Callable:
    """The options of `_body_options` before the command's own; its first argument is what they make."""
    common = signature(_body_options, eval_str=True).parameters
    own = list(signature(command, eval_str=True).parameters.values())[1:]

    @needs(**dict.fromkeys(("mass", "height", "sex"), "not urdf segments"), stance="not urdf", segments="not urdf")
    @python_names(mass_kg="--mass", height_m="--height")
    @wraps(command)
    def run(**given):
        return command(_body_options(**{name: given.pop(name) for name in common}), **given)

    vars(run)["__signature__"] = Signature([*own, *common.values()])
    return run


@app.command()
@_of_a_body
@needs(doubt="goniometers")
def modes(
    linear,
    goniometers: Annotated[bool, typer.Option("--goniometers", help="also the fewest that see every fall")] = False,
    doubt: Annotated[float, typer.Option(help="with --goniometers: greatest uncertainty of a fall, degrees")] = 1.0,
) -> None:
    """Show how the body falls and swings at a posture: the eigenpairs of A^-1 B."""
    from fes_pin.body.balance import place_of_weight

    lines = [f"{linear}\n{place_of_weight(linear)[1]}\n\n{linear.modes()}"]
    if goniometers:
        from fes_pin.body.observability import fewest_goniometers

        best = fewest_goniometers(linear, within_deg=doubt)
        fewest = f"Fewest goniometers that leave every fall known to {doubt:g} deg"
        lines.append(f"\n{fewest} ({len(best)} such sets; the best):\n{best[0]}")
    print_text("\n".join(lines))


@app.command()
@_of_a_body
@needs(max_braces="fewest", lean="fewest", constant="fewest")
def nerves(
    linear,
    name: Annotated[list[str] | None, typer.Argument(help="nerves to use; all of the table if none is named")] = None,
    horizon: Annotated[float, typer.Option(help="time allowed to bring a mode back, s")] = 0.3,
    influence: Annotated[str | None, typer.Option(help="table of influence on `joints` or `modes`")] = None,
    map_to: Annotated[Path | None, output("heat map of influence: image file", "--map")] = None,
    force: Force = False,
    fewest: Annotated[bool, typer.Option("--fewest", help="search the fewest nerves (with the braces given)")] = False,
    max_braces: Annotated[int, typer.Option(help="with --fewest: try so many further orthoses (minutes)")] = 0,
    lean: Annotated[float, typer.Option(help="lean that the fewest nerves must catch, degrees")] = 1.0,
    constant: Annotated[
        bool, typer.Option("--constant", help="with --fewest: the lean must be held by constant stimulation")
    ] = False,
    settle: Annotated[float, typer.Option(help="how far modes may be from the posture, degrees")] = 10.0,
    strength: Annotated[
        float | None,
        typer.Option(
            help="1: a healthy young adult's of this sex; without it that of paralysed, stimulated muscle, 0.5"
        ),
    ] = None,
) -> None:
    """Which nerves control which modes, what they can catch and hold, and the fewest that do."""
    from fes_pin.body.balance import place_of_weight
    from fes_pin.body.catchable import attainable, catchable
    from fes_pin.body.controllability import modal_controllability
    from fes_pin.body.inputs import Inputs
    from fes_pin.muscles.nerve_inputs import subject_nerves, whose_strength
    from fes_pin.view.influence import check_image, influence_image, influence_table

    if strength is not None:
        between(strength, 0.01, 10.0, "--strength")
    between(settle, 0.1, 90.0, "--settle")
    between(lean, 1e-3, 45.0, "--lean")
    between(max_braces, 0, 10, "--max-braces")
    outputs = Outputs("body nerves", force)
    if map_to is not None:  # what cannot be written is said before any work
        check_image(map_to)
        outputs.check_file(map_to)
    chosen = subject_nerves(linear.body, name or None, strength=strength)
    inputs = Inputs.of(chosen, linear)
    result = modal_controllability(linear, inputs, horizon)
    lines = [f"{linear}\n{place_of_weight(linear)[1]}\n\n{result}\n"]
    weak, strong = (attainable(linear, inputs.scaled(f), settle_deg=settle) for f in chosen.strength_band)
    held = attainable(linear, inputs, settle_deg=settle)
    low, high = (chosen.assumed_strength * f for f in chosen.strength_band)
    whose = f"of the strength of {whose_strength(linear.body)}"
    whose += " (paralysed, stimulated muscle)" if strength is None else ""
    lines.append(f"At {chosen.assumed_strength:g} {whose} {held}")
    if held.falling:
        leans = f"{weak.least_lean_deg:.1f} to {strong.least_lean_deg:.1f} degrees"
        lines.append(f"It may be {low:.2g} to {high:.2g}: the least of these leans is {leans}.")
        lines.append(f"With these nerves: {catchable(linear, inputs, settle)}")
    if influence is not None:
        lines.append(f"\n{influence_table(result, influence)}")
    if fewest:
        lines += _fewest(linear, inputs, lean, max_braces, "constant" if constant else "over_time", settle)
    if map_to is not None:
        outputs.write_file(map_to, influence_image(result, check_image(map_to)))
        lines.append(f"wrote {map_to}")
    print_text("\n".join(lines))


def _fewest(linear, inputs, lean: float, max_braces: int, stimulation: str, settle: float) -> list[str]:
    """Lines on the fewest nerves."""
    from fes_pin.body.minimal_sets import ORTHOSES, minimal_sets, pareto

    free = [name for name, joints in ORTHOSES.items() if set(joints) <= set(linear.joint_names)]
    some = {"braces": free, "max_braces": max_braces} if max_braces else {"alternatives": 3}
    found = minimal_sets(linear, inputs, lean_deg=lean, stimulation=stimulation, settle_deg=settle, **some)
    found = pareto(found) if max_braces else found
    what = "catch, over time," if stimulation == "over_time" else "hold, stimulated constantly,"
    none = "none of these nerves' sets does; brace more joints (--brace corset ...)"
    title = f"\nFewest nerves that keep the posture and {what} a lean of {lean:g} degrees in every fall:"
    return [title, *(map(str, found) if found else [none])]


@app.command()
@_of_a_body
@needs(posture="not walk", slope="not walk", brace="mode nerve", passive="mode")
def view(
    linear,
    page: Annotated[list[str] | None, typer.Argument(hidden=True)] = None,
    out: Annotated[Path | None, output("HTML page to write")] = None,
    mode: Annotated[int | None, typer.Option(help="show this mode (1 falls fastest) in motion")] = None,
    nerve: Annotated[str | None, typer.Option(help="show what this nerve turns")] = None,
    walk: Annotated[Path | None, typer.Option(help="play OpenSim coordinates (CSV with q_<coordinate>, rad)")] = None,
    live: Annotated[bool, typer.Option("--live", help="serve it to a browser until interrupted")] = False,
    force: Force = False,
) -> None:
    """A page with the body, or a live one: a posture, a mode in motion, a nerve's influence, or measured walking."""
    from fes_pin.muscles.nerve_inputs import subject_nerves
    from fes_pin.view.viewer import show_influence, show_mode, show_posture

    if page:
        expected = "expected --walk FILE to play coordinates, and --out PAGE.html for the page to write"
        raise InputError(f"found {page[0]!r}; {expected}")
    if sum(choice is not None for choice in (mode, nerve, walk)) > 1:
        raise InputError("choose one of --mode, --nerve and --walk")
    if out is None and not live:
        raise InputError("give the page to write, --out PAGE.html, or --live")
    if mode is not None:
        found = linear.modes()
        if not 1 <= mode <= len(found):
            raise InputError(f"must be between 1 and {len(found)}, got {mode}", column="--mode")
        scene = show_mode(linear, found[mode - 1])
    elif nerve is not None:
        chosen = subject_nerves(linear.body, [nerve])
        scene = show_influence(linear, chosen, chosen.names)
    elif walk is not None:
        scene = _walking(linear.body, walk)
    else:
        scene = show_posture(linear)
    if out is not None:
        Outputs("body view", force).write_file(out, scene.html(), HTML)
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
    from fes_pin.data.motion import read_coordinates
    from fes_pin.view.viewer import show_walk

    time, columns = read_coordinates(path)
    with errors_of(path):
        postures, turns = postures_of_walk(columns, body.stance, flat_foot=False), pelvis_turns(columns)
    rate = int(np.clip(round(1.0 / float(np.median(np.diff(time)))), 1, 120))
    return show_walk(body, postures, rate, f"{path.name} ({body.label})", turns)
