"""Every file of an answer to a study, of a rig or of a walk, as commands and cohorts write them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fes_pin.data.study import Study

if TYPE_CHECKING:
    from fes_pin.diagnosis.result import Diagnosis
    from fes_pin.walk.result import WalkDiagnosis

REPORT_FILE, NEXT_FILE = "report.html", "next_trial.csv"
OF_ALL = ("diagnosis.json", "model.toml", REPORT_FILE, NEXT_FILE)
OF_WALKS = ("body.urdf", "playback.html")
"""What is written of a study, at most, and of a walk besides; the next trial where one is proposed."""


def answer_names(study: Study) -> tuple[str, ...]:
    """Names of the files that `answer_files` may give of a study."""
    return OF_ALL if study.schema.owner is not None else (*OF_ALL, *OF_WALKS)


def answer_files(found: Diagnosis | WalkDiagnosis, command: str = "") -> dict[str, str | bytes]:
    """Every file of an answer by its name.

    Parameters
    ----------
    command
        The command line that asked for it, for its provenance; "" for a call from Python.
    """
    from fes_pin.diagnosis.result import Diagnosis  # noqa: PLC0415 - a command imports what it needs

    if not isinstance(found, Diagnosis):
        from fes_pin.view.walk_playback import walk_answer_files  # noqa: PLC0415

        return walk_answer_files(found)
    from fes_pin.diagnosis.record import by_command, diagnosis_files  # noqa: PLC0415
    from fes_pin.view.report import report_html  # noqa: PLC0415

    found = by_command(found, command) if command else found
    return {**diagnosis_files(found), REPORT_FILE: report_html(found)}
