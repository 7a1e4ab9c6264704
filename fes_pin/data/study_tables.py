"""The tables of a study.toml that say what the rig is and how its recordings are written: all but the trials."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from fes_pin.data.as_read import HeldFile
from fes_pin.data.checks import check_constants, checked_label
from fes_pin.data.errors import InputError, KeyFault
from fes_pin.data.files import hold, read_json
from fes_pin.data.recorded.columns import Columns, columns_of
from fes_pin.data.schema import Rigs, RigSchema, check_known, number_or_none, one_of, positive
from fes_pin.data.toml import Document
from fes_pin.data.urdf import is_revolute, moving_joints

NOTES = ("description", "subject", "source", "licence", "license", "date", "notes")
HORIZON = "horizon_s"
"""Key of `[study]`: how far ahead errors over a horizon look."""


def check_files(schema: RigSchema, files: Mapping[str, Path]) -> None:
    """Require of a study's files that they are what the rig needs.

    Raises
    ------
    InputError
        Names the file, and the row.
    """
    if schema.check_files is not None:
        schema.check_files(files)
    elif "urdf" in files:
        moving_joints(files["urdf"])
    if "segments" in files:
        read_json(files["segments"])


def checked_horizon(value: object, error: KeyFault) -> float | None:
    """How far ahead errors over a horizon look, s, where it is stated; it must lie above 0."""
    return number_or_none(value, positive("s"), HORIZON, error)


class StudyTables:
    """One reading of a study.toml; every error that it raises names the line and the key.

    Parameters
    ----------
    document, rigs
        The file, and the schemas of the rigs that are known, by name.
    """

    def __init__(self, document: Document, rigs: Rigs) -> None:
        self.document, self.rigs = document, rigs
        self.folder = document.path.parent
        self.error = document.error
        check_known(document.data, ("study", "rig", "start", "columns", "trial"), self.error)
        self.name, self.rig = self._study_table()
        self.schema = rigs[self.rig]

    def _study_table(self) -> tuple[str, str]:
        if "study" not in self.document.data:
            raise self.error("study", "missing; expected a table [study] with name and rig")
        table = self.document.table("study")
        error = self.document.under("study")
        check_known(table, ("name", "rig", HORIZON, *NOTES), error)
        for key in ("name", "rig"):
            if key not in table:
                raise error(key, "missing")
        name = checked_label(table["name"], error, "name", "a name")
        return name, one_of(table["rig"], tuple(self.rigs), partial(error, "rig"))

    def rig_table(self) -> tuple[dict[str, float], dict[str, HeldFile]]:
        """Constants of the rig, and its files, by key."""
        table = dict(self.document.table("rig"))
        passive = self.document.table("rig.passive", table) if self.schema.passive else {}
        if self.schema.passive:
            table.pop("passive", None)
        paths = {key: table.pop(key) for key in self.schema.files if key in table}
        constants = self.document.numbers("rig", table, self.schema.known_constants, also=(*self.schema.files,))
        constants |= self.document.numbers("rig.passive", passive, self.schema.passive)
        check_constants(self.schema, constants, paths, self.document.under("rig"))
        files = {key: hold(self.document.path_of(f"rig.{key}", value)) for key, value in paths.items()}
        check_files(self.schema, files)
        return constants, files

    def start_table(self, constants: Mapping[str, float]) -> dict[str, float]:
        """Start values of what the nominal model fits, by key."""
        table = self.document.table("start")
        known = dict(self.schema.start)
        for key in set(known) & set(constants):
            if key in table:
                raise self.error(f"start.{key}", "is also in [rig]; expected it in one of them")
            del known[key]
        return self.document.numbers("start", table, known)

    def columns_table(self, files: Mapping[str, Path]) -> Columns | None:
        """How the recordings are written, where the study says so."""
        if "columns" not in self.document.data:
            return None

        def error(key: str, message: str) -> InputError:
            return self.error(f"columns.{key}".rstrip("."), message)

        return columns_of(self.document.table("columns"), self.schema, is_revolute(files.get("urdf")), error)
