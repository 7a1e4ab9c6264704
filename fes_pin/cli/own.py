"""`fes-pin new-study` and `fes-pin check`: somebody's own recordings as a study, and what it can show."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fes_pin.cli.group import needs, release_output
from fes_pin.cli.options import Exclude, Libraries, Trials, offered, output, pairs, study_of
from fes_pin.cli.progress import catalogue_with, print_found, print_text
from fes_pin.data.as_read import HeldFile
from fes_pin.data.errors import InputError
from fes_pin.data.files import check_folder, read_bytes
from fes_pin.data.outputs import Outputs
from fes_pin.data.schema import RigSchema, known_rigs, one_of
from fes_pin.data.urdf import check_inertias

if TYPE_CHECKING:
    from fes_pin.data.new_study import NewStudy
    from fes_pin.data.study import Study
    from fes_pin.data.wanted import Wanted
    from fes_pin.models.catalogue import Catalogue


@needs(
    **dict.fromkeys(
        (
            *("urdf", "rig", "name", "column", "setting", "role", "group", "resample", "fill", "library"),
            *("source", "offset", "split", "names", "header_row", "first_row", "transposed", "sheet"),
        ),
        "files",
    ),
    upright="pendulum rod",
)
def new_study(
    files: Annotated[list[Path] | None, typer.Argument(help="Recordings, one a trial.")] = None,
    rig: Annotated[
        str | None,
        typer.Option(
            help="ankle, body, joint, muscle, or a rig of your own. [default: joint]",
            autocompletion=offered(known_rigs),
        ),
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
    wheel: Annotated[
        float | None, typer.Option(metavar="INERTIA", help="Write a URDF: a balanced wheel or rotor; kg m2.")
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
    source: Annotated[
        list[str] | None,
        typer.Option(help="Several files a trial: motor=*_motor, force=*_force; columns are then motor.NAME."),
    ] = None,
    offset: Annotated[
        list[str] | None, typer.Option(help="Added to the times of a source, s: force=0.004, or force=fit.")
    ] = None,
    split: Annotated[
        str | None,
        typer.Option(help="Several trials a file: restarts, holes, rests, a column that changes, columns; or none."),
    ] = None,
    fill: Annotated[bool, typer.Option("--fill", help="Fill in short gaps of missing samples.")] = False,
    names: Annotated[str | None, typer.Option(help="Of the columns of text files: t,angle,torque.")] = None,
    header_row: Annotated[int | None, typer.Option(min=0, help="Line of the names; 0 for none.")] = None,
    first_row: Annotated[int | None, typer.Option(min=1, help="Line of the first numbers.")] = None,
    sheet: Annotated[
        str | None, typer.Option(metavar="NAME", help="Of a spreadsheet, where one of several is meant.")
    ] = None,
    transposed: Annotated[
        bool, typer.Option("--transposed", help="Each line of the files holds one quantity.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Write over a study.toml that is there, and a URDF that was changed.")
    ] = False,
    library: Libraries = None,
) -> None:
    """Make a study of your own recordings, which stay as they are: reads headers, writes study.toml, checks it.

    With --pendulum, --rod, --slide or --wheel and no recordings it writes the URDF alone.
    """
    from fes_pin.data.direction import LEFT_OUT
    from fes_pin.data.new_body_study import new_body_study
    from fes_pin.data.new_recording import rig_held
    from fes_pin.data.new_study import new_study as make
    from fes_pin.data.new_study import with_kind
    from fes_pin.data.new_view import offsets_of
    from fes_pin.data.wanted import Wanted
    from fes_pin.diagnosis.checked import odd_lines
    from fes_pin.models.nominal import guess_start

    template = _template({"pendulum": pendulum, "rod": rod}, {"slide": slide, "wheel": wheel}, upright)
    if template is not None and urdf is not None:
        raise InputError("expected one of --urdf, --pendulum, --rod, --slide and --wheel, found several")
    believed = template or urdf
    if not files:
        if template is None:
            raise InputError("expected recordings, or --pendulum LENGTH MASS for a URDF alone")
        Outputs("new-study", force).write(out or Path(), {template.name: read_bytes(template)})
        typer.echo(f"wrote {(out or Path()) / template.name}")
        return
    catalogue, columns, settings = catalogue_with(library), pairs("--column", column), pairs("--set", setting)
    form = _form(names, header_row, first_row, transposed, sheet)
    held = None if rig or believed else rig_held(files, known_rigs(catalogue.schemas()).values(), form)
    if held is not None:
        rig = held.name
        typer.echo(f"the files hold a stimulus and a reading of rig {rig}; --rig names another")
    schema = _schema(rig, catalogue, believed, (columns, resample, fill, form))
    if resample == 0.0:
        raise InputError("expected a rate above 0 Hz", column="--resample")
    folder = _folder(files, out, force)
    wanted = Wanted(
        tuple(files),
        schema,
        folder,
        name or folder.absolute().name or "study",
        urdf=believed,
        columns=columns,
        kind=None if schema.owner is None else settings.pop("kind", None),
        settings=settings,
        labels={"role": pairs("--role", role), "group": pairs("--group", group)},
        resample_hz=resample,
        fill=fill,
        sources=pairs("--source", source),
        split=split,
        offsets=offsets_of(pairs("--offset", offset)),
        form=form,
        ask=_ask if sys.stdin.isatty() and sys.stdout.isatty() else None,
        say=_say,
    )
    if schema.owner is None:
        made = new_body_study(wanted)
    else:
        made = make(wanted, lambda known, columns: guess_start(schema.owner, known, believed, columns))
    outputs = Outputs("new-study", force)
    outputs.claim(folder, made.contents)
    study, warnings = _tried(made, wanted, catalogue)
    left_out = {r: t.kind for t in study.trials for r in t.remarks if r.startswith(LEFT_OUT)}
    for kind in left_out.values():
        made = with_kind(made, kind)
        study, warnings = _tried(made, wanted, catalogue)
    outputs.write(folder, made.contents)
    for own, theirs, unit in made.taken:
        typer.echo(f"{own:16s} is {theirs}{f', in {unit}' if unit else ''}")
    print_text("\n".join([*made.said, *left_out, *odd_lines(study, warnings)]))
    place = shlex.quote(str(folder))
    typer.echo(f"wrote {folder / 'study.toml'}: look at it, then run")
    typer.echo(f"  fes-pin check {place}\n  fes-pin diagnose {place} --out answer")


def check(
    study: Annotated[Path, typer.Argument(help="Folder of a study, or its study.toml.")],
    as_json: Annotated[bool, typer.Option("--json", help="The same as JSON.")] = False,
    trials: Trials = None,
    exclude: Exclude = None,
    library: Libraries = None,
) -> None:
    """Say what is odd about a study before anything is looked for, and what its trials can and cannot show."""
    from fes_pin.verdict.ask import check as find

    catalogue = catalogue_with(library)
    found = find(study_of(study, catalogue, trials, exclude), library=catalogue)
    print_found(found, as_json)


def _template(
    turning: Mapping[str, tuple[float, float] | None], others: Mapping[str, float | None], upright: bool
) -> HeldFile | None:
    """The URDF that was asked for, which is on no disk."""
    from fes_pin.data import templates

    given: dict[str, tuple[Any, ...]] = {n: (*both, upright) for n, both in turning.items() if both is not None}
    given |= {n: (one,) for n, one in others.items() if one is not None}
    if len(given) > 1:
        raise InputError("expected one of --pendulum, --rod, --slide and --wheel, found several")
    for name, numbers in given.items():
        try:
            return HeldFile.holding(f"{name}.urdf", getattr(templates, name)(*numbers).encode())
        except InputError as error:
            raise InputError(error.message, column=f"--{name}") from None
    return None


def _folder(files: list[Path], out: Path | None, force: bool) -> Path:
    """The study's folder, which can be written, and has no study.toml that must not be written over."""
    doubles = [f for k, f in enumerate(files) if f.absolute() in [g.absolute() for g in files[:k]]]
    if doubles:
        raise InputError("was named twice", file=doubles[0])
    folder = out or Path(os.path.commonpath([file.absolute().parent for file in files]))
    check_folder(folder)
    if os.path.lexists(folder / "study.toml") and not force:
        raise InputError("is there already; --force writes over it", file=folder / "study.toml")
    return folder


def _schema(rig: str | None, catalogue: Catalogue, urdf: Path | None, of_rigs: Sequence[object]) -> RigSchema:
    """Return the numbers of the rig, with its URDF where it needs one; walking takes no options `of_rigs`."""
    rigs = known_rigs(catalogue.schemas())
    schema = rigs[one_of(rig or "joint", tuple(rigs), partial(InputError, column="--rig"))]
    if schema.owner is None and (urdf is not None or catalogue.origins() or any(of_rigs)):
        expected = "expected no URDF, --column, --resample, --fill, form of text files or --library for walking"
        raise InputError(expected, column="--rig")
    if schema.owner is not None and ("urdf" in schema.files) != (urdf is not None):
        wanted = "--urdf FILE, or --pendulum LENGTH MASS, --rod, --slide or --wheel" if urdf is None else "no URDF"
        raise InputError(f"expected {wanted} for rig {schema.name}", column="--urdf")
    if urdf is not None and schema.check_files is not None:
        schema.check_files({"urdf": urdf})
        check_inertias(urdf)
    return schema


def _form(
    names: str | None, header_row: int | None, first_row: int | None, transposed: bool, sheet: str | None
) -> dict[str, str | int | bool | tuple[str, ...]]:
    """What was said of how text files are written, by the keys of [columns.file]."""
    given = {
        "names": None if names is None else tuple(name.strip() for name in names.split(",")),
        "header_row": header_row,
        "first_row": first_row,
        "transposed": transposed or None,
        "sheet": sheet,
    }
    if header_row is not None and first_row is not None and first_row <= header_row:
        raise InputError(f"expected a line below the header in line {header_row}", column="--first-row")
    return {key: value for key, value in given.items() if value is not None}


def _say(text: str) -> None:
    release_output()
    print_text(text)


def _ask(question: str) -> str:
    release_output()
    return str(typer.prompt(question, default="", show_default=False))


def _tried(made: NewStudy, wanted: Wanted, catalogue: Catalogue) -> tuple[Study, list[str] | None]:
    """The study as it will be read, and what is odd about it, before anything of it is written where it belongs; of a
    walk, which takes inverse dynamics to judge, what was assumed on reading, or None.

    Raises
    ------
    InputError
        As `read_study`; of the files and options that were given, not of copies and of what is not written yet.
    """
    from fes_pin.data.study import study_of_text
    from fes_pin.diagnosis.checked import odd_numbers

    text = str(made.contents["study.toml"])
    try:
        study = study_of_text(text, wanted.folder, made.origins, catalogue.schemas())
        if all(trial.role == "held_out" for trial in study.trials):
            raise InputError("expected at least one trial to fit; all are held_out", column="--role")
        if study.schema.owner is None:
            return study, list(dict.fromkeys(words for trial in study.trials for words in trial.remarks)) or None
        return study, odd_numbers(study)[1]
    except InputError as error:
        if error.file != wanted.folder / "study.toml":
            raise
        raise InputError(error.message, column=_option_of(error.column or "", wanted, made)) from None


def _option_of(key: str, wanted: Wanted, made: NewStudy) -> str:
    """The option that said what stands under a key of a study.toml."""
    table, _, last = key.rpartition(".")
    if table == "study" or key == "rig.urdf":
        return f"--{last}"
    if key.startswith("columns."):
        column = key.split(".")[1]
        return f"--column {column}" if column != "file" else "--resample" if "resample" in last else "--fill"
    if table.startswith("trial[") and last in ("role", "group"):
        return f"--{last}"
    trial, _, within = table.partition(".")
    if within == "offset_s":
        return f"--offset {last}"
    if trial.startswith("trial[") and wanted.schema.owner is not None:
        return f"--set {made.files_of(int(trial[6:-1]))[0].name}:{within or last}"
    return f"--set {last}"
