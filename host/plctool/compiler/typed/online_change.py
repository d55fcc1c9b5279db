"""A program that takes the place of another one while that runs: what the compiler knows of both.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import field

from plctool.compiler.typed.nodes import Pou, Variable
from plctool.iec.areas import Area
from plctool.iec.types import StructType, Type
from plctool.records import dataclass


@dataclass(frozen=True)
class PreviousVariable:
    """Where the previous program has a variable."""

    name: str
    type: Type
    area: Area
    offset: int


@dataclass(frozen=True)
class Previous:
    """The program that runs. `variables`: by full name in small letters; `classes`: the numbers by which instances
    show their class, by name. `with_exit`: blocks, in small letters, that have an FB_Exit. `in_registers`: the
    variables of blocks that are not in memory, by the name of the block. `facts`: what the device compares besides
    (`image/online_change.py`)."""

    crc: int
    variables: Mapping[str, PreviousVariable]
    classes: Mapping[str, int]
    with_exit: frozenset[str] = frozenset()
    in_registers: Mapping[str, Collection[str]] = field(default_factory=dict)
    facts: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Fresh:
    """A part of a variable that the previous program does not have: `offset` in the variable. `owner`: the block or
    structure that it is a member of, and its offset there; None: in an array or a text. `was_in_register`: the
    previous program has it, but not in memory."""

    offset: int
    size: int
    owner: tuple[StructType, int] | None = None
    was_in_register: bool = False


@dataclass(frozen=True, order=True)
class Run:
    """Bytes that a variable had at offset `source`, and has at `to`."""

    source: int
    to: int
    size: int


@dataclass(frozen=True)
class Gone:
    """A part of a variable of the previous program that the new one does not have: `offset` in the variable."""

    offset: int
    size: int
    type: Type


@dataclass(frozen=True)
class Fill:
    """What a value has besides that became longer: zeros, or copies of the sign of the number before it."""

    offset: int
    size: int
    signed: bool


@dataclass(frozen=True)
class PointerPart:
    """A pointer, reference or interface in a variable: `offset` in that of the previous program. `to_object`: it leads
    to an instance or a structure, not to the member at its beginning. `owner`: the block or structure of the new
    program that it is a member of, and its offset there."""

    offset: int
    to_object: bool
    owner: tuple[StructType, int] | None = None


@dataclass(frozen=True)
class Kept:
    """A variable that both programs have, and what is kept of it. `objects`: the instances and structures in it, each
    with its old and its new offset."""

    variable: Variable
    before: PreviousVariable
    runs: list[Run]
    pointers: list[PointerPart]
    fills: list[Fill]
    objects: list[tuple[int, int]]

    @property
    def moved(self) -> bool:
        """True if it is at another place."""
        return (self.variable.area, self.variable.offset) != (self.before.area, self.before.offset)


@dataclass
class OnlineChange:
    """What an online change does with variables. `kept`: how many keep their values, those that are `moved` too;
    `retyped`: parts of another type, which get initial values, in words; `new`: those that get initial values;
    `removed`: names; `gone`: what the new program does not have; `parts`: what it has; `fresh`: parts of kept variables
    that are new; `constants` get their values again; `startup`: calculated initial values, and FB_Init, of new
    variables. `tasks`: what becomes of tasks that change, in words. `problems`: why there can be none, each with the
    name of its variable."""

    previous: Previous
    kept: int = 0
    moved: list[str] = field(default_factory=list)
    retyped: list[str] = field(default_factory=list)
    gone: list[tuple[PreviousVariable, Gone]] = field(default_factory=list)
    parts: list[Kept] = field(default_factory=list)
    new: list[Variable] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    fresh: list[tuple[Variable, Fresh]] = field(default_factory=list)
    constants: list[Variable] = field(default_factory=list)
    startup: Pou | None = None
    tasks: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
