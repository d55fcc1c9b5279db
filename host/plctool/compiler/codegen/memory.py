"""What a run of instructions without branches and calls knows of memory: values that need not be loaded again, and
stores that nothing has read yet.

LLVM finds this out as well, but for long bodies it takes more time than anything else of it.
"""

from __future__ import annotations

from plctool.compiler.codegen.ir import Value

_CELL = 8  # bytes: of accesses within multiples of it, those that overlap are in one cell
_SIZES = {"i8": 1, "i16": 2, "i32": 4, "i64": 8, "float": 4, "double": 8, "ptr": 8}

_Access = tuple[int, str]  # offset, LLVM type


class Memory:
    """Places are bytes after a base, a pointer; what two bases point to may be the same. `since`: as Function.barriers
    counts; with another number nothing of it holds any more."""

    def __init__(self, since: int = -1) -> None:
        self.since = since
        self._values: dict[Value, dict[int, dict[_Access, Value]]] = {}
        self._unread: dict[Value, dict[int, dict[_Access, int]]] = {}

    def value(self, base: Value, offset: int, text: str) -> Value | None:
        """What a load of the type `text` would give, if that is known."""
        known = self._values.get(base)
        cell = known.get(offset // _CELL) if known else None
        return cell.get((offset, text)) if cell else None

    def note_load(self, base: Value, offset: int, text: str, value: Value) -> None:
        """`value` was loaded."""
        unread = self._unread.get(base)
        self._unread = {base: unread} if unread else {}  # another base may be a way to the same place
        number = offset // _CELL
        if _straddles(offset, text):
            self._unread = {}
            return
        if unread and number in unread:
            _drop(unread[number], offset, _SIZES[text])
        self._values.setdefault(base, {}).setdefault(number, {})[offset, text] = value

    def note_store(self, base: Value, offset: int, text: str, value: Value, line: int) -> int | None:
        """`value` was stored by instruction `line`: gives the one of an earlier store that nothing has read, and that
        need not have been."""
        number = offset // _CELL
        if _straddles(offset, text):
            self._values, self._unread = {}, {}
            return None
        known = self._values.get(base, {})
        self._values = {base: known}
        cell = known.setdefault(number, {})
        _drop(cell, offset, _SIZES[text])
        cell[offset, text] = value
        lines = self._unread.setdefault(base, {}).setdefault(number, {})
        before = lines.get((offset, text))
        _drop(lines, offset, _SIZES[text])
        lines[offset, text] = line
        return before


def _drop(cell: dict[_Access, Value] | dict[_Access, int], offset: int, size: int) -> None:
    """Drops what overlaps `size` bytes at `offset`."""
    for at, text in [key for key in cell if key[0] < offset + size and offset < key[0] + _SIZES[key[1]]]:
        del cell[at, text]


def _straddles(offset: int, text: str) -> bool:
    """Whether an access reaches over a multiple of the size of a cell, as in packed structures."""
    return offset // _CELL != (offset + _SIZES[text] - 1) // _CELL
