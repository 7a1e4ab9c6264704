"""`fes-pin predict`: a trial, or all trials of a study, from their inputs with a saved model."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fes_pin.cli.group import python_names, remark
from fes_pin.cli.options import Exclude, Force, Libraries, Trials, numbers_of, output, pairs, study_of
from fes_pin.cli.progress import catalogue_with, say_whose_code
from fes_pin.data.as_read import HeldFile, note_read
from fes_pin.data.errors import InputError

if TYPE_CHECKING:
    import numpy as np

    from fes_pin.data.trial import Trial
    from fes_pin.infer.noise import NoiseModel
    from fes_pin.models.catalogue import Catalogue
    from fes_pin.models.model import Model

STANDARD = Path("-")
"""Standard input as a trial, standard output as a table."""


@python_names(library="--library", **{"position0 among the conditions": "--set position0=..."})
def predict(
    model: Annotated[Path, typer.Argument(help="model.toml of a diagnosis.")],
    trial: Annotated[
        Path,
        typer.Argument(help="CSV with time_s and the inputs, or as --columns-of says; - for standard input; a study."),
    ],
    out: Annotated[
        Path | None, output("CSV or Parquet to write: time_s and what is predicted; - for standard output.")
    ] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="A condition of the trial: load_kg=1.5, kind=isometric ...")
    ] = None,
    columns_of: Annotated[
        Path | None, typer.Option(help="A study whose [columns] says how the trial's file is written.")
    ] = None,
    trials: Trials = None,
    exclude: Exclude = None,
    residuals: Annotated[
        bool, typer.Option("--residuals", help="Also what was measured, and measured minus predicted.")
    ] = False,
    horizon: Annotated[
        float | None,
        typer.Option(
            min=0.0, metavar="SECONDS", help="Predict each sample from what the trial measured up to so long before it."
        ),
    ] = None,
    library: Libraries = None,
    force: Force = False,
) -> None:
    """Predict a trial from its inputs with a saved model, or so far ahead along a trial that has its outputs.

    Of a study all trials are predicted, each under its own conditions, and their errors are said; of one trial it is
    said with --residuals, or without --out.
    """
    from fes_pin.data.outputs import Outputs
    from fes_pin.data.plausibility import ToPredict
    from fes_pin.data.table import check_table, table_bytes
    from fes_pin.diagnosis.replay import trial_table
    from fes_pin.identify.stored import load_log, load_random
    from fes_pin.models.store import load_model
    from fes_pin.prepare.measured import check_study

    catalogue = catalogue_with(library)
    loaded = load_model(model, library=catalogue)
    is_study = trial.is_dir() or trial.suffix.lower() == ".toml"
    _refuse_ignored(is_study, setting=setting, columns_of=columns_of, trials=trials, exclude=exclude)
    if is_study:
        measured = _trials(trial, loaded, trials, exclude, catalogue)
    else:
        measured = [_trial(trial, loaded, setting, columns_of, catalogue, horizon is None)]
    outputs = Outputs("predict", force)
    if out is not None and out != STANDARD:
        outputs.check_file(out)
        check_table(out)
    schema = loaded.rig.described()
    with _of_file(model), _by_option(pairs("--set", setting)):
        odd = check_study(ToPredict(measured, schema, loaded.rig.constants, trial), loaded)
        given = [load_log(model).applied(one) for one in measured]
        found = [_predicted(model, loaded, one, horizon) for one in given]
    errors = _errors(loaded, load_random(model), given, found, horizon)
    if (residuals or out is None) and not errors:
        columns = " or ".join(dict.fromkeys(n for one in found for n in one.columns))
        raise InputError(f"expected a column {columns} to compare with{'' if residuals else ', or --out'}", file=trial)
    if out is not None:
        names, columns_out = trial_table(given, [_columns(*pair, residuals) for pair in zip(given, found, strict=True)])
        table = table_bytes({**({"trial": names} if is_study else {}), **columns_out}, out)
        if out == STANDARD:
            typer.echo(table.decode(), nl=False)
        else:
            outputs.write_file(out, table)
    say_whose_code(catalogue)
    for line in odd:
        remark(f"odd: {line}")
    for line in errors if is_study or residuals or out is None else ():
        remark(line) if out == STANDARD else typer.echo(line)


def _refuse_ignored(is_study: bool, **given: object) -> None:
    """A study says of each trial what it is; one trial is not chosen among others."""
    for name, value in given.items():
        if value and is_study != (name in ("trials", "exclude")):
            what = "one trial: a study says it of each" if is_study else "a study"
            option = "set" if name == "setting" else name.replace("_", "-")
            raise InputError(f"goes only with {what}", column=f"--{option}")


def _trials(path: Path, model: Model, trials: str | None, exclude: str | None, catalogue: Catalogue) -> Sequence[Trial]:
    """The trials of a study to predict."""
    study = study_of(path, catalogue, trials, exclude)
    if study.rig != model.rig.name:
        raise InputError(f"expected a study of the rig {model.rig.name}, found {study.rig}", file=path)
    return study.trials


def _trial(
    path: Path,
    model: Model,
    setting: list[str] | None,
    columns_of: Path | None,
    catalogue: Catalogue,
    inputs_only: bool,
) -> Trial:
    """The trial to predict; what is wrong with it names the file or the option that was given."""
    from fes_pin.data.study import read_columns
    from fes_pin.data.trial_files import read_trial

    said = pairs("--set", setting)
    kind = said.pop("kind", None)
    conditions = numbers_of("--set", said)
    schema = model.rig.described()
    own = None if columns_of is None else read_columns(columns_of, rigs=catalogue.schemas())
    file = path
    if path == STANDARD:
        file = HeldFile.holding("stdin.csv", sys.stdin.buffer.read())
        note_read("/dev/stdin")  # a file that the shell gave
    with _by_option({"kind", *conditions, *schema.conditions}):
        try:
            return read_trial(file, rig=schema, kind=kind, conditions=conditions, inputs_only=inputs_only, own=own)
        except InputError as error:
            if file == path or error.file != file:
                raise
            raise InputError(error.message, file="standard input", row=error.row, column=error.column) from None


@contextmanager
def _by_option(settings: Collection[str]) -> Iterator[None]:
    """Name what was set by its option."""
    try:
        yield
    except InputError as error:
        if error.row is None and error.column in settings:
            raise InputError(error.message, column=f"--set {error.column}") from None
        raise


@contextmanager
def _of_file(model: Path) -> Iterator[None]:
    """Name the model in an error that names no file and no option: it is the model that cannot be simulated."""
    try:
        yield
    except InputError as error:
        if error.file is None and not (error.column or "").startswith("--"):
            raise InputError(error.message, file=model, column=error.column) from None
        raise


def _predicted(path: Path, model: Model, trial: Trial, horizon_s: float | None) -> Trial:
    """A trial's outputs, simulated, or predicted from what was measured so long before."""
    from fes_pin.data.trial import derived_trial
    from fes_pin.identify.ahead import predict_ahead
    from fes_pin.identify.stored import load_random
    from fes_pin.models.predict import predicted_trial

    if horizon_s is None:
        return predicted_trial(model, trial)
    random = load_random(path)
    if random is None:
        message = "expected a table [random], as diagnose writes it: --horizon needs to know the noise"
        raise InputError(message, file=path)
    return derived_trial(trial, columns=predict_ahead(model, trial, random, horizon_s))


def _errors(
    model: Model, noise: NoiseModel | None, measured: Sequence[Trial], found: Sequence[Trial], horizon_s: float | None
) -> list[str]:
    """E of each trial whose outputs were measured, and of all of them, in words; SI units of a model without noise."""
    from fes_pin.identify.ahead import first_ahead
    from fes_pin.identify.replay import squares_of
    from fes_pin.infer.held_out import percent_of_spread
    from fes_pin.infer.text import percent

    squares = {}
    for one, predicted in zip(measured, found, strict=True):
        if names := [n for n in predicted.columns if n in one]:
            squares[one.name] = squares_of(one, predicted, names, noise or {}, first_ahead(model, one, horizon_s))
    ahead = "" if horizon_s is None else f", {horizon_s:g} s ahead"
    lines = [f"{name}: E {percent(percent_of_spread(*both))}{ahead}" for name, both in squares.items()]
    if len(squares) > 1:
        lines.append(f"all trials: E {percent(percent_of_spread(*zip(*squares.values(), strict=True)))}{ahead}")
    return lines


def _columns(measured: Trial, found: Trial, residuals: bool) -> dict[str, np.ndarray]:
    """Columns of the table of one trial."""
    columns = {"time_s": found.time, **found.columns}
    compared = [n for n in found.columns if residuals and n in measured]
    columns |= {f"{n}_measured": measured[n] for n in compared}
    return columns | {f"{n}_residual": measured.residual(found, n) for n in compared}
