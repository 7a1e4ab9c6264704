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
from fes_pin.cli.options import Force, Libraries, output, pairs
from fes_pin.cli.out import pulses, urdf
from fes_pin.cli.own import check, new_study
from fes_pin.cli.progress import catalogue_with, progress, say_whose_code
from fes_pin.cli.walk import diagnose_walking, print_effects

if TYPE_CHECKING:
    from fes_pin.data.trial import Trial
    from fes_pin.diagnosis.result import Diagnosis
    from fes_pin.models.model import Model

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
    library: Libraries = None,
    force: Force = False,
) -> None:
    """Show what the study's model gets wrong, name the cause, extend the model, measure the gain."""
    from fes_pin.data.errors import InputError
    from fes_pin.data.outputs import Outputs
    from fes_pin.data.study import read_study
    from fes_pin.data.tabular import SUFFIXES, check_table, table_bytes

    catalogue = catalogue_with(library)
    measured = read_study(study, rigs=catalogue.schemas())
    table = None if tables is None else f"trajectories.{tables}"
    if table is not None:
        if f".{tables}" not in SUFFIXES:
            raise InputError(f"expected csv or parquet, found {tables!r}", column="--tables")
        check_table(table)
    outputs = Outputs("diagnose", force)
    outputs.check(out, (*ANSWER, *([table] if table else [])))  # what cannot be written is said before any work
    if measured.rig == "body":
        if library:
            raise InputError("--library brings causes of rigs; walking has none but its own")
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
            trials, columns = trajectories(diagnosis)
            files[table] = table_bytes(columns, table, {"trial": trials})
        tell(1.0, "done")
    old = {NEXT_FILE, *(f"trajectories{suffix}" for suffix in SUFFIXES)}
    outputs.write(out, files, without=old - set(files))  # what an earlier diagnosis proposed is not this one's
    _print_verdict(diagnosis)
    typer.echo(f"report: {out / 'report.html'}")


@app.command()
def predict(
    model: Annotated[Path, typer.Argument(help="model.toml of a diagnosis.")],
    trial: Annotated[Path, typer.Argument(help="CSV with time_s and the inputs, or as --columns-of says.")],
    out: Annotated[Path, output("CSV or Parquet to write: time_s and what is predicted.")],
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="A condition of the trial: load_kg=1.5, kind=isometric ...")
    ] = None,
    columns_of: Annotated[
        Path | None, typer.Option(help="A study whose [columns] says how the trial's file is written.")
    ] = None,
    residuals: Annotated[
        bool, typer.Option("--residuals", help="Also what was measured, and measured minus predicted.")
    ] = False,
    horizon: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="SECONDS",
            help="Foretell each sample from what the trial measured up to so long before it.",
        ),
    ] = None,
    library: Libraries = None,
    force: Force = False,
) -> None:
    """Predict a trial from its inputs with a saved model, or so far ahead along a trial that has its outputs."""
    from fes_pin.data.errors import InputError
    from fes_pin.data.outputs import Outputs
    from fes_pin.data.study import read_columns
    from fes_pin.data.tabular import check_table, table_bytes
    from fes_pin.data.trial import read_trial
    from fes_pin.identify.stored import load_log
    from fes_pin.models.predict import predict as run
    from fes_pin.models.store import load_model

    catalogue = catalogue_with(library)
    check_table(out)
    loaded = load_model(model, library=catalogue)
    kind, conditions = _settings(setting)
    own = None if columns_of is None else read_columns(columns_of, rigs=catalogue.schemas())
    rig = loaded.rig.described()
    given = read_trial(trial, rig=rig, kind=kind, conditions=conditions, inputs_only=horizon is None, own=own)
    outputs = Outputs("predict", force)
    outputs.check_file(out)
    given = load_log(model).applied(given)
    found = run(loaded, given) if horizon is None else _along(model, loaded, given, horizon)
    columns = {"time_s": found.time, **found.columns}
    if residuals:
        measured = [n for n in found.columns if n in given]
        if not measured:
            raise InputError(f"expected a column {' or '.join(found.columns)} to compare with", file=trial)
        columns |= {f"{n}_measured": given[n] for n in measured}
        columns |= {f"{n}_residual": given.residual(found, n) for n in measured}
    outputs.write_file(out, table_bytes(columns, out))
    say_whose_code(catalogue)


def _along(path: Path, model: Model, trial: Trial, horizon_s: float) -> Trial:
    """A trial's outputs foretold from what was measured so long before."""
    from fes_pin.data.errors import InputError
    from fes_pin.data.trial import derived_trial
    from fes_pin.identify.ahead import foretell
    from fes_pin.identify.stored import load_random

    random = load_random(path)
    if random is None:
        raise InputError(
            "expected a table [random], as diagnose writes it: --horizon needs to know the noise", file=path
        )
    return derived_trial(trial, columns=foretell(model, trial, random, horizon_s))


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


def _settings(words: list[str] | None) -> tuple[str | None, dict[str, float]]:
    """`--set` options as the kind of trial and its numbers."""
    from fes_pin.data.errors import InputError
    from fes_pin.data.numbers import number_in

    given = pairs("--set", words)
    kind = given.pop("kind", None)
    numbers: dict[str, float] = {}
    for name, value in given.items():
        try:
            numbers[name] = number_in(value)
        except ValueError as problem:
            raise InputError(str(problem), column=f"--set {name}") from None
    return kind, numbers


def _print_verdict(diagnosis: Diagnosis) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from fes_pin.diagnosis.text import cause_columns, cause_row

    console = Console(width=None if sys.stdout.isatty() else 120, soft_wrap=not sys.stdout.isatty(), highlight=False)
    console.print(Text(f"{diagnosis.study.name}: {diagnosis.headline()}", style="bold"))
    if diagnosis.causes:
        table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
        for title in cause_columns(diagnosis.gain_name):
            table.add_column(title)
        for cause in diagnosis.causes:
            table.add_row(*(Text(cell) for cell in cause_row(cause)))
        console.print(table)
    for note in diagnosis.footnotes():
        console.print(Text(note))


def main() -> None:
    """Run the command line; see `fes_pin.cli.group`."""
    app(prog_name="fes-pin")


if __name__ == "__main__":
    main()
