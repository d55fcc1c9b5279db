"""The variables that are at addresses such as %IX0.3 (AT), and those that statements use without a declaration.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.allocation import Allocation
from plctool.compiler.semantics.conversions import elementary
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import Role, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Initial, Storage, Variable
from plctool.iec.addresses import Address, parse_address
from plctool.iec.types import BOOL, Type, base_of

MAX_ADDRESS = 0xFFFF  # the last byte an address such as %IB65535 reaches


def is_open(location: ast.DirectAddress | None) -> bool:
    """Whether it is `%I*` and the like: VAR_CONFIG says where."""
    return location is not None and location.text.endswith("*")


def _read_address(node: ast.DirectAddress, scope: Scope) -> Address | None:
    """What `%IW2` means; None after an error."""
    address = parse_address(node.text)
    if address is None:
        scope.error(node.pos, "location", f"{node.text} is not an address such as %IX0.3 or %QW2")
    return address


def located(
    name: str, t: Type, init: Initial | None, location: ast.DirectAddress, scope: Scope, offset: int
) -> Variable | None:
    """A variable with AT, declared at `offset`; None after an error."""
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
    """The variables at addresses that statements use."""

    def __init__(self, allocation: Allocation) -> None:
        self._allocation = allocation
        self._known: dict[str, VarSymbol] = {}

    def find(self, node: ast.DirectAddress, scope: Scope) -> VarSymbol | None:
        """The variable at an address; None after an error."""
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
