"""What all requests share: the open programs, and the way from a position in the editor to a word of a program."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lsprotocol import types as lsp

from plctool.compiler.base.source import Source
from plctool.compiler.syntax.lexer import Token
from plctool.files import Pos
from plctool.lsp import positions
from plctool.lsp.items import Item
from plctool.lsp.names import STANDARD
from plctool.lsp.project import Project
from plctool.lsp.tree import Tree
from plctool.lsp.uses import Use
from plctool.lsp.workspace import Workspace

_PACKAGE = Path(__file__).resolve().parent.parent


class Refused(Exception):
    """A request that cannot be answered; the message says why, for the user."""


@dataclass(frozen=True)
class Place:
    """A position in a tree; `offset` is in the text of its source."""

    project: Project
    tree: Tree
    offset: int

    @property
    def token(self) -> Token | None:
        """The word at the position."""
        return self.tree.word_at(self.offset)

    def use(self) -> Use | None:
        """Returns what the word at the position stands for."""
        uses = self.project.walk(self.tree).uses
        found = [u for u in uses if u.offset <= self.offset <= u.offset + u.length]
        return found[-1] if found else None  # after the # of Color#Red the value

    def item(self) -> Item | None:
        """Returns the item that the word at the position stands for."""
        use = self.use()
        return None if use is None else self.project.names.by_key(use.key)


class Session:
    """The state of a server. `encoding`: of columns."""

    def __init__(self) -> None:
        self.workspace = Workspace([])
        self.encoding: positions.Encoding = lsp.PositionEncodingKind.Utf16
        self.snippets = False
        self.hierarchical = True

    def place(self, uri: str, position: lsp.Position) -> Place | None:
        """Returns the place of a position; None if the text of the file is not part of a program there."""
        path = positions.path_of(uri)
        project = self.workspace.project_of(path)
        if project is None:
            return None
        for tree in project.trees_of(path):
            offset = self._offset(tree.source, path, position)
            if offset is not None:
                return Place(project, tree, offset)
        return None

    def _offset(self, source: Source, path: str, position: lsp.Position) -> int | None:
        if not source.pieces:
            return self._plain_offset(source, position)
        column = positions.characters(source.line_text(position.line + 1), position.character, self.encoding) + 1
        for at, piece in enumerate(source.pieces):
            if not piece.copied or piece.line != position.line + 1 or (piece.path or source.path) != path:
                continue
            end = source.pieces[at + 1].offset if at + 1 < len(source.pieces) else len(source.text)
            offset = piece.offset + column - piece.column
            if piece.offset <= offset <= end:
                return offset
        return None

    def _plain_offset(self, source: Source, position: lsp.Position) -> int:
        starts = source.line_starts
        if position.line >= len(starts):
            return len(source.text)
        line = source.line_text(position.line + 1)
        return starts[position.line] + positions.characters(line, position.character, self.encoding)

    # ---- to the editor ----

    def range(self, source: Source, offset: int, length: int) -> lsp.Range:
        """Returns where a word stands."""
        return positions.range_of(source, offset, length, self.encoding)

    def span(self, source: Source, start: int, end: int) -> lsp.Range:
        """Returns a range over lines."""
        return positions.span(source, start, end, self.encoding)

    def location(self, source: Source, offset: int, length: int) -> lsp.Location:
        """Returns the file and range of a word."""
        return positions.location(source, offset, length, self.encoding)

    def location_of(self, item: Item) -> lsp.Location | None:
        """Returns where an item is declared; None for one that is in no file."""
        source = item.source
        if item.library == STANDARD:
            file = _PACKAGE / source.path
            if not file.is_file():
                return None
            pos = source.pos(item.offset)
            at = lsp.Position(pos.line - 1, pos.column - 1)
            end = lsp.Position(pos.line - 1, pos.column - 1 + len(item.name))
            return lsp.Location(positions.uri_of(str(file)), lsp.Range(at, end))
        if not source.text or not Path(source.pos(item.offset).file).is_file():
            return None
        length = len(item.name) if source.text.startswith(item.name, item.offset) else 0
        return self.location(source, item.offset, length)

    def position(self, source: Source, line: int, column: int) -> lsp.Position:
        """Returns the position of a line and column of a file, from 1."""
        return positions.position_at(source, Pos(source.path, line, column), self.encoding)
