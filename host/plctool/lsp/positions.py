"""Locations of the protocol: lines from 0, columns in units of the encoding that client and server agreed upon."""

from __future__ import annotations

from lsprotocol import types as lsp
from pygls.uris import from_fs_path, to_fs_path

from plctool.compiler.base.source import Source
from plctool.files import Pos

Encoding = lsp.PositionEncodingKind | str
_BYTES = {"utf-8": 1, "utf-16": 2}


def path_of(uri: str) -> str:
    """Returns the path of a file; the URI itself if it is not one of a file."""
    return to_fs_path(uri) or uri


def uri_of(path: str) -> str:
    """Returns the URI of a path."""
    return from_fs_path(path) or path


def units(line: str, column: int, encoding: Encoding) -> int:
    """Returns the column of the protocol for a number of characters from the beginning of a line."""
    size = _BYTES.get(str(getattr(encoding, "value", encoding)))
    part = line[:column]
    if size is None or part.isascii():
        return column
    return len(part.encode("utf-8" if size == 1 else "utf-16-le", "surrogatepass")) // size


def characters(line: str, column: int, encoding: Encoding) -> int:
    """Returns the number of characters that a column of the protocol stands for; at most those of the line."""
    size = _BYTES.get(str(getattr(encoding, "value", encoding)))
    if size is None or line.isascii():
        return max(0, min(column, len(line)))
    left = column * size
    name = "utf-8" if size == 1 else "utf-16-le"
    for at, character in enumerate(line):
        left -= len(character.encode(name, "surrogatepass"))
        if left < 0:
            return at
    return len(line)


def position_at(source: Source, pos: Pos, encoding: Encoding) -> lsp.Position:
    """Returns the position of a line and column of the file of a source."""
    line = source.line_text(pos.line)
    return lsp.Position(max(0, pos.line - 1), units(line, max(0, pos.column - 1), encoding))


def range_of(source: Source, start: int, length: int, encoding: Encoding) -> lsp.Range:
    """Returns the range of a word at an offset in a source; an empty one if the word is not written so in the file."""
    pos = source.pos(start)
    first = position_at(source, Pos(*pos), encoding)
    if not source.is_copied(start):
        return lsp.Range(first, first)
    last = position_at(source, Pos(pos.file, pos.line, pos.column + length), encoding)
    return lsp.Range(first, last)


def span(source: Source, start: int, end: int, encoding: Encoding) -> lsp.Range:
    """Returns the range from one offset in a source to another, which may be in a later line."""
    first, last = source.pos(start), source.pos(max(start, end - 1))
    after = Pos(last.file, last.line, last.column + (end > start))
    return lsp.Range(position_at(source, Pos(*first), encoding), position_at(source, after, encoding))


def location(source: Source, start: int, length: int, encoding: Encoding) -> lsp.Location:
    """Returns where a word stands."""
    return lsp.Location(uri_of(source.pos(start).file), range_of(source, start, length, encoding))


def offset_in(text: str, position: lsp.Position, encoding: Encoding) -> int:
    """Returns the offset of a position in a text; that of the end for one past it."""
    at = 0
    for _ in range(position.line):
        at = text.find("\n", at) + 1
        if at == 0:
            return len(text)
    end = text.find("\n", at)
    line = text[at : len(text) if end < 0 else end]
    return at + characters(line, position.character, encoding)
