"""XML files as trees whose text has lines and columns.

Read with expat. A document type is refused, so there are no entities that grow and none that reach outside the file; no
more than `MAX_DEPTH` elements may stand in each other.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from plctool.compiler.formats.text import Chunk, Place

MAX_DEPTH = 200
_LONE_RETURN = re.compile(r"\r(?!\n)")  # a line end for expat, but for nothing else here


class XmlError(Exception):
    """The file is not XML that may be read; `at` is where."""

    def __init__(self, at: Place, message: str) -> None:
        super().__init__(message)
        self.at = at


@dataclass(slots=True)
class Element:
    """An element. Names are without the prefix of their namespace; `chunks` is the text directly in it."""

    tag: str
    attributes: dict[str, str]
    at: Place
    children: list[Element] = field(default_factory=list)
    chunks: list[Chunk] = field(default_factory=list)

    def get(self, name: str, default: str = "") -> str:
        """An attribute without blanks around it."""
        return self.attributes.get(name, default).strip()

    def child(self, *path: str) -> Element | None:
        """The first element at a path of names."""
        found: Element | None = self
        for name in path:
            found = next((c for c in found.children if c.tag == name), None) if found is not None else None
        return found

    def all(self, *tags: str) -> list[Element]:
        """The direct children with one of these names."""
        return [c for c in self.children if c.tag in tags]

    def every(self, *tags: str) -> Iterator[Element]:
        """All elements with one of these names in this one, however deep."""
        waiting = self.children[::-1]
        while waiting:
            element = waiting.pop()
            if element.tag in tags:
                yield element
            if element.children:
                waiting += element.children[::-1]

    def child_data(self, name: str) -> list[Element]:
        """What is added to this element in PLCopen XML under a name, of which only the last part counts."""
        added = [data for data in self.all("addData") for data in data.all("data")]
        return [data for data in added if data.get("name").rpartition("/")[2].lower() == name]

    def every_chunk(self) -> list[Chunk]:
        """The text in this element and in those in it."""
        return [*self.chunks, *(chunk for child in self.children for chunk in child.every_chunk())]

    @property
    def text(self) -> str:
        """All text, without blanks around it."""
        return "".join(chunk.text for chunk in self.every_chunk()).strip()


class _Reader:
    def __init__(self) -> None:
        self._parser = parser = expat.ParserCreate("utf-8")
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._characters
        parser.StartDoctypeDeclHandler = self._document_type
        parser.ordered_attributes = False
        self._root = Element("", {}, Place(1, 1))
        self._open = [self._root]

    def read(self, text: str) -> Element:
        try:
            self._parser.Parse(_LONE_RETURN.sub(" ", text).encode("utf-8", "replace"), True)
        except expat.ExpatError as error:
            what = expat.errors.messages.get(error.code, str(error.code))
            raise XmlError(Place(error.lineno, error.offset + 1), f"the file is not well-formed XML: {what}") from None
        return self._root.children[0]

    @property
    def _at(self) -> Place:
        return Place(self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1)

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        if len(self._open) > MAX_DEPTH:
            raise XmlError(self._at, f"more than {MAX_DEPTH} elements stand in each other")
        if any(":" in key for key in attributes):
            attributes = {key.rpartition(":")[2]: value for key, value in attributes.items()}
        parser = self._parser
        at = Place(parser.CurrentLineNumber, parser.CurrentColumnNumber + 1)
        element = Element(name.rpartition(":")[2], attributes, at)
        self._open[-1].children.append(element)
        self._open.append(element)

    def _end(self, _name: str) -> None:
        self._open.pop()

    def _characters(self, text: str) -> None:
        self._open[-1].chunks.append(Chunk(text, *self._at))

    def _document_type(self, *_: object) -> None:
        raise XmlError(self._at, "a file with a document type (<!DOCTYPE) is not read; leave that line out")


def read_xml(text: str) -> Element:
    """The outermost element of a file. Raises XmlError."""
    return _Reader().read(text)
