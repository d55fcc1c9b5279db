"""Where statements begin in the code: what a breakpoint and a step need of the line table."""

from __future__ import annotations

import os
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

from plctool.debug.symbols import SymbolTable
from plctool.errors import UsageError


@dataclass(frozen=True)
class Statement:
    """Code of a line begins at `offset`."""

    offset: int
    file: str
    line: int


@dataclass(frozen=True)
class CodeOfLine:
    """Where a line begins: in each function that contains it. `line` may be a later one, which has code."""

    file: str
    line: int
    offsets: tuple[int, ...]


class Statements:
    """The statements of a program."""

    def __init__(self, table: SymbolTable) -> None:
        self._table = table
        self.rows = [Statement(at, table.files[f], line) for at, f, line in table.lines if f >= 0 and line > 0]
        self._offsets = [row.offset for row in self.rows]

    @cached_property
    def functions(self) -> list[tuple[int, int]]:
        """Begin and end of each function that has statements."""
        info = self._table.debug_info
        return sorted({f for row in self.rows if (f := info.function_at(row.offset)) is not None})

    def of_function(self, offset: int) -> list[Statement]:
        """The rows of the function at `offset`, by their addresses."""
        function = self._table.debug_info.function_at(offset)
        if function is None:
            return []
        return self.rows[bisect_left(self._offsets, function[0]) : bisect_left(self._offsets, function[1])]

    def line_at(self, offset: int) -> Statement | None:
        """The row that the code at `offset` belongs to; None for code without a line."""
        place = self._table.address_to_line(offset)
        i = bisect_right(self._offsets, offset) - 1
        if place is None or i < 0:
            return None
        return Statement(self._offsets[i], place.file, place.line)

    @cached_property
    def beginnings(self) -> list[int]:
        """The first statement of each function, after its entry."""
        found = []
        for begin, _ in self.functions:
            rows = self.of_function(begin)
            later = [row for row in rows if row.offset > begin and row.line != rows[0].line]
            found.append(min((row.offset for row in later), default=rows[0].offset))
        return found

    def _is_entry(self, row: Statement) -> bool:
        """Whether it is where a function makes room for its variables."""
        function = self._table.debug_info.function_at(row.offset)
        return function is not None and function[0] == row.offset and row.offset not in self.beginnings

    @cached_property
    def stops(self) -> set[int]:
        """All rows but those where a function makes room for its variables."""
        return {row.offset for row in self.rows if not self._is_entry(row)}

    def find_line(self, file: str, line: int) -> CodeOfLine:
        """The code of a line, or of the next one of the file that has code. Raises UsageError."""
        path = self.find_file(file)
        lines = sorted({row.line for row in self.rows if row.file == path})
        at = bisect_left(lines, line)
        if at == len(lines):
            raise UsageError(f"{file} has no code at line {line} or after it.", "no-code")
        rows = [row for row in self.rows if row.file == path and row.line == lines[at]]
        firsts: dict[tuple[int, int] | None, int] = {}
        for row in rows:
            function = self._table.debug_info.function_at(row.offset)
            firsts[function] = min(firsts.get(function, row.offset), row.offset)
        return CodeOfLine(path, lines[at], tuple(sorted(firsts.values())))

    def find_file(self, name: str) -> str:
        """The source file that a user means: by its path, or the end of it. Raises UsageError."""
        files = sorted({row.file for row in self.rows})
        same = [f for f in files if f == name or os.path.realpath(f) == os.path.realpath(name)]
        found = same or list(_ending(files, name)) or list(_ending(files, os.path.basename(name)))
        if len(found) == 1:
            return found[0]
        if found:
            raise UsageError(f"{name} may be {' or '.join(found)}; write more of its path.", "ambiguous-file")
        raise UsageError(f"The program has no code of {name}; it is made of {', '.join(files)}.", "unknown-file")

    def step_over(self, offset: int) -> set[int]:
        """Where statements of the same function begin that are not part of the line at `offset`, and its own begin."""
        here = self.line_at(offset)
        rows = [row for row in self.of_function(offset) if not self._is_entry(row)]
        if here is None:
            return {row.offset for row in rows}
        own = [row.offset for row in rows if row.line == here.line]
        return {row.offset for row in rows if row.line != here.line} | set(own[:1])


def _ending(files: Iterable[str], name: str) -> Iterator[str]:
    end = "/" + name.replace(os.sep, "/").lstrip("./")
    return (file for file in files if ("/" + file.replace(os.sep, "/")).endswith(end))
