"""Sources and locations in them.

Inside the front end a location is a character offset into one text; lines and columns are computed when needed.
A text that was made from a file of another kind (XML, an export of a whole project) knows where in that file each of
its parts stands, so that diagnostics, breakpoints and warnings that are turned off have the lines of the file.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import field
from functools import cached_property
from pathlib import PurePath
from typing import Literal, NamedTuple

from plctool.compiler.typed.nodes import Pos
from plctool.records import dataclass

_OF_OPENPLC = re.compile(r"^\s*CONFIGURATION\s+Config0\s+RESOURCE\s+Res0\s+ON\s+PLC\b", re.MULTILINE)
_PLCOPEN, _CODESYS = "http://www.plcopen.org/xml/tc6", "http://www.3s-software.com/"


@dataclass(frozen=True)
class Finding:
    """What the reader of a file has to say about it. `line` and `column` count from 1."""

    line: int
    column: int
    code: str
    message: str
    severity: Literal["error", "warning"] = "error"


@dataclass(frozen=True)
class Piece:
    """From character `offset` on, a text stands in line and column (from 1) of the file, or of another one at `path`.

    A piece that is `copied` is within one line of it. What is not was made up for what stands there, all of it at that
    one place."""

    offset: int
    line: int
    column: int
    copied: bool
    path: str = ""


class ElementName(NamedTuple):
    """From line and column (from 1) on, the file has an element of a diagram; `name` is "" after the end of one."""

    line: int
    column: int
    name: str


@dataclass(frozen=True)
class Source:
    """A text to compile; `path` is what diagnostics and debug information call it.

    `name`: what the list of globals in it is called, unless by the file. `shared`: the file had more than globals, so
    this is no part of their full names. `original`: the file, when the text was made from it, in `pieces` that begin at
    offset 0. `absent`: names, case-folded, of units whose files are missing; what needs them cannot be checked.
    `lists`: the instructions of bodies in Instruction List, and the offset where their statements begin. `elements`: of
    the diagrams in the file, in the order of their positions.
    """

    path: str
    text: str
    name: str = ""
    shared: bool = False
    original: str | None = field(default=None, repr=False)
    pieces: tuple[Piece, ...] = field(default=(), repr=False, compare=False)
    findings: tuple[Finding, ...] = field(default=(), compare=False)
    absent: frozenset[str] = field(default=frozenset(), compare=False)
    lists: tuple[tuple[int, str], ...] = field(default=(), repr=False, compare=False)
    elements: tuple[ElementName, ...] = field(default=(), repr=False, compare=False)

    @property
    def is_unreadable(self) -> bool:
        """True for XML that is not well-formed, so that no text was made of it."""
        return any(found.code == "xml" for found in self.findings)

    @cached_property
    def line_starts(self) -> list[int]:
        """Offsets of the first character of each line of the file."""
        text = self.text if self.original is None else self.original
        starts = [0]
        find = text.find
        at = find("\n")
        while at >= 0:
            starts.append(at + 1)
            at = find("\n", at + 1)
        return starts

    @cached_property
    def is_of_openplc(self) -> bool:
        """True for what OpenPLC Editor and Beremiz write, whose compiler is matiec: their XML, and the text that they
        make of it."""
        text = self.text if self.original is None else self.original
        return bool(_OF_OPENPLC.search(text)) or (_PLCOPEN in text and _CODESYS not in text)

    @cached_property
    def _offsets(self) -> list[int]:
        return [piece.offset for piece in self.pieces]

    @property
    def stem(self) -> str:
        """How a list of globals is qualified: by default the file name without folder and extension."""
        return self.name or PurePath(self.path).stem

    def pos(self, offset: int) -> Pos:
        """Line and column (from 1) of a character offset."""
        if self.pieces:
            return self._pos_in_pieces(offset)
        starts = self.line_starts
        line = bisect_right(starts, offset)
        return Pos(self.path, line, offset - starts[line - 1] + 1)

    def is_copied(self, offset: int) -> bool:
        """True if the character at `offset` stands so in the file."""
        return not self.pieces or self._piece(offset).copied

    def _piece(self, offset: int) -> Piece:
        return self.pieces[max(0, bisect_right(self._offsets, offset) - 1)]

    def _pos_in_pieces(self, offset: int) -> Pos:
        piece = self._piece(offset)
        more = offset - piece.offset if piece.copied else 0
        return Pos(piece.path or self.path, piece.line, piece.column + more)

    def element_at(self, line: int, column: int) -> str:
        """Returns the name of the element of a diagram at a position of the file; "" if there is none."""
        number = bisect_right(self.elements, (line, column), key=lambda e: (e.line, e.column))
        return self.elements[number - 1].name if number else ""

    def line_text(self, line: int) -> str:
        """The text of a line (from 1) of the file, without its end."""
        text = self.text if self.original is None else self.original
        starts = self.line_starts
        if not 1 <= line <= len(starts):
            return ""
        end = starts[line] - 1 if line < len(starts) else len(text)
        return text[starts[line - 1] : end].rstrip("\r")
