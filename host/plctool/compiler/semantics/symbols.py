"""What names stand for.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import field
from enum import Enum

from plctool.compiler.base.source import Source
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.ast import Section
from plctool.compiler.typed.nodes import Const, Direction, Initial, Pos, Pou, Variable
from plctool.iec.types import Elementary, Keep, Kind, PointerType, StructType, Type
from plctool.records import dataclass


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


class _Nothing(Type):
    """The result of what returns none."""

    name = "nothing"


NOTHING: Type = _Nothing()
UNTYPED_INT = Elementary("integer constant", Kind.INT, 64, True, -1)
"""An integer literal, or a calculation of such: takes the type its surroundings need."""
UNTYPED_REAL = Elementary("real constant", Kind.REAL, 64, True, -1)
NULL_TYPE = PointerType(ERROR)


DIRECTIONS = {
    Section.VAR_INPUT: Direction.INPUT,
    Section.VAR_OUTPUT: Direction.OUTPUT,
    Section.VAR_IN_OUT: Direction.IN_OUT,
}
"""Of parameters, by the keyword of their section."""


class Role(Enum):
    """How a variable was declared."""

    INPUT = "input"
    OUTPUT = "output"
    IN_OUT = "in-out"
    LOCAL = "local variable"
    TEMP = "temporary"
    STEP = "step"  # of a Sequential Function Chart
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
    access: ast.Modifier | None = None  # PUBLIC, PRIVATE, PROTECTED or INTERNAL, where it is written
    keep: Keep = Keep.UNSAID  # what the section of a member says
    is_path: bool = False  # starts with the path of its instance
    group: str = ""  # ANY_... of a parameter that describes its argument (any_values.py)
    open_area: str = ""  # I, Q or M: of a member of a function block AT %I*, %Q* or %M*


@dataclass(slots=True, eq=False)
class GlobalSymbol:
    """A global variable before its first use; `symbol` once it is declared."""

    name: str
    full_name: str
    pos: int
    decl: ast.VarDecl
    qualifiers: set[ast.Modifier]
    source: Source
    symbol: VarSymbol | None = None
    busy: bool = False
    namespace: ast.Namespace | None = None


@dataclass(slots=True, eq=False)
class TypeSymbol:
    """A declared type; `type` once it is resolved. `default` is what variables of it start with."""

    decl: ast.TypeDecl
    library: bool
    type: Type | None = None
    default: Initial | None = None
    busy: bool = False

    @property
    def full_name(self) -> str:
        """With the namespace in front."""
        space = self.decl.namespace
        return f"{space.name}.{self.decl.name}" if space is not None and space.name else self.decl.name


@dataclass(slots=True, eq=False)
class PouSymbol:
    """A declared FUNCTION, FUNCTION_BLOCK, INTERFACE or PROGRAM."""

    decl: ast.PouDecl
    library: bool

    @property
    def full_name(self) -> str:
        """With the namespace in front."""
        return self.decl.full_name

    @property
    def keyword(self) -> ast.Unit:
        """FUNCTION, FUNCTION_BLOCK, INTERFACE or PROGRAM."""
        return self.decl.keyword


@dataclass(slots=True, eq=False)
class ProgramInfo:
    """An instance of a PROGRAM. Its variables have places of their own: a call assigns them and hands nothing over."""

    name: str
    pou: Pou
    parameters: list[tuple[VarSymbol, Direction]]


@dataclass(slots=True, eq=False)
class Namespace:
    """A list of globals, or a program instance: `GVL.x`, `Main.x`."""

    name: str
    what: str
    members: dict[str, GlobalSymbol | VarSymbol]
    cls: ClassInfo | None = None  # of a program: its actions and methods
    program: ProgramInfo | None = None


@dataclass(slots=True, eq=False)
class MemberSymbol:
    """A method, action or property by its bare name, inside the unit that has it."""

    name: str


Unit = TypeSymbol | PouSymbol
Symbol = VarSymbol | GlobalSymbol | Unit | Namespace | MemberSymbol


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
    cls: ClassInfo | None = None

    def make_way(self, name: str, defaults: dict[str, Initial]) -> None:
        """Puts the name of the base in front of that of a variable that the base has for itself, such as a PRIVATE one:
        the block declares another one."""
        base = self.type.base
        inherited = None if base is None else self.type.member(name)
        if inherited is None or base is None:
            return
        old, inherited.name = inherited.name, f"{base.name}.{inherited.name}"
        if old in defaults:
            defaults[inherited.name] = defaults.pop(old)
        if old.casefold() in self.members:
            self.members[inherited.name.casefold()] = self.members.pop(old.casefold())


@dataclass(slots=True, eq=False)
class Member:
    """A method, action, or the GET or SET of a property. `info` once its signature was needed."""

    decl: ast.PouDecl
    owner: ClassInfo
    info: FunctionInfo | None = None

    @property
    def name(self) -> str:
        """As written: `Type.member`."""
        return f"{self.owner.name}.{self.decl.name}"

    @property
    def is_property(self) -> bool:
        """Whether it reads or writes a property."""
        return self.decl.is_property

    @property
    def abstract(self) -> bool:
        """Whether it has no body."""
        return ast.Modifier.ABSTRACT in self.decl.modifiers or self.owner.is_interface


@dataclass(slots=True, eq=False)
class ClassInfo:
    """What a FUNCTION_BLOCK, INTERFACE or PROGRAM has besides variables. `members` are its own; `names` what they see
    of the unit around them. `number` identifies the class in its instances; 0 if that is not needed."""

    symbol: PouSymbol
    name: str
    type: StructType | None = None  # None: a program, whose variables are global
    block: BlockInfo | None = None
    base: ClassInfo | None = None
    interfaces: list[ClassInfo] = field(default_factory=list)
    members: dict[str, Member] = field(default_factory=dict)
    names: dict[str, Symbol] = field(default_factory=dict)
    instance_variables: dict[str, dict[str, VarSymbol]] = field(default_factory=dict)  # VAR_INST, by member
    number: int = 0
    of_unknown: bool = False  # extends something that is not declared anywhere

    @property
    def inherits_unknown(self) -> bool:
        """True if it may have members that are not known, because a block or interface that it extends is not."""
        bases = self.all_interfaces() if self.is_interface else []
        return (
            self.of_unknown
            or any(b.of_unknown for b in bases)
            or (self.base is not None and self.base.inherits_unknown)
        )

    @property
    def is_interface(self) -> bool:
        """Whether there are no instances of it, only of what implements it."""
        return self.symbol.keyword is ast.Unit.INTERFACE

    @property
    def abstract(self) -> bool:
        """Whether only derived blocks have instances."""
        return ast.Modifier.ABSTRACT in self.symbol.decl.modifiers or self.is_interface

    def all_interfaces(self) -> list[ClassInfo]:
        """Those named, those that they extend, those of the base."""
        found: dict[ClassInfo, None] = {}
        for interface in self.interfaces:
            found[interface] = None
            found.update(dict.fromkeys(interface.all_interfaces()))
        if self.base is not None:
            found.update(dict.fromkeys(self.base.all_interfaces()))
        return list(found)

    def find(self, key: str) -> Member | None:
        """A member, own or inherited: `name`, or `name.get` and `name.set` of a property. A property hides a PRIVATE
        method of a base, and the other way round."""
        name, _, accessor = key.partition(".")
        others = (name,) if accessor else (f"{name}.get", f"{name}.set")
        cls: ClassInfo | None = self
        while cls is not None:
            if key in cls.members:
                return cls.members[key]
            if any(other in cls.members for other in others):
                return None
            cls = cls.base
        return next((i.members[key] for i in self.all_interfaces() if key in i.members), None)

    def derives(self, other: ClassInfo) -> bool:
        """Whether it is `other` or derived from it."""
        return self is other or (self.base is not None and self.base.derives(other))

    def member_names(self) -> list[str]:
        """Names of all members, for suggestions."""
        bases = [self.base] if self.base is not None else []
        inherited = [name for c in (*bases, *self.interfaces) for name in c.member_names()]
        return [m.decl.name for m in self.members.values()] + inherited
