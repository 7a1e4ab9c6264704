"""`fes-pin new-study` and `fes-pin check`: somebody's own recordings as a study, and what it can show."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import tempfile
import tomllib
from collections.abc import Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fes_pin.cli.group import needs, release_output
from fes_pin.cli.options import Exclude, Libraries, Trials, output, pairs, study_of
from fes_pin.cli.progress import catalogue_with
from fes_pin.data.errors import InputError
from fes_pin.data.files import check_folder, write_files
from fes_pin.data.outputs import Outputs

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fes_pin.data.new_study import NewStudy
    from fes_pin.data.schema import RigSchema
    from fes_pin.data.study import Study
    from fes_pin.data.wanted import Wanted
    from fes_pin.models.catalogue import Catalogue


@needs(
    **dict.fromkeys(
        ("urdf", "rig", "name", "column", "setting", "role", "group", "resample", "fill", "library"), "files"
    ),
    upright="pendulum rod",
)
def new_study(
    files: Annotated[list[Path] | None, typer.Argument(help="Recordings, one a trial.")] = None,
    rig: Annotated[
        str | None, typer.Option(help="ankle, body, joint, muscle, or a rig of your own. [default: joint]")
    ] = None,
    urdf: Annotated[Path | None, typer.Option(help="Of a joint: the rig as it is believed to be.")] = None,
    pendulum: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="LENGTH MASS", help="Write a URDF: a mass on a light arm; m, kg."),
    ] = None,
    rod: Annotated[
        tuple[float, float] | None, typer.Option(metavar="LENGTH MASS", help="Write a URDF: a uniform rod; m, kg.")
    ] = None,
    slide: Annotated[
        float | None, typer.Option(metavar="MASS", help="Write a URDF: a carriage on a level rail; kg.")
    ] = None,
    upright: Annotated[bool, typer.Option("--upright", help="Position 0 is upright; else it hangs there.")] = False,
    out: Annotated[Path | None, output("Folder of the study. [default: where the recordings are]")] = None,
    name: Annotated[str | None, typer.Option(help="Of the study. [default: its folder's]")] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(help="position=Angle:deg, effort=Torque:Nm,scale=-1, time_s=rate=1000; velocity= takes none."),
    ] = None,
    setting: Annotated[
        list[str] | None,
        typer.Option("--set", help="A number: load_kg=1, a.csv:load_kg=1.5, rig.damping=0.1; kind=isometric."),
    ] = None,
    role: Annotated[
        list[str] | None, typer.Option(help="Of a trial: a.csv=held_out; with * of several: late*=held_out.")
    ] = None,
    group: Annotated[list[str] | None, typer.Option(help="Of a trial, for contrasts: before*=before.")] = None,
    resample: Annotated[
        float | None, typer.Option(min=0.0, help="Hz: interpolate times that are not equally spaced.")
    ] = None,
    fill: Annotated[bool, typer.Option("--fill", help="Fill in short gaps of missing samples.")] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Write over a study.toml that is there, and a URDF that was changed.")
    ] = False,
    library: Libraries = None,
) -> None:
    """Make a study of your own recordings, which stay as they are: reads headers, writes study.toml, checks it.

    With --pendulum, --rod or --slide and no recordings it writes the URDF alone.
    """
    from fes_pin.data.new_body_study import new_body_study
    from fes_pin.data.new_study import new_study as make
    from fes_pin.data.schema import IMPOSED
    from fes_pin.diagnosis.checked import odd_lines
    from fes_pin.models.catalogue import load_library
    from fes_pin.models.nominal import guess_start

    template = _template(pendulum, rod, slide, upright)
    if template is not None and urdf is not None:
        raise InputError("expected one of --urdf, --pendulum, --rod and --slide, found several")
    if not files:
        if template is None:
            raise InputError("expected recordings, or --pendulum LENGTH MASS for a URDF alone")
        Outputs("new-study", force).write(out or Path(), {template[0]: template[1]})
        typer.echo(f"wrote {(out or Path()) / template[0]}")
        return
    catalogue = load_library(*(library or []))
    given: dict[str, dict[str, str]] = {"columns": pairs("--column", column), "settings": pairs("--set", setting)}
    given |= {"role": pairs("--role", role), "group": pairs("--group", group)}
    with _urdf_file(template, urdf) as path:
        wanted = _wanted(files, rig, out, name, catalogue, template or urdf, path, resample, fill, given)
        check_folder(wanted.folder)
        if os.path.lexists(wanted.folder / "study.toml") and not force:
            raise InputError("is there already; --force writes over it", file=wanted.folder / "study.toml")
        if wanted.schema.owner is None:
            made = new_body_study(wanted)
        else:
            made = make(wanted, lambda known: guess_start(wanted.schema.owner, known, path))
    outputs = Outputs("new-study", force)
    outputs.check(wanted.folder, made.contents)
    study, warnings = _tried(made, wanted, catalogue)
    outputs.write(wanted.folder, made.contents)
    for own, theirs, unit in made.taken:
        typer.echo(f"{own:16s} is {theirs}{f', in {unit}' if unit else ''}")
    schema = wanted.schema
    if "motion" in made.kinds and schema.outputs.get(IMPOSED) in {own for own, _, _ in made.taken}:
        typer.echo(
            f"{schema.outputs[IMPOSED]} is taken as what drives it; where the motion drives: --set kind={IMPOSED}"
        )
    typer.echo("\n".join(odd_lines(study, warnings)))
    place = wanted.folder / "study.toml"
    typer.echo(
        f"wrote {place}: look at it, then run\n  {shlex.join(['fes-pin', 'check', str(wanted.folder)])}\n"
        f"  {shlex.join(['fes-pin', 'diagnose', str(wanted.folder)])} --out answer"
    )


def check(
    study: Annotated[Path, typer.Argument(help="Folder of a study, or its study.toml.")],
    as_json: Annotated[bool, typer.Option("--json", help="The same as JSON.")] = False,
    trials: Trials = None,
    exclude: Exclude = None,
    library: Libraries = None,
) -> None:
    """Say what is odd about a study before anything is looked for, and what its trials can and cannot show."""
    import json

    from fes_pin.diagnosis.checked import check as find

    catalogue = catalogue_with(library)
    found = find(study_of(study, catalogue, trials, exclude), library=catalogue)
    typer.echo(json.dumps(found.as_dict(), indent=1) if as_json else str(found))


def _template(
    pendulum: tuple[float, float] | None, rod: tuple[float, float] | None, slide: float | None, upright: bool
) -> tuple[str, str] | None:
    """Name and text of the URDF that was asked for."""
    from fes_pin.data import templates

    turning = {"pendulum": pendulum, "rod": rod}
    asked = {name: (*numbers, upright) for name, numbers in turning.items() if numbers is not None}
    given = {**asked, **({} if slide is None else {"slide": (slide,)})}
    if len(given) > 1:
        raise InputError("expected one of --pendulum, --rod and --slide, found several")
    for name, numbers in given.items():
        try:
            return f"{name}.urdf", getattr(templates, name)(*numbers)
        except InputError as error:
            raise InputError(error.message, column=f"--{name}") from None
    return None


@contextmanager
def _urdf_file(template: tuple[str, str] | None, urdf: Path | None) -> Iterator[Path | None]:
    """The rig's URDF as a file, a template's in a folder of its own for as long."""
    if template is None:
        yield urdf
        return
    with tempfile.TemporaryDirectory(prefix="fes-pin-") as folder:
        path = Path(folder) / template[0]
        path.write_text(template[1])
        yield path


def _wanted(
    files: list[Path],
    rig: str | None,
    out: Path | None,
    name: str | None,
    catalogue: Catalogue,
    urdf: Path | tuple[str, str] | None,
    urdf_file: Path | None,
    resample: float | None,
    fill: bool,
    given: Mapping[str, Mapping[str, str]],
) -> Wanted:
    from fes_pin.data.urdf import is_revolute
    from fes_pin.data.wanted import Wanted

    schema = _schema(rig, catalogue, urdf_file)
    if schema.owner is None and (urdf is not None or given["columns"] or resample or fill or catalogue.origins()):
        raise InputError("expected no URDF, --column, --resample, --fill or --library for walking", column="--rig")
    if resample == 0.0:
        raise InputError("expected a rate above 0 Hz", column="--resample")
    doubles = [f for k, f in enumerate(files) if f.absolute() in [g.absolute() for g in files[:k]]]
    if doubles:
        raise InputError("was named twice", file=doubles[0])
    folder = out or Path(os.path.commonpath([file.absolute().parent for file in files]))
    settings = dict(given["settings"])
    return Wanted(
        files=tuple(files),
        schema=schema,
        folder=folder,
        name=name or folder.absolute().name or "study",
        urdf=urdf,
        revolute=is_revolute(urdf_file),
        columns=given["columns"],
        settings=settings,
        kind=None if schema.owner is None else settings.pop("kind", None),
        labels={key: given[key] for key in ("role", "group")},
        resample_hz=resample,
        fill=fill,
        ask=_ask if sys.stdin.isatty() and sys.stdout.isatty() else None,
    )


def _schema(rig: str | None, catalogue: Catalogue, urdf: Path | None) -> RigSchema:
    """What is known of the rig, whose URDF is there where it needs one."""
    from fes_pin.data.schema import known_rigs, one_of

    rigs = known_rigs(catalogue.schemas())
    schema = rigs[one_of(rig or "joint", tuple(rigs), partial(InputError, column="--rig"))]
    if schema.owner is not None and ("urdf" in schema.files) != (urdf is not None):
        wanted = "--urdf FILE, or --pendulum LENGTH MASS, --rod or --slide" if urdf is None else "no URDF"
        raise InputError(f"expected {wanted} for rig {schema.name}", column="--urdf")
    if urdf is not None and schema.check_files is not None:
        schema.check_files({"urdf": urdf})
    return schema


def _ask(question: str) -> str:
    release_output()
    return str(typer.prompt(question, default="", show_default=False))


def _tried(made: NewStudy, wanted: Wanted, catalogue: Catalogue) -> tuple[Study, list[str]]:
    """The study as it will be read, and what is odd about it, before anything of it is written where it belongs.

    Raises
    ------
    InputError
        As `read_study`; of the files and options that were given, not of copies and of what is not written yet.
    """
    from fes_pin.data.study import read_study
    from fes_pin.diagnosis.checked import odd_numbers

    folder = wanted.folder
    with tempfile.TemporaryDirectory(prefix="fes-pin-") as scratch:
        try:
            study = read_study(_staged(made, folder, Path(scratch)), rigs=catalogue.schemas())
            return study, odd_numbers(study)[1]
        except InputError as error:
            if error.file is None or not Path(error.file).is_relative_to(scratch):
                raise
            place = Path(error.file).relative_to(scratch).as_posix()
            if place == "study.toml":
                raise InputError(error.message, column=_option_of(error.column or "", wanted)) from None
            file = folder if place == "." else made.origins.get(place, folder / place)
            raise InputError(error.message, file=file, row=error.row, column=error.column) from None


def _option_of(key: str, wanted: Wanted) -> str:
    """The option that said what stands under a key of a study.toml."""
    table, _, last = key.rpartition(".")
    if table == "study" or key == "rig.urdf":
        return f"--{last}"
    if key.startswith("columns."):
        column = key.split(".")[1]
        return f"--column {column}" if column != "file" else "--resample" if "resample" in last else "--fill"
    if table.startswith("trial[") and last in ("role", "group"):
        return f"--{last}"
    if table.startswith("trial[") and wanted.schema.owner is not None:
        return f"--set {wanted.files[int(table[6:-1])].name}:{last}"
    return f"--set {last}"


def _staged(made: NewStudy, folder: Path, scratch: Path) -> Path:
    """A folder like the study's to be: what is made lies in it, and a copy of what stays where it is."""
    text = made.contents["study.toml"]
    assert isinstance(text, str)
    rig = tomllib.loads(text).get("rig", {})
    for place in [*made.origins, *([rig["urdf"]] if "urdf" in rig else [])]:
        if place not in made.contents:
            target = scratch / place
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(folder / place, target)
    write_files(scratch, made.contents)
    return scratch
