"""Builds a source text from parts of a file, and from what has to be written between them.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from plctool.compiler.base.source import ElementName, Finding, Piece, Source


class Place(NamedTuple):
    """Line and column in a file, from 1."""

    line: int
    column: int


class Chunk(NamedTuple):
    """Characters of a file, where the first of them stands."""

    text: str
    line: int
    column: int


class Listing(NamedTuple):
    """The instructions that the following statements were made of."""

    text: str


Part = Chunk | Listing | tuple[str, Place]
"""What a text is made of: parts of the file, and what is made for a place in it."""


class Findings:
    """What is said about a file while it is read; each thing once."""

    def __init__(self) -> None:
        self._found: dict[Finding, None] = {}

    def add(self, at: Place, code: str, message: str) -> None:
        """Notes an error."""
        self._found[Finding(at.line, at.column, code, message)] = None

    def warning(self, at: Place, code: str, message: str) -> None:
        """Notes a warning."""
        self._found[Finding(at.line, at.column, code, message, "warning")] = None

    def refuse(self, at: Place, what: str, language: str, advice: str = "only Structured Text can be compiled") -> None:
        """A body that is no Structured Text, and what to do about it."""
        self.add(at, "language", f"{what} is written in {language}; {advice}")

    @property
    def all(self) -> tuple[Finding, ...]:
        """In the order in which they were found."""
        return tuple(self._found)


class Text:
    """A text that grows; it remembers where each part comes from."""

    def __init__(self) -> None:
        self._parts: list[str] = []
        self._pieces: list[Piece] = []
        self._length = 0
        self._lists: list[tuple[int, str]] = []
        self._elements: list[ElementName] = []

    def __bool__(self) -> bool:
        return bool(self._parts)

    def made(self, text: str, at: Place) -> None:
        """Adds what is not in the file, for what stands at a place there."""
        self._add(text, at.line, at.column, copied=False)

    def copied(self, chunks: Iterable[Chunk]) -> None:
        """Adds parts of the file as they are."""
        for chunk in chunks:
            line, column = chunk.line, chunk.column
            for part in _lines(chunk.text):
                self._add(part, line, column, copied=True)
                line, column = line + 1, 1

    def named(self, elements: Iterable[ElementName]) -> None:
        """Takes the names of elements of the file."""
        self._elements += elements

    def parts(self, parts: Iterable[Part]) -> None:
        """Adds several parts."""
        for part in parts:
            if isinstance(part, Chunk):
                self.copied([part])
            elif isinstance(part, Listing):
                self._lists.append((self._length, part.text))
            else:
                self.made(*part)

    def spliced(self, text: str, inserts: Iterable[tuple[int, int, str | list[Part]]]) -> None:
        """Adds a whole file in which parts are other ones: from offset, to offset, what stands there instead. The parts
        are in order and do not overlap."""
        at, line, start = 0, 1, 0
        for begin, end, instead in inserts:
            self.copied([Chunk(text[at:begin], line, at - start + 1)])
            line += text.count("\n", at, begin)
            start = max(start, text.rfind("\n", at, begin) + 1)
            self.parts([(instead, Place(line, max(1, begin - start)))] if isinstance(instead, str) else instead)
            line += text.count("\n", begin, end)
            start = max(start, text.rfind("\n", begin, end) + 1)
            at = end
        self.copied([Chunk(text[at:], line, at - start + 1)])

    def source_text(self, source: Source) -> None:
        """Adds the text of a whole file that may be another one."""
        pieces = source.pieces or Text.of_lines(source.text)
        self._pieces += [replace(p, offset=p.offset + self._length, path=p.path or source.path) for p in pieces]
        self._lists += [(offset + self._length, text) for offset, text in source.lists]
        self._parts.append(source.text)
        self._length += len(source.text)
        self.made("\n", Place(pieces[-1].line, pieces[-1].column))

    @staticmethod
    def of_lines(text: str) -> tuple[Piece, ...]:
        """The pieces of a text that is the file."""
        made = Text()
        made.copied([Chunk(text, 1, 1)])
        return tuple(made._pieces) or (Piece(0, 1, 1, copied=False),)

    def _add(self, text: str, line: int, column: int, *, copied: bool) -> None:
        if text:
            self._pieces.append(Piece(self._length, line, column, copied))
            self._parts.append(text)
            self._length += len(text)

    def source(
        self, path: str, original: str, *, name: str = "", shared: bool = False, findings: tuple[Finding, ...] = ()
    ) -> Source:
        """The text as a source of that file."""
        pieces = tuple(self._pieces) or (Piece(0, 1, 1, copied=False),)
        text = "".join(self._parts)
        lists, elements = tuple(self._lists), tuple(sorted(self._elements))
        return Source(path, text, name, shared, original, pieces, findings, lists=lists, elements=elements)


def _lines(text: str) -> list[str]:
    """With their ends; only a newline ends a line, as in every other place of the compiler."""
    if "\n" not in text:
        return [text]
    *whole, last = text.split("\n")
    return [f"{line}\n" for line in whole] + ([last] if last else [])
