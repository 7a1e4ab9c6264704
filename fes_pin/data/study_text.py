"""The tables of a study.toml but its trials: as they are read, and as `fes-pin new-study` writes them.

They say what the rig is and how its recordings are written; an option of new-study says the same of a column.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from fes_pin.data.as_read import HeldFile
from fes_pin.data.checks import check_constants, checked_label
from fes_pin.data.errors import InputError, KeyFault, listed
from fes_pin.data.files import hold, read_json
from fes_pin.data.numbers import in_full, number_in
from fes_pin.data.recorded.columns import Columns
from fes_pin.data.recorded.columns_table import SOURCE_KEYS, columns_of
from fes_pin.data.recorded.form import AFTER, AFTER_COMMENTS, TextForm
from fes_pin.data.schema import Rigs, RigSchema, check_known, number_or_none, one_of, positive
from fes_pin.data.toml import Document
from fes_pin.data.units import own_unit
from fes_pin.data.urdf import is_revolute, moving_joints
from fes_pin.data.walk_conventions import checked_conventions

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
        known = ("study", "rig", "start", "columns", "sources", "conventions", "trial")
        check_known(document.data, known, self.error)
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

    def start_table(self, constants: Mapping[str, float], files: Mapping[str, Path]) -> dict[str, float]:
        """Start values of what the nominal model fits, by key; some that are left out as the rig's files state them."""
        table = self.document.table("start")
        known = dict(self.schema.start)
        for key in set(known) & set(constants):
            if key in table:
                raise self.error(f"start.{key}", "is also in [rig]; expected it in one of them")
            del known[key]
        stated = self.schema.left_out(files, {*table, *constants})
        known = {key: number for key, number in known.items() if key not in stated}
        return {**self.document.numbers("start", table, known), **stated}

    def conventions_table(self) -> dict[str, Any]:
        """Conventions that a study of a walking body states, by key."""
        table = self.document.table("conventions")
        if table and len(self.schema.recordings) == 1:
            raise self.error("conventions", f"rig {self.rig} takes none; its [columns] have units, scales and zeros")
        return checked_conventions(table, self.document.under("conventions"))

    def columns_table(self, files: Mapping[str, Path]) -> Columns | None:
        """How the recordings are written, where the study says so."""
        if "columns" not in self.document.data:
            return None
        return self._columns("columns", self.document.table("columns"), files)

    def recordings_tables(self, files: Mapping[str, Path]) -> dict[str, Columns | None]:
        """How the files of each source are written, by its name; "" for those of trials with one file."""
        sources = self.document.table("sources")
        tables = {name: self.document.table(f"sources.{name}", sources) for name in sources}
        own = {name: self._columns(f"sources.{name}", table, files) for name, table in tables.items()}
        return {"": self.columns_table(files), **own}

    def _columns(self, where: str, table: Mapping[str, Any], files: Mapping[str, Path]) -> Columns:
        def error(key: str, message: str) -> InputError:
            return self.error(f"{where}.{key}".rstrip("."), message)

        return columns_of(table, self.schema, is_revolute(files.get("urdf")), error)


HEADER = ("# Written by `fes-pin new-study`; every line may be changed. docs/study_format.md says what each means.",)


def toml_table(
    name: str, values: Mapping[str, Any], what: str = "", units: Mapping[str, str] | None = None
) -> list[str]:
    """Lines of a table, with units as comments; none of an empty one."""
    if not values:
        return []
    out = ["", f"[{name}]" + (f"  # {what}" if what else "")]
    for key, value in values.items():
        unit = (units or {}).get(key, "")
        out.append(f"{key} = {toml_value(value)}" + (f"  # {unit}" if unit else ""))
    return out


def toml_value(value: Any) -> str:
    """A string, a number, a truth, a list of them, or a table in one line, as TOML."""
    if isinstance(value, Mapping):
        return inline_table(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return quoted(value) if isinstance(value, str) else repr(value) if isinstance(value, int) else in_full(value)


def quoted(text: str) -> str:
    """A TOML string: JSON's escapes are a subset of its own, but for the character 127."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def inline_table(source: Mapping[str, Any]) -> str:
    """A table in one line."""
    return "{ " + ", ".join(f"{k} = {toml_value(v)}" for k, v in source.items()) + " }"


def columns_text(
    sources: Mapping[str, Mapping[str, Any]],
    names: Sequence[str],
    form: TextForm | None,
    options: Mapping[str, Any],
    where: str = "columns",
    is_plain: bool = True,
) -> list[str]:
    """Lines of [columns], or of [sources.NAME], and of its table `file` with the options that are set.

    Parameters
    ----------
    where
        Name of the table.
    is_plain
        Whether no [columns] are written where all is as by default: nothing in the files is read in a way of its own.
    """
    used = {source["name"] for source in sources.values() if "name" in source}
    ignored = [name for name in names if name not in used]
    about = _about_files(form or TextForm(), options)
    as_named = all(source == {"name": column} for column, source in sources.items()) and names[0] == "time_s"
    if is_plain and where == "columns" and as_named and form is not None and not about and not ignored:
        return []
    values = {**sources, **({"ignored": ignored} if ignored else {})}
    out = toml_table(where, values, "the rig's columns, as the recordings call them, and their units there")
    return out + toml_table(f"{where}.file", about, "how the recordings are written")


def _about_files(form: TextForm, options: Mapping[str, Any]) -> dict[str, Any]:
    """What the table `file` says: the options that are set, and what is not as in a plain form."""
    about = {k: v for k, v in options.items() if v is not None}
    about |= {k: v for k, v in asdict(form).items() if v != getattr(TextForm(), k)}
    if form.first_row != form.header_row + 1:
        about["first_row"] = form.first_row
    if form.header_row == AFTER_COMMENTS:
        about |= {"header_row": AFTER}
        about.pop("first_row", None)
    return about


def source_from_option(column: str, option: str, names: Sequence[str]) -> dict[str, Any]:
    """What an option says of a column: `NAME[:UNIT][,key=number ...]`, or `rate=HZ` for a file without times.

    Raises
    ------
    InputError
        It says something else, or names no column of the files.
    """
    error = partial(InputError, column=f"--column {column}")
    if option in names:  # whatever signs it has
        return {"name": option}
    first, *more = option.split(",")
    if first.startswith("rate=") and column == "time_s":
        rate_hz = number_in(first.removeprefix("rate="), error)
        if more or not 0.0 < rate_hz < math.inf:
            raise error(f"expected rate=HZ above 0, alone; found {option!r}")
        return {"rate_hz": rate_hz}
    name, colon, unit = first.rpartition(":") if first not in names else (first, "", "")
    out: dict[str, Any] = {"name": name if colon else first} | ({"unit": unit} if unit and colon else {})
    if out["name"] not in names:
        raise error(f"expected a column of the files, one of {listed(names)}; found {out['name']!r}")
    for pair in more:
        key, equals, value = pair.partition("=")
        if not equals or key not in SOURCE_KEYS:
            raise error(f"expected NAME:UNIT,zero=NUMBER,scale=NUMBER; found {option!r}")
        out[key] = number_in(value, error)
    return out


def source_in_words(source: Mapping[str, Any], column: str, revolute: bool | None) -> str:
    """Unit, scale and zero of a column, for a person."""
    if "rate_hz" in source:
        return f"{source['rate_hz']:g} Hz"
    more = ", ".join(f"{k} {source[k]:g}" for k in ("scale", "zero", "edge") if k in source)
    return ", ".join(filter(None, [source.get("unit") or own_unit(column, revolute), more]))


def form_in_words(form: TextForm | None) -> str:
    """How a file is written, for a person."""
    return "another format" if form is None else form.in_words() or "commas, and one header row"
