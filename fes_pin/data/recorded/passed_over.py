"""What stands among the numbers of a text file and is none: headers that come again, remarks, a summary below."""

from collections.abc import Iterator, Sequence

import numpy as np

from fes_pin.data.recorded.clock import clock_seconds
from fes_pin.data.recorded.form import COMMENTS, MISSING, NUMERIC, REMARK, TextForm, cells_of


def lines_between(found: Sequence[str], above: Sequence[str], form: TextForm) -> list[str]:
    """Return lines among those of numbers that are a header again, or words of another number of cells: a remark.

    Parameters
    ----------
    found
        From the first line of numbers to the last.
    above
        The lines above them.
    """
    width = len(cells_of(found[0], form)) if found else 0
    out = []
    for line in found:
        if line[:1].isdigit() or line[:1] in ("-", "+", "."):  # most are numbers
            continue
        text = line.lstrip()
        if not text[:1].isalpha() and not text.startswith(COMMENTS):
            continue
        cells = cells_of(text, form)
        is_word = not any(NUMERIC.match(cell) or cell.lower() in MISSING for cell in cells)
        if _heads(above, form, line) or (is_word and len(cells) not in (width, width + 1)):
            out.append(line)
    return out


def begins_with_sample(line: str, form: TextForm) -> bool:
    """Return whether the first cell of a line may be a sample: a number, a time, or nothing."""
    cell = next(iter(cells_of(line, form)), "")
    return bool(NUMERIC.match(cell)) or cell.lower() in MISSING or clock_seconds(cell) is not None


def passed_over(lines: Sequence[str], body: Sequence[str], rows: np.ndarray, form: TextForm) -> Iterator[str]:
    """Sentences about what stands between the rows of numbers, at their ends and below them, and is no number.

    Parameters
    ----------
    lines, body
        All lines of the file, and those of its rows.
    rows
        Which lines these are, from 1, (n,).
    """
    above, last = lines[: form.first_row - 1], int(rows[-1])
    is_skipped = np.ones(last, dtype=bool)
    is_skipped[: form.first_row - 1], is_skipped[rows - 1] = False, False
    between = [lines[k] for k in np.flatnonzero(is_skipped).tolist() if lines[k].strip()]
    again = [line for line in between if _heads(above, form, line)]
    if again:
        yield f"its header comes again in {len(again)} lines, which are passed over"
    if words := _without_comments([line for line in between if line not in again], form.comment):
        yield f"{_lines(words)} between the numbers, passed over: {words[0][:40]!r}"
    if noted := [line for line in body if "#" in line and REMARK.search(line)]:
        remark = noted[0][noted[0].index("#") :][:40].strip()
        yield f"{len(noted)} rows end in a remark, {remark!r}: it is passed over"
    if below := _without_comments(lines[last:], form.comment, *COMMENTS):
        yield f"{_lines(below)} below the numbers, passed over: {below[0][:40]!r}"


def _without_comments(lines: Sequence[str], *signs: str) -> list[str]:
    """Lines with words that begin with none of these signs, without surrounding spaces."""
    known = tuple(sign for sign in signs if sign)
    return [text for line in lines if (text := line.strip()) and not text.startswith(known)]


def _lines(found: Sequence[str]) -> str:
    return f"{len(found)} line{'s' * (len(found) > 1)}"


def _heads(above: Sequence[str], form: TextForm, line: str) -> bool:
    """Return whether a line begins as one of those above the first numbers: a program wrote its header again."""
    text = line.lstrip()
    if not text[:1].isalpha() or text[:3].lower() == "nan":
        return False
    return cells_of(text, form)[0] in {cells_of(one, form)[0] for one in above if one.strip()}
