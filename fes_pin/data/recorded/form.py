"""The form of a text file: its delimiter, its decimal sign, the lines of its header and of its first numbers."""

import csv
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from fes_pin.data.recorded.labelled import without_names
from fes_pin.data.recorded.sheets import lines_in

DELIMITERS = (";", "\t", ",", " ")
"""Semicolon, tab, comma, and any white space."""
DECIMALS = (".", ",")
ENCODINGS = ("utf-8", "utf-16", "cp1252")
NUMERIC = re.compile(r"^[+-]?[\d.,]+([eE][+-]?\d+)?$")
"""A number with any decimal sign."""
MISSING = frozenset({"", "nan", "na", "n/a", "-", "--", "null", "none", "#n/a"})
"""What instruments write where there is no sample, in lower case."""
REMARK = re.compile(r"[\t ,;]+#(\*|\d+)(\s.*)?$")
"""What LabChart writes at the end of a row of numbers where somebody made a remark: `#* stimulus on`."""
COMMENTS = ("#", "%", "//")
"""What a line begins with that holds no numbers, whatever the form says."""
AFTER, AFTER_COMMENTS = "after comments", -1
"""`header_row` of files whose names stand in the first line that is neither a comment nor empty; in a form -1."""


@dataclass(frozen=True)
class TextForm:
    """How a text file writes its numbers.

    Parameters
    ----------
    delimiter
        Of `DELIMITERS`.
    decimal
        "." or ",".
    header_row
        Line of the column names, from 1, or `AFTER_COMMENTS`, with the numbers below it; 0 if the file has none, and
        columns are then called column1, column2 ...
    first_row
        Line of the first numbers; what stands between it and the header (a row of units) is passed over.
    names
        Of the columns, instead of those in the header; () for those.
    transposed
        Whether each line holds one quantity: its name, unless `names` or the header have the names, then its samples.
    labelled
        Whether numbers stand behind their names, as `angle: 1.36`, in each line.
    comment
        What a line begins with that is passed over; "" for nothing.
    encoding
        Of `ENCODINGS`.
    sheet
        Of a spreadsheet; "" for its first one. Of a file that nests vectors one of its structures; "" for all of it.
    strict
        Whether each line must hold as many numbers as there are names, none of them missing and no two names alike, as
        the study format has it.
    """

    delimiter: str = ","
    decimal: str = "."
    header_row: int = 1
    first_row: int = 2
    comment: str = ""
    encoding: str = "utf-8"
    names: tuple[str, ...] = ()
    transposed: bool = False
    labelled: bool = False
    sheet: str = ""
    strict: bool = False

    def lines(self, path: Path) -> list[str]:
        """Lines of a file, or of a sheet of a spreadsheet, without names before their numbers.

        Raises
        ------
        InputError
            As `lines_in`.
        """
        found = lines_in(path, self.encoding, self.delimiter, self.sheet)
        return without_names(found) if self.labelled else found

    def in_words(self) -> str:
        """What sets this form apart from that of the study format; "" if nothing does."""
        plain, said = TextForm(), []
        if self.delimiter != plain.delimiter:
            said.append({";": "semicolons", "\t": "tabs", " ": "white space"}[self.delimiter] + " between values")
        if self.decimal != plain.decimal:
            said.append("decimal commas")
        if self.transposed:
            said.append("one quantity in each line")
        if self.labelled:
            said.append("names before the numbers of each line")
        elif self.header_row == 0:
            said.append("no header")
        elif self.header_row > 1:
            said.append(f"a header in row {self.header_row}")
        if self.header_row > 0 and self.first_row > self.header_row + 1:
            said.append("a row of units")
        if self.comment:
            said.append(f"comments after {self.comment}")
        if self.encoding != plain.encoding:
            said.append(f"{self.encoding} text")
        return ", ".join(said)


def cells_of(line: str, form: TextForm) -> list[str]:
    """The cells of one line, without surrounding spaces.

    Unless the form is strict also without quotes and remarks, and a delimiter at the end of the line begins no cell.
    """
    if "#" in line and not form.strict and line.lstrip()[:1] in "+-.0123456789":
        line = REMARK.sub("", line)
    cells = line.split(None if form.delimiter == " " else form.delimiter)
    if form.strict:
        return [cell.strip() for cell in cells]
    if form.delimiter == " ":
        return [cell.strip('"') for cell in cells]
    if '"' in line:
        with suppress(csv.Error):  # of a cell beyond csv's limit, which is no number
            cells = next(csv.reader([line], delimiter=form.delimiter, skipinitialspace=True), [])
    out = [cell.strip() for cell in cells]
    return out[:-1] if len(out) > 1 and not out[-1] else out
