"""Numbers of a URDF changed where they stand in its bytes: everything else of the file stays as it is."""

import codecs
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any
from xml.parsers import expat

_ATTRIBUTE = re.compile(rb"""\s([^\s=/>"']+)\s*=\s*("[^"]*"|'[^']*')""")
"""An attribute of a start tag, with the quotes of its value."""
_UTF_16 = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
"""Encodings in which a tag is no ASCII, by their byte order marks; XML demands one of every file in UTF-16."""


@dataclass
class Tag:
    """One element: its attributes, where it stands, and the elements in it.

    Attributes
    ----------
    name, attributes
        As written.
    start, head
        First byte of its start tag, and the byte after it.
    end
        Byte after the element.
    children
        Elements in it, in order.
    """

    name: str
    attributes: Mapping[str, str]
    start: int
    head: int = 0
    end: int = 0
    children: list["Tag"] = field(default_factory=list)

    def find(self, name: str) -> "Tag | None":
        """Return the first element of a name in it; None if there is none."""
        return next(self.all(name), None)

    def all(self, name: str) -> Iterator["Tag"]:
        """Yield the elements of a name in it."""
        return (one for one in self.children if one.name == name)

    def get(self, key: str, default: str = "") -> str:
        """Return the value of an attribute, or a default for one that is missing."""
        return self.attributes.get(key, default)


class XmlText:
    """The bytes of an XML file, with changes of attributes that are collected before they are made.

    Parameters
    ----------
    content
        Of a file that `data.urdf` accepts: well formed, and without a document type.
    """

    def __init__(self, content: bytes) -> None:
        self._mark, self._encoding = next(((m, e) for m, e in _UTF_16.items() if content.startswith(m)), (b"", ""))
        self._text = content
        if self._encoding:
            self._text = content[len(self._mark) :].decode(self._encoding).encode()
        self._changes: dict[tuple[int, int], bytes] = {}
        self.root = self._parsed()

    def _parsed(self) -> Tag:
        parser = expat.ParserCreate("utf-8" if self._encoding else None)
        above = [Tag("", {}, 0)]

        def begin(name: str, attributes: dict[str, str]) -> None:
            one = Tag(name, attributes, parser.CurrentByteIndex)
            one.head = self._after_tag(one.start)
            above[-1].children.append(one)
            above.append(one)

        def finish(_: Any) -> None:
            one, at = above.pop(), parser.CurrentByteIndex  # of an empty element, in one tag, where that begins
            one.end = one.head if self._text[one.head - 2 : one.head] == b"/>" else self._after_tag(at)

        parser.StartElementHandler, parser.EndElementHandler = begin, finish
        parser.Parse(self._text, True)
        return above[0].children[0]

    def _after_tag(self, start: int) -> int:
        """Return the byte after the tag that starts at a byte; a value in quotes may hold a >."""
        end = re.compile(rb"""<(?:[^"'>]|"[^"]*"|'[^']*')*>""").match(self._text, start)
        assert end is not None
        return end.end()

    def set(self, tag: Tag, key: str, value: str) -> None:
        """Have another value of an attribute written, in the quotes that it has; a new attribute ends its tag."""
        for found in _ATTRIBUTE.finditer(self._text, tag.start, tag.head):
            if found[1] == key.encode():
                self._changes[found.start(2) + 1, found.end(2) - 1] = value.encode()
                return
        closed = 2 if self._text[tag.head - 2 : tag.head] == b"/>" else 1
        at = len(self._text[: tag.head - closed].rstrip())
        self._insert(at, f' {key}="{value}"'.encode())

    def append(self, tag: Tag, element: str) -> None:
        """Have an element written after the last one in a tag, on a line of its own where that one has a line."""
        last = tag.children[-1]
        before = re.search(rb"\s*\Z", self._text[: last.start])
        assert before is not None
        self._insert(last.end, before[0] + element.encode())

    def _insert(self, at: int, more: bytes) -> None:
        self._changes[at, at] = self._changes.get((at, at), b"") + more

    def changed(self) -> bytes:
        """Return the file with the changes; one that nothing was changed of is the same to the byte."""
        out, at = [], 0
        for (start, end), value in sorted(self._changes.items()):
            out += [self._text[at:start], value]
            at = end
        text = b"".join([*out, self._text[at:]])
        return self._mark + text.decode().encode(self._encoding) if self._encoding else text
