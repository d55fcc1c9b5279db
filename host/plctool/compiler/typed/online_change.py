"""A program that takes the place of another one while that runs: what the compiler knows of both.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from plctool.compiler.typed.nodes import Pou, Variable
from plctool.iec.areas import Area
from plctool.iec.types import StructType, Type


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


@dataclass
class OnlineChange:
    """What an online change does with variables. `kept`: how many keep their places; `new`: those that get initial
    values; `removed`: names; `fresh`: parts of kept variables that are new; `constants` get their values again;
    `startup`: calculated initial values, and FB_Init, of new variables. `problems`: why there can be none, each with
    the name of its variable."""

    previous: Previous
    kept: int = 0
    new: list[Variable] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    fresh: list[tuple[Variable, Fresh]] = field(default_factory=list)
    constants: list[Variable] = field(default_factory=list)
    startup: Pou | None = None
    problems: list[str] = field(default_factory=list)
