"""The check and the diagnosis of a study, of a rig or of a walk, and the names of the files of an answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from fes_pin.data.asked import asked
from fes_pin.data.errors import InputError
from fes_pin.data.results import NEXT_FILE, ModelResult
from fes_pin.data.study import Study
from fes_pin.models.catalogue import Source

if TYPE_CHECKING:
    from fes_pin.diagnosis.checked import Checked


REPORT_FILE = "report.html"
OF_ALL = ("diagnosis.json", "model.toml", REPORT_FILE, NEXT_FILE)
OF_WALKS = ("body.urdf", "playback.html")
"""Files of a study at most, and further files of a walk; the next trial where one is proposed."""


def answer_names(study: Study) -> tuple[str, ...]:
    """Names of the files that `view.report.answer_files` may give of a study."""
    return OF_ALL if study.schema.owner is not None else (*OF_ALL, *OF_WALKS)


def check(study: Study, *, library: Source | Sequence[Source] | None = None) -> Checked:
    """Check a study before a diagnosis: its numbers, and the causes that its trials can and cannot identify.

    Parameters
    ----------
    study
        The rig and its trials.
    library
        Causes in addition to those of the library and of installed packages; see `diagnose`.

    Returns
    -------
    Checked

    Raises
    ------
    InputError
        For numbers that no verdict could follow from, as `diagnose`.
    """
    asked(study)
    from fes_pin.diagnosis.checked import Checked, check_rig  # noqa: PLC0415

    if study.rig != "body":
        return check_rig(study, library=library)
    from fes_pin.walk.stated import contradictions_of  # noqa: PLC0415

    return Checked(study, contradictions_of(study))


def diagnose(
    study: Study,
    *,
    library: Source | Sequence[Source] | None = None,
    seed: int = 0,
    limit: float | None = None,
    progress: Callable[[float, str], None] | None = None,
    thorough: bool = False,
) -> ModelResult:
    """Find out what the model of a study gets wrong; of a walking body it is `diagnose_walk` that answers.

    Both answers have `verdict`, `causes`, `remainder`, `absorbed`, `nominal_error`, `extended_error`,
    `ceiling_percent`, `next_experiment`, `warnings`, `wall_s`, and the extended `model`: a body's is a `Body`. What
    else the answer on a rig has, `isinstance(answer, fp.Diagnosis)` tells type checkers.

    Parameters
    ----------
    study
        The rig and its trials.
    library
        Causes in addition to those of the library and of installed packages: files, modules, classes or what
        `load_library` made of them.
        Walking has none but its own.
    seed
        Of what is simulated: critical values and bootstrap intervals.
    limit
        Seconds that the search may take; then it stops at the best set so far, and says so.
    progress
        Called with a share done and a few words.
    thorough
        Whether both estimators of a joint with recorded efforts search by themselves. By default inverse dynamics
        searches, and the likelihood begins with its set.

    Raises
    ------
    InputError
        If the study cannot be diagnosed, a library is given for a body, the seed is no whole number of 0 or more, or
        the limit is below 0.
    """
    asked(study, seed, limit, progress)
    if study.rig == "body":
        from fes_pin.walk.diagnosis import diagnose_walk  # noqa: PLC0415

        if library is not None and library != []:
            raise InputError("a library brings causes of rigs; walking has none but its own", file=study.folder)
        return diagnose_walk(study, seed=seed, limit=limit, progress=progress)
    from fes_pin.diagnosis.diagnosis import diagnose_joint as of_a_rig  # noqa: PLC0415

    return of_a_rig(study, library=library, seed=seed, limit=limit, progress=progress, thorough=thorough)
