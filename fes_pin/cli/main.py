"""The command line: `fes-pin new-study | check | diagnose | predict | effects | ...`."""

from pathlib import Path
from typing import Annotated

import typer

from fes_pin.cli.allocate import allocate
from fes_pin.cli.body import app as body
from fes_pin.cli.cohort import cohort
from fes_pin.cli.compare import compare
from fes_pin.cli.contrast import contrast
from fes_pin.cli.datasets import datasets
from fes_pin.cli.group import App, name_files_in_utf8
from fes_pin.cli.options import (
    Exclude,
    FailOn,
    Force,
    Libraries,
    Limit,
    Seed,
    Trials,
    Why,
    fail_on,
    output,
    study_of,
)
from fes_pin.cli.out import pulses, urdf
from fes_pin.cli.own import check, new_study
from fes_pin.cli.predict import predict
from fes_pin.cli.progress import catalogue_with, print_result, print_text, progress, say_whose_code
from fes_pin.cli.verify import verify
from fes_pin.data.errors import InputError

app = App(pretty_exceptions_enable=False)
app.add_typer(body, name="body")
for command in (allocate, new_study, check, urdf, datasets, pulses, cohort, contrast, compare, predict, verify):
    app.command()(command)

DIAGNOSING = 0.8
"""Share of the time of `diagnose` before the report is drawn, about."""


def _print_version(is_asked: bool) -> None:
    if is_asked:
        from fes_pin import __version__

        typer.echo(f"fes-pin {__version__}")
        raise typer.Exit


@app.callback()
def before_any_command(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version, and end.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Functional electrical stimulation on Pinocchio: what a simulation gets wrong, and its cause by name."""
    from fes_pin import settings

    settings.check_settings()  # a wrong setting of the environment is said before any work


@app.command()
def diagnose(
    study: Annotated[Path, typer.Argument(help="Folder of a study, or its study.toml.")],
    out: Annotated[Path, output("Folder for diagnosis.json, model.toml and report.html.")],
    seed: Seed = 0,
    limit: Limit = None,
    thorough: Annotated[
        bool, typer.Option("--thorough", help="Both estimators of a joint with recorded efforts search.")
    ] = False,
    tables: Annotated[
        str | None, typer.Option(help="csv or parquet: also trajectories.csv, samples and predictions of both models.")
    ] = None,
    trials: Trials = None,
    exclude: Exclude = None,
    library: Libraries = None,
    force: Force = False,
    why: Why = None,
    fail: FailOn = None,
) -> None:
    """Show what the study's model gets wrong, name the cause, extend the model, measure the gain."""
    from fes_pin.data.outputs import Outputs
    from fes_pin.data.provenance import this_command
    from fes_pin.data.results import NEXT_FILE
    from fes_pin.data.table import SUFFIXES, check_table, table_bytes
    from fes_pin.diagnosis.replay import trajectories
    from fes_pin.diagnosis.result import Diagnosis
    from fes_pin.verdict.ask import REPORT_FILE, answer_names
    from fes_pin.verdict.ask import diagnose as find
    from fes_pin.view.report import answer_files

    catalogue = catalogue_with(library)
    measured = study_of(study, catalogue, trials, exclude)
    table = None if tables is None else f"trajectories.{tables}"
    if table is not None:
        if f".{tables}" not in SUFFIXES:
            raise InputError(f"expected csv or parquet, found {tables!r}", column="--tables")
        if measured.schema.owner is None:
            raise InputError("goes only with a rig; walking has no such tables", column="--tables")
        check_table(table)
    outputs = Outputs("diagnose", force)
    outputs.claim(out, (*answer_names(measured), *([table] if table else [])))  # said before any work
    with progress() as tell:
        to_be_said = [catalogue]

        def report(share: float, words: str) -> None:
            while to_be_said:  # now that the study is accepted: the line of an input error comes first
                say_whose_code(to_be_said.pop())
            tell(DIAGNOSING * share, words)

        brought = None if measured.schema.owner is None else catalogue
        found = find(measured, library=brought, seed=seed, limit=limit, progress=report, thorough=thorough)
        tell(DIAGNOSING, "report")
        files = answer_files(found.by_command(this_command()))
        if table is not None and isinstance(found, Diagnosis):
            trial, columns = trajectories(found)
            files[table] = table_bytes({"trial": trial, **columns}, table)
        tell(1.0, "done")
    old = {NEXT_FILE, *(f"trajectories{suffix}" for suffix in SUFFIXES)}
    outputs.write(out, files, without=old - set(files))  # what an earlier diagnosis proposed is not this one's
    print_result(found, [line for name in why or () for line in found.explain(name)])
    typer.echo(f"report: {out / REPORT_FILE}")
    fail_on(found.verdict, fail)


@app.command()
def effects(library: Libraries = None) -> None:
    """List the causes it knows, with stage, equation and parameters."""
    from fes_pin.faults.misread import DESCRIBED as MISREAD
    from fes_pin.models.describe import describe, described
    from fes_pin.walk.effect import STAGE
    from fes_pin.walk.effects import EFFECTS

    catalogue = catalogue_with(library)
    say_whose_code(catalogue)
    for one in catalogue.effects:
        print_text(describe(one))
    print_text(MISREAD)
    for cause in EFFECTS:
        sizes = {n: u for form in cause.forms() for n, u in zip(form.parameters, form.units, strict=True)}
        print_text(described(cause, STAGE, {n: f"[{unit or '1'}], absent at 0" for n, unit in sizes.items()}))


def main() -> None:
    """Run the command line; see `fes_pin.cli.group`."""
    name_files_in_utf8()
    app(prog_name="fes-pin")


if __name__ == "__main__":
    main()
