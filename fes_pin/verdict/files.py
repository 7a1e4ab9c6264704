"""Names of the files of an answer to a study, of a rig or of a walk."""

from fes_pin.data.results import NEXT_FILE
from fes_pin.data.study import Study

REPORT_FILE = "report.html"
OF_ALL = ("diagnosis.json", "model.toml", REPORT_FILE, NEXT_FILE)
OF_WALKS = ("body.urdf", "playback.html")
"""Files of a study at most, and further files of a walk; the next trial where one is proposed."""


def answer_names(study: Study) -> tuple[str, ...]:
    """Names of the files that `view.report.answer_files` may give of a study."""
    return OF_ALL if study.schema.owner is not None else (*OF_ALL, *OF_WALKS)
