"""Builds a source text from parts of a file, and from what has to be written between them.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Literal, NamedTuple

from plctool.compiler.source import Finding, Piece, Source


class Place(NamedTuple):
    """Line and column in a file, from 1."""

    line: int
    column: int


class Chunk(NamedTuple):
    """Characters of a file, where the first of them stands."""

    text: str
    line: int
    column: int


class Findings:
    """What is said about a file while it is read; each thing once."""

    def __init__(self) -> None:
        self._found: dict[Finding, None] = {}

    def add(self, at: Place, code: str, message: str, severity: Literal["error", "warning"] = "error") -> None:
        """Notes a finding."""
        self._found[Finding(at.line, at.column, code, message, severity)] = None

    def refuse(self, at: Place, what: str, language: str) -> None:
        """A body that is no Structured Text."""
        self.add(at, "language", f"{what} is written in {language}; only Structured Text can be compiled")

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

    def join(self, other: Text) -> None:
        """Adds another text at the end."""
        self._pieces += [replace(piece, offset=piece.offset + self._length) for piece in other._pieces]
        self._parts += other._parts
        self._length += other._length

    def _add(self, text: str, line: int, column: int, *, copied: bool) -> None:
        if text:
            self._pieces.append(Piece(self._length, line, column, copied))
            self._parts.append(text)
            self._length += len(text)

    def source(self, path: str, original: str, *, name: str = "", findings: tuple[Finding, ...] = ()) -> Source:
        """The text as a source of that file."""
        pieces = tuple(self._pieces) or (Piece(0, 1, 1, copied=False),)
        return Source(path, "".join(self._parts), name, "", original, pieces, findings)


def lines_of(text: str) -> list[Chunk]:
    """A whole file, line by line."""
    return [Chunk(line, number, 1) for number, line in enumerate(_lines(text), 1)]


def _lines(text: str) -> list[str]:
    """With their ends; only a newline ends a line, as in every other place of the compiler."""
    if "\n" not in text:
        return [text]
    *whole, last = text.split("\n")
    return [f"{line}\n" for line in whole] + ([last] if last else [])
