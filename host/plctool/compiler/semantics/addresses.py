"""Addresses such as %IX0.3, and the variables that lie at them (AT). Words, double words ... are numbered, as CODESYS
does it: %IW1 is bytes 2 and 3.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from plctool.compiler.semantics.allocation import Allocation
from plctool.compiler.semantics.conversions import elementary
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import Role, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Initial, Storage, Variable
from plctool.iec.areas import Area
from plctool.iec.types import BOOL, ELEMENTARY, Elementary, Type, base_of

MAX_ADDRESS = 0xFFFF  # the last byte an address such as %IB65535 reaches
AREAS = {"I": Area.INPUT, "Q": Area.OUTPUT, "M": Area.MEMORY}
_ADDRESS = re.compile(r"%([IQM])([XBWDL]?)(\d+)(?:\.(\d+))?")
_WIDTHS = {"X": 0, "": 0, "B": 8, "W": 16, "D": 32, "L": 64}
_TYPES: dict[int, Elementary] = {
    0: BOOL, 8: ELEMENTARY["BYTE"], 16: ELEMENTARY["WORD"], 32: ELEMENTARY["DWORD"], 64: ELEMENTARY["LWORD"],
}  # fmt: skip


@dataclass(frozen=True)
class Address:
    """`width` in bits, 0 for a single one; `offset` in bytes."""

    area: Area
    width: int
    offset: int
    bit: int

    @property
    def type(self) -> Elementary:
        """Of what is there when no declaration says otherwise."""
        return _TYPES[self.width]


def is_open(location: ast.DirectAddress | None) -> bool:
    """Whether it is `%I*` and the like: VAR_CONFIG says where."""
    return location is not None and location.text.endswith("*")


def _read_address(node: ast.DirectAddress, scope: Scope) -> Address | None:
    """What `%IW2` means; None after a diagnosis."""
    match = _ADDRESS.fullmatch(node.text.upper())
    letter, size, first, second = match.groups() if match is not None else ("", "", "", None)
    width = _WIDTHS[size]
    too_long = len(first) > 6 or len(second or "") > 3
    if match is None or too_long or (second is not None and (width or int(second) > 7)):
        scope.error(node.pos, "location", f"{node.text} is not an address such as %IX0.3 or %QW2")
        return None
    number = int(first)
    if width:
        return Address(AREAS[letter], width, number * width // 8, 0)
    byte, bit = (number, int(second)) if second is not None else divmod(number, 8)
    return Address(AREAS[letter], 0, byte, bit)


def located(
    name: str, t: Type, init: Initial | None, location: ast.DirectAddress, scope: Scope, offset: int
) -> Variable | None:
    """A variable with AT, declared at `offset`; None after a diagnosis."""
    address = _read_address(location, scope)
    if address is None:
        return None
    base = elementary(t)
    problem = ""
    if address.width == 0 and base_of(t) is not BOOL:
        problem = f"{location.text} is a bit, {t} is not"
    elif address.width and base is not None and base.bits != address.width:
        problem = f"{t} has {base.bits} bits, {location.text} {address.width}"
    elif address.offset % t.align:
        problem = f"{t} needs an address that is a multiple of {t.align} bytes"
    elif address.offset + t.size > MAX_ADDRESS + 1:
        problem = f"{location.text} is too far; addresses end at byte {MAX_ADDRESS}"
    if problem:
        scope.error(location.pos, "location", problem)
        return None
    bit = address.bit if address.width == 0 else None
    return Variable(name, t, Storage.AREA, scope.pos(offset), address.area, address.offset, init, bit=bit)


class DirectVariables:
    """The variables behind addresses that statements use."""

    def __init__(self, allocation: Allocation) -> None:
        self._allocation = allocation
        self._known: dict[str, VarSymbol] = {}

    def find(self, node: ast.DirectAddress, scope: Scope) -> VarSymbol | None:
        """The variable at an address; None after a diagnosis."""
        key = node.text.upper()
        symbol = self._known.get(key)
        if symbol is not None:
            return symbol
        address = _read_address(node, scope)
        variable = None if address is None else located(key, address.type, None, node, scope, node.pos)
        if address is None or variable is None:
            return None
        self._allocation.add(variable)
        symbol = self._known[key] = VarSymbol(key, variable.pos, address.type, Role.GLOBAL, variable)
        return symbol
