"""Where variables are: the areas, addresses such as %IX0.3 in declarations and statements, variables that share memory.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from plctool.compiler.semantics.conversions import elementary
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.stable_places import StablePlaces
from plctool.compiler.semantics.symbols import Role, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.typed.nodes import Initial, Pos, Storage, Variable
from plctool.compiler.typed.online_change import Previous
from plctool.iec.addresses import Address, ModuleAddress, parse_address, parse_module_address
from plctool.iec.areas import Area
from plctool.iec.types import BOOL, Type, align_up, base_of

# ---- the areas ----


class Allocation:
    """The variables that live in the areas, and their offsets there. `previous`: the program that they shall replace
    while it runs."""

    def __init__(self, previous: Previous | None = None) -> None:
        self.stable = None if previous is None else StablePlaces(previous)
        self.sizes: dict[Area, int] = {area: 0 for area in Area if area is not Area.CODE}
        self.variables: list[Variable] = []
        self.once_placed: list[Callable[[], None]] = []  # called when all offsets are known

    def add(self, variable: Variable) -> None:
        """Adds a variable, which gets its offset when all are known, unless it has an address."""
        self.variables.append(variable)

    def place(self) -> None:
        """Gives each variable without an address the next offset in its area. Inputs and outputs get theirs after
        that (`io_channels.py`)."""
        if self.stable is not None:
            self.stable.place(self.variables)
        for variable in self.variables:
            t, area = variable.type, variable.area
            if variable.offset < 0 and area not in (Area.INPUT, Area.OUTPUT):
                variable.offset = align_up(self.sizes[area], t.align)
            if variable.offset >= 0:
                self.sizes[area] = max(self.sizes[area], variable.offset + t.size)


# ---- addresses ----

_LETTERS = {8: "B", 16: "W", 32: "D", 64: "L"}
_AREA_AND_SIZE = "%IQMXBWDL"  # before the number of an address
_NO_SUCH_BIT = re.compile(r"%[IQM]X?\d+\.([89]|[1-9]\d+)", re.IGNORECASE)
MAX_ADDRESS = 0xFFFF  # the last byte an address such as %IB65535 reaches


def is_open(location: ast.DirectAddress | None) -> bool:
    """Whether it is `%I*` and the like: VAR_CONFIG says where."""
    return location is not None and location.text.endswith("*")


def _read_address(node: ast.DirectAddress, scope: Scope) -> Address | None:
    """What `%IW2` means; None after an error."""
    address = parse_address(node.text)
    if address is None:
        scope.error(node.pos, "location", _not_an_address(node.text))
    return address


def _not_an_address(text: str) -> str:
    address = parse_module_address(text)
    if address is None:
        hint = "; a byte has the bits 0 to 7" if _NO_SUCH_BIT.fullmatch(text) else ""
        return f"{text} is not an address such as %IX0.3 or %QW2{hint}"
    if address.area is Area.MEMORY:
        return f"{text}: the memory %M has no modules; number its bytes or words, as in {address.numbered}"
    return f"{text} is in a module, and only a channel of a description of inputs and outputs may lead there"


def module_address(location: ast.DirectAddress | None) -> ModuleAddress | None:
    """What `%IX4.0.1` means, None when it is none such; the memory has no modules."""
    address = None if location is None else parse_module_address(location.text)
    return None if address is None or address.area is Area.MEMORY else address


def misfit(t: Type, text: str, width: int) -> str:
    """Why a variable cannot be at an address of that width in bits (0: a single one); "" when it can."""
    return not_a_place(t, text, width) or other_size(t, text, width)


def not_a_place(t: Type, text: str, width: int) -> str:
    """Why a bit cannot be at an address for bytes, or bytes at one for a bit; "" when it fits."""
    base = elementary(t)
    if width == 0 and base_of(t) is not BOOL:
        letter = "" if base is None else _LETTERS.get(base.bits, "")
        byte = f"B{text.strip(_AREA_AND_SIZE).partition('.')[0]}"
        where = f"{text[:2]}{f'{letter} and a number' if letter else byte}"
        return f"{text} is a bit, {t} is not; write {where}"
    if width not in (0, 8) and base is BOOL:
        return f"a BOOL is at a bit such as {text[:2]}X0.3, {text} has {width}"
    return ""


def other_size(t: Type, text: str, width: int, offset: int = -1) -> str:
    """What is to be said of a number at an address of another size; "" of one that fits. `offset`: the byte of it, if
    that is known."""
    base = elementary(t)
    if not width or base is None or base.bits == width or base is BOOL:
        return ""
    number = f"{offset * 8 // base.bits}" if offset >= 0 and offset * 8 % base.bits == 0 else " and a number"
    return f"{t} has {base.bits} bits, {text} {width}; write {text[:2]}{_LETTERS[base.bits]}{number}"


def located(
    name: str, t: Type, init: Initial | None, location: ast.DirectAddress, scope: Scope, offset: int
) -> Variable | None:
    """A variable with AT, declared at `offset`; None after an error."""
    address = _read_address(location, scope)
    if address is None:
        return None
    problem = not_a_place(t, location.text, address.width)
    if not problem and address.offset % t.align:
        problem = f"{t} needs an address that is a multiple of {t.align} bytes"
    elif address.offset + t.size > MAX_ADDRESS + 1:
        problem = f"{location.text} is too far; addresses end at byte {MAX_ADDRESS}"
    if problem:
        scope.error(location.pos, "location", problem)
        return None
    other = other_size(t, location.text, address.width, address.offset)
    if other and address.width != 8:  # %MB4 counts bytes, whatever is there
        scope.warning(location.pos, "address", f"{other}, which is the same place")
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
        return self._add(key, variable)

    def in_module(self, address: ModuleAddress, pos: Pos, bound: str) -> VarSymbol | None:
        """The variable at an address of modules: the one that is called `bound`, or if that is "" one of its own. None
        if the program has not declared it yet."""
        symbol = self._known.get(address.text)
        if symbol is not None:
            return symbol
        if not bound:
            return self._add(address.text, Variable(address.text, address.type, Storage.AREA, pos, address.area))
        variable = next((v for v in self._allocation.variables if v.name == bound), None)
        return None if variable is None else VarSymbol(bound, pos, variable.type, Role.GLOBAL, variable)

    def _add(self, key: str, variable: Variable) -> VarSymbol:
        self._allocation.add(variable)
        symbol = self._known[key] = VarSymbol(key, variable.pos, variable.type, Role.GLOBAL, variable)
        return symbol


# ---- variables that share memory ----


def report_overlaps(variables: Iterable[Variable], diagnostics: Diagnostics) -> None:
    """Warns of variables that are over others, at the one that is declared later, unless that is meant."""
    located = [v for v in variables if v.area in (Area.INPUT, Area.OUTPUT, Area.MEMORY) and not v.name.startswith("%")]
    numbers = {variable: number for number, variable in enumerate(located)}
    reaching: list[Variable] = []
    for variable in sorted(located, key=lambda v: (v.area.value, *_bits(v))):
        start, _ = _bits(variable)
        reaching = [v for v in reaching if v.area is variable.area and _bits(v)[1] > start]
        for other in reaching:
            if _is_meant(variable, other):
                continue
            later, earlier = sorted((variable, other), key=lambda v: numbers[v], reverse=True)
            where = f"in line {earlier.pos.line}" if earlier.pos.file == later.pos.file else f"in {earlier.pos.file}"
            message = f"{later.name} shares its memory with {earlier.name} {where}"
            diagnostics.warning(later.pos, "overlap", message)
        reaching.append(variable)


def _is_meant(one: Variable, other: Variable) -> bool:
    """A bit of something larger, in the memory area any part of something larger; the instances of one PROGRAM."""
    if one.pos == other.pos or (one.bit is None) != (other.bit is None):
        return True
    (start, end), (other_start, other_end) = _bits(one), _bits(other)
    within = (start >= other_start and end <= other_end) or (other_start >= start and other_end <= end)
    return one.area is Area.MEMORY and within and one.type.size != other.type.size


def _bits(variable: Variable) -> tuple[int, int]:
    """The first bit, and the one past the end of the variable."""
    first = variable.offset * 8
    if variable.bit is not None:
        return first + variable.bit, first + variable.bit + 1
    return first, first + variable.type.size * 8
