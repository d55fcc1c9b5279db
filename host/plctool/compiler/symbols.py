"""What names stand for.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from plctool.compiler import ast
from plctool.compiler.source import Source
from plctool.compiler.typed import Const, Direction, Initial, Pos, Pou, Variable
from plctool.compiler.types import Elementary, Kind, PointerType, StructType, Type


class _ErrorType(Type):
    """The type of what was reported already; it fits everywhere and silences what would follow."""

    name = "?"

    @property
    def size(self) -> int:
        return 1

    @property
    def align(self) -> int:
        return 1


ERROR: Type = _ErrorType()
UNTYPED_INT = Elementary("integer constant", Kind.INT, 64, True, -1)
"""An integer literal, or a calculation of such: takes the type its surroundings need."""
UNTYPED_REAL = Elementary("real constant", Kind.REAL, 64, True, -1)
NULL_TYPE = PointerType(ERROR)


class Role(Enum):
    """How a variable was declared."""

    INPUT = "input"
    OUTPUT = "output"
    IN_OUT = "in-out"
    LOCAL = "local variable"
    TEMP = "temporary"
    GLOBAL = "global variable"
    RESULT = "result"


@dataclass(slots=True, eq=False)
class VarSymbol:
    """A variable or constant. `value` is set for constants that are folded away; those have no `variable`.

    `bit` is set for a BOOL at an address such as %IX0.3: the bit within the byte.
    """

    name: str
    pos: Pos
    type: Type
    role: Role
    variable: Variable | None = None
    value: Const | None = None
    constant: bool = False
    default: Initial | None = None
    given: bool = False  # has an initial value of its own
    by_reference: bool = False
    used: bool = False


@dataclass(slots=True, eq=False)
class GlobalSymbol:
    """A global variable before anybody asked for it; `symbol` once it is declared."""

    name: str
    full_name: str
    pos: int
    decl: ast.VarDecl
    qualifiers: set[str]
    source: Source
    symbol: VarSymbol | None = None
    busy: bool = False


@dataclass(slots=True, eq=False)
class TypeSymbol:
    """A declared type; `type` once it is resolved. `default` is what variables of it start with."""

    decl: ast.TypeDecl
    library: bool
    type: Type | None = None
    default: Initial | None = None
    busy: bool = False


@dataclass(slots=True, eq=False)
class PouSymbol:
    """A declared FUNCTION, FUNCTION_BLOCK or PROGRAM."""

    decl: ast.PouDecl
    library: bool

    @property
    def keyword(self) -> str:
        """FUNCTION, FUNCTION_BLOCK or PROGRAM."""
        return self.decl.keyword


@dataclass(slots=True, eq=False)
class Namespace:
    """A list of globals, or a program instance: `GVL.x`, `Main.x`."""

    name: str
    what: str
    members: dict[str, GlobalSymbol | VarSymbol]


Unit = TypeSymbol | PouSymbol
Symbol = VarSymbol | GlobalSymbol | Unit | Namespace


@dataclass(slots=True, eq=False)
class FunctionInfo:
    """A FUNCTION ready to be called; `parameters` are VarSymbols in order of `pou.parameters`."""

    pou: Pou
    parameters: list[tuple[VarSymbol, Direction]]
    result: Type | None
    attributes: dict[str, str]


@dataclass(slots=True, eq=False)
class BlockInfo:
    """A FUNCTION_BLOCK: its unit, the layout of an instance and its variables by case-folded name."""

    pou: Pou
    type: StructType
    members: dict[str, VarSymbol] = field(default_factory=dict)
    retain: bool = False  # instances live in the retain area as a whole
