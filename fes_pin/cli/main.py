"""The command line: `fes-pin new-study | check | diagnose | predict | effects | ...`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fes_pin.cli.allocate import allocate
from fes_pin.cli.body import app as body
from fes_pin.cli.cohort import cohort
from fes_pin.cli.compare import compare
from fes_pin.cli.contrast import contrast
from fes_pin.cli.datasets import datasets
from fes_pin.cli.group import App
from fes_pin.cli.options import Exclude, Force, Libraries, Trials, output, study_of
from fes_pin.cli.out import pulses, urdf
from fes_pin.cli.own import check, new_study
from fes_pin.cli.predict import predict
from fes_pin.cli.progress import catalogue_with, progress, say_whose_code
from fes_pin.cli.walk import diagnose_walking, print_effects
from fes_pin.data.errors import InputError

if TYPE_CHECKING:
    from fes_pin.diagnosis.result import Diagnosis

app = App(pretty_exceptions_enable=False)
app.add_typer(body, name="body")
app.command()(allocate)
app.command()(new_study)
app.command()(check)
app.command()(urdf)
app.command()(datasets)
app.command()(pulses)
app.command()(cohort)
app.command()(contrast)
app.command()(compare)
app.command()(predict)

ANSWER = ("diagnosis.json", "model.toml", "report.html", "next_trial.csv")
"""What a diagnosis writes, the last where it proposes a trial."""
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
    seed: Annotated[int, typer.Option(min=0, help="Of simulated critical values and bootstrap intervals.")] = 0,
    limit: Annotated[
        float | None, typer.Option(min=0.0, help="Seconds of search; then the best set of causes so far is told.")
    ] = None,
    tables: Annotated[
        str | None, typer.Option(help="csv or parquet: also trajectories.csv, every sample beside both models.")
    ] = None,
    trials: Trials = None,
    exclude: Exclude = None,
    library: Libraries = None,
    force: Force = False,
) -> None:
    """Show what the study's model gets wrong, name the cause, extend the model, measure the gain."""
    from fes_pin.data.outputs import Outputs
    from fes_pin.data.tabular import SUFFIXES, check_table, table_bytes

    catalogue = catalogue_with(library)
    measured = study_of(study, catalogue, trials, exclude)
    table = None if tables is None else f"trajectories.{tables}"
    if table is not None:
        if f".{tables}" not in SUFFIXES:
            raise InputError(f"expected csv or parquet, found {tables!r}", column="--tables")
        check_table(table)
    outputs = Outputs("diagnose", force)
    outputs.check(out, (*ANSWER, *([table] if table else [])))  # what cannot be written is said before any work
    if measured.rig == "body":
        if tables is not None:
            raise InputError("goes only with a rig; walking has no such tables", column="--tables")
        with progress() as tell:
            verdict = diagnose_walking(measured, outputs, out, seed, limit, tell)
        typer.echo(f"{verdict}\nreport: {out / 'report.html'}")
        return
    from fes_pin.data.provenance import this_command
    from fes_pin.diagnosis.diagnosis import diagnose_joint as find
    from fes_pin.diagnosis.record import NEXT_FILE, by_command, diagnosis_files
    from fes_pin.diagnosis.trajectories import trajectories
    from fes_pin.view.report import report_html

    with progress() as tell:
        to_be_said = [catalogue]

        def told(share: float, words: str) -> None:
            while to_be_said:  # now that the study is accepted: nothing stands before the line of an input error
                say_whose_code(to_be_said.pop())
            tell(DIAGNOSING * share, words)

        found = find(measured, library=catalogue, seed=seed, limit=limit, progress=told)
        diagnosis = by_command(found, this_command())
        tell(DIAGNOSING, "report")
        files: dict[str, str | bytes] = {**diagnosis_files(diagnosis), "report.html": report_html(diagnosis)}
        if table is not None:
            names, columns = trajectories(diagnosis)
            files[table] = table_bytes({"trial": names, **columns}, table)
        tell(1.0, "done")
    old = {NEXT_FILE, *(f"trajectories{suffix}" for suffix in SUFFIXES)}
    outputs.write(out, files, without=old - set(files))  # what an earlier diagnosis proposed is not this one's
    _print_verdict(diagnosis)
    typer.echo(f"report: {out / 'report.html'}")


@app.command()
def effects(library: Libraries = None) -> None:
    """List the causes it knows, with stage, equation and parameters."""
    from fes_pin.diagnosis.misread import DESCRIBED as MISREAD
    from fes_pin.models.describe import describe

    catalogue = catalogue_with(library)
    say_whose_code(catalogue)
    for one in catalogue.effects:
        typer.echo(describe(one))
    typer.echo(MISREAD)
    print_effects()


def _print_verdict(diagnosis: Diagnosis) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    title, head, rows, notes = diagnosis.as_table()
    console = Console(width=None if sys.stdout.isatty() else 120, soft_wrap=not sys.stdout.isatty(), highlight=False)
    console.print(Text(title, style="bold"))
    if rows:
        table = Table(*head, box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
        for row in rows:
            table.add_row(*map(Text, row))
        console.print(table)
    for note in notes:
        console.print(Text(note))


def main() -> None:
    """Run the command line; see `fes_pin.cli.group`."""
    app(prog_name="fes-pin")


if __name__ == "__main__":
    main()
