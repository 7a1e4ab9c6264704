"""Text spoilt at random: bytes put in, numbers and words exchanged, lines lost, doubled or moved."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

PIECES = (
    b"",
    b"\n",
    b"\x00",
    b"\xff",
    b",",
    b'"',
    b"'",
    b"=",
    b"[",
    b"]",
    b"[[trial]]\n",
    b".",
    b"nan",
    b"-",
    b"<",
    b"/>",
)
PIECES += (
    b"&a;",
    b"\xe2\x80\xa8",
    b"\r",
    b"\t",
    b"{}",
    b"1_0",
    b"\x0c",
    b"#",
    b"\xef\xbb\xbf",
    b"x" * 5000,
    b"../",
    b"~",
)
NUMBERS = (
    b"0",
    b"-1",
    b"1e300",
    b"-1e300",
    b"1e-300",
    b"nan",
    b"inf",
    b"1e400",
    b"9" * 400,
    b"1e6",
    b"-0.0",
    b"true",
    b'"a"',
)
NUMBERS += (b"[1]", b"", b"0x10", b"1,5", b"2020-01-01", b"{}", b"1e-9", b"1e9", b"3.14159")
NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
WORD = re.compile(rb"[A-Za-z_]{3,}")
WORDS = (
    b"",
    b"effort",
    b"torque_nm",
    b"position",
    b"angle_deg",
    b"time",
    b"stim",
    b"force_n",
    b"x",
    b"\xc3\xa9",
    b"rig",
    b"None",
)


def spoilt(content: bytes, rng: np.random.Generator) -> bytes:
    """The content after one to three changes."""
    for _ in range(int(rng.integers(1, 4))):
        content = _CHANGES[int(rng.integers(len(_CHANGES)))](content, rng)
    return content


def _pick(choices: tuple[bytes, ...], rng: np.random.Generator) -> bytes:
    return choices[int(rng.integers(len(choices)))]


def _put(content: bytes, rng: np.random.Generator) -> bytes:
    at, cut = int(rng.integers(len(content) + 1)), int(rng.integers(13))
    return content[:at] + _pick(PIECES, rng) + content[at + cut :]


def _exchanged(pattern: re.Pattern[bytes], by: tuple[bytes, ...]) -> Callable[[bytes, np.random.Generator], bytes]:
    def change(content: bytes, rng: np.random.Generator) -> bytes:
        found = list(pattern.finditer(content))
        if not found:
            return content
        one = found[int(rng.integers(len(found)))]
        return content[: one.start()] + _pick(by, rng) + content[one.end() :]

    return change


def _lines(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    k, other = (int(rng.integers(len(lines))) for _ in range(2))
    change = int(rng.integers(4))
    if change == 0:
        del lines[k]
    elif change == 1:
        lines.insert(other, lines[k])
    elif change == 2:
        lines[k], lines[other] = lines[other], lines[k]
    else:
        lines = lines[:k]
    return b"\n".join(lines)


_CHANGES = (_put, _exchanged(NUMBER, NUMBERS), _exchanged(NUMBER, NUMBERS), _exchanged(WORD, WORDS), _lines)
