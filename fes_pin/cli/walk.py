"""`fes-pin diagnose` of a walking study."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from fes_pin.data.outputs import Outputs
    from fes_pin.data.study import Study


def diagnose_walking(
    study: Study, outputs: Outputs, out: Path, seed: int, limit: float | None, tell: Callable[[float, str], None]
) -> str:
    """Diagnose a study of rig `body`, write its files and give its verdict as text.

    Raises
    ------
    InputError
        The study's files cannot be used, or the folder cannot be written.
    """
    from fes_pin.view.walk_playback import walk_answer_files
    from fes_pin.view.walk_report import PLAYBACK_FILE
    from fes_pin.walk.diagnosis import diagnose_walk
    from fes_pin.walk.record import BODY_FILE, NEXT_FILE

    outputs.check(out, (BODY_FILE, PLAYBACK_FILE))
    diagnosis = diagnose_walk(study, seed=seed, limit=limit, progress=lambda share, words: tell(0.9 * share, words))
    tell(0.9, "report and playback")
    files = walk_answer_files(diagnosis)
    outputs.write(out, files, without={NEXT_FILE} - set(files))
    return str(diagnosis)


def print_effects() -> None:
    """List the causes of walking, with equation and tell-tale."""
    from fes_pin.models.describe import equation, remark, sentence
    from fes_pin.walk.effect import STAGE
    from fes_pin.walk.effects import EFFECTS

    one: Any
    for one in EFFECTS:
        typer.echo(f"{one.name} ({STAGE}; rigs: {', '.join(one.rigs)})\n  {sentence(one)}")
        typer.echo("".join(f"      {line}\n" for line in equation(one).split("\n")), nl=False)
        typer.echo(f"  Tell-tale: {remark(one, 'Tell-tale:')}")
        sizes = {n: u for form in one.forms() for n, u in zip(form.parameters, form.units, strict=True)}
        typer.echo("".join(f"    {n} [{u or '1'}], absent at 0\n" for n, u in sizes.items()))
