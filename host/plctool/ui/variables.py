"""The variables of a program as a tree: what is below a name, what a search finds, and what can be done with each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import islice
from math import prod
from typing import Any

from plctool.debug.symbols import SymbolTable
from plctool.debug.variables import Symbol
from plctool.errors import UsageError
from plctool.iec.types import (
    ArrayType,
    Elementary,
    EnumType,
    InterfaceType,
    Kind,
    OpenArrayType,
    PointerType,
    StringType,
    StructType,
    Type,
    base_of,
)

AT_ONCE = 200
"""Rows of one reply; the others are asked for when they are wanted."""


@dataclass(frozen=True)
class Row:
    """A variable, or a group of them by the first part of their names. `opens`: there is something below it. The others
    say what can be done with its value; `choices` are the names of an enumeration."""

    name: str
    label: str
    type: str = ""
    opens: bool = False
    value: bool = False
    write: bool = False
    force: bool = False
    plot: bool = False
    choices: tuple[str, ...] = ()


class Tree:
    """The tree of one program. Names come from a browser: any of them may be wrong."""

    def __init__(self, table: SymbolTable) -> None:
        self._table = table
        self._groups: dict[str, dict[str, str]] = {}  # name of a group: its members by their names, with their labels
        for name in table.variables | table.constants:
            if "%" not in name:
                self._add(name)

    def _add(self, name: str) -> None:
        parts = name.split(".")
        for i, label in enumerate(parts):
            self._groups.setdefault(".".join(parts[:i]), {})[".".join(parts[: i + 1])] = label

    def children(self, path: str, start: int = 0) -> dict[str, Any]:
        """Returns the rows below `path` from the `start`th on, and whether there are more. Raises UsageError."""
        rows = islice(self._below(path, start), AT_ONCE + 1)
        found = [asdict(row) for row in rows]
        return {"rows": found[:AT_ONCE], "more": len(found) > AT_ONCE}

    def _below(self, path: str, start: int) -> Iterator[Row]:
        if path in self._groups:
            return (self._row(name, label) for name, label in _by_name(self._groups[path])[start:])
        symbol = self._table.resolve(path)
        names = _names_below(symbol, start)
        return (self._row(name, name.removeprefix(symbol.name).removeprefix(".")) for name in names)

    def _row(self, name: str, label: str) -> Row:
        try:
            return row(self._table.resolve(name), name, label)
        except UsageError:  # a group, or an array without bounds of its own
            return Row(name, label, opens=name in self._groups)

    def search(self, text: str) -> dict[str, Any]:
        """Returns the variables in whose names all words of `text` are, without regard to case."""
        words = text.casefold().split()
        names = (symbol.name for symbol in self._table.find(["*"]))
        found = (self._row(n, n) for n in names if all(word in n.casefold() for word in words))
        rows = [asdict(row) for row in islice(found, AT_ONCE + 1)]
        return {"rows": rows[:AT_ONCE], "more": len(rows) > AT_ONCE}


def _by_name(members: dict[str, str]) -> list[tuple[str, str]]:
    """Returns them by name, without regard to case."""
    return sorted(members.items(), key=lambda member: member[0].casefold())


def _names_below(symbol: Symbol, start: int) -> Iterator[str]:
    t = symbol.type
    if isinstance(t, ArrayType):
        return (f"{symbol.name}[{_index(t, flat)}]" for flat in range(prod(map(_length, t.bounds)))[start:])
    if isinstance(t, PointerType) and not isinstance(t, InterfaceType):
        return islice((f"{symbol.name}^",), start, None)
    return islice((part.name for part in symbol.parts() if "%" not in part.name), start, None)


def _length(bounds: tuple[int, int]) -> int:
    return bounds[1] - bounds[0] + 1


def _index(t: ArrayType, flat: int) -> str:
    """The indices of an element by its number: those of a large array are not all made for a few of them."""
    indices: list[int] = []
    for low, high in reversed(t.bounds):
        flat, index = divmod(flat, _length((low, high)))
        indices.insert(0, low + index)
    return ",".join(map(str, indices))


def row(symbol: Symbol, name: str, label: str) -> Row:
    """Returns the row of a variable."""
    t = symbol.type
    whole = isinstance(t, StructType | ArrayType | OpenArrayType)
    pointer = isinstance(t, PointerType) and not isinstance(t, InterfaceType)
    writable = not whole and _is_writable(symbol)
    return Row(
        name,
        label,
        str(t) if symbol.bit is None else "BOOL",
        opens=pointer or isinstance(t, StructType | ArrayType),
        value=not whole,
        write=writable,
        force=writable and not isinstance(t, StringType),
        plot=symbol.bit is not None or is_number(t),
        choices=choices_of(symbol),
    )


def _is_writable(symbol: Symbol) -> bool:
    try:
        symbol.check_writable(symbol.area)
    except UsageError:
        return False
    return True


def is_number(t: Type) -> bool:
    """True for a type whose values a plot can show."""
    base = base_of(t)
    is_enum = isinstance(t, EnumType)
    return not is_enum and isinstance(base, Elementary) and base.kind in (Kind.BOOL, Kind.BIT, Kind.INT, Kind.REAL)


def choices_of(symbol: Symbol) -> tuple[str, ...]:
    """Returns the names of the values of an enumeration."""
    t = symbol.type
    return tuple(t.values) if isinstance(t, EnumType) and symbol.bit is None else ()
