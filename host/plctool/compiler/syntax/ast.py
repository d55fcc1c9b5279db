"""The syntax tree: what was written, before names and types mean anything. `pos` is a character offset in the source.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from enum import StrEnum
from typing import TypeVar

from plctool.compiler.base.source import Source
from plctool.iec.literals import LiteralKind as LiteralKind
from plctool.records import dataclass

N = TypeVar("N")

# ---- expressions ---------------------------------------------------------------------------------------------------


@dataclass(slots=True, eq=False)
class Literal:
    """A constant. `type_name` is the prefix of a typed literal (`INT#5`), for durations and dates the type."""

    pos: int
    kind: LiteralKind
    value: int | float | str
    type_name: str | None = None


@dataclass(slots=True, eq=False)
class Name:
    """`x`, or `.x` for the global variable that a local one of that name hides."""

    pos: int
    name: str


@dataclass(slots=True, eq=False)
class Temp:
    """`@x`: an intermediate result of a list of instructions or a diagram. No declaration names its type: it is that of
    the expression assigned to it. One that is `@@x` is assigned at several places."""

    pos: int
    name: str

    @property
    def is_joined(self) -> bool:
        """True if several assignments may give the value."""
        return self.name.startswith("@@")


@dataclass(slots=True, eq=False)
class EnumValue:
    """`Color#Red`"""

    pos: int
    type_name: str
    name: str


@dataclass(slots=True, eq=False)
class DirectAddress:
    """`%IX0.3`, `%QW2`, or `%I*` for an address still open."""

    pos: int
    text: str


@dataclass(slots=True, eq=False)
class Member:
    """`base.name`; `name_pos` is where the name stands."""

    pos: int
    base: Expr
    name: str
    name_pos: int


@dataclass(slots=True, eq=False)
class BitAccess:
    """`base.3`, `base.%X3`; `width` is X, B, W, D or L; `index_pos` is where the number stands."""

    pos: int
    base: Expr
    width: str
    index: int
    index_pos: int


@dataclass(slots=True, eq=False)
class Index:
    pos: int
    base: Expr
    indices: list[Expr]


@dataclass(slots=True, eq=False)
class Deref:
    """`base^`"""

    pos: int
    base: Expr


@dataclass(slots=True, eq=False)
class Argument:
    """`value`, `name := value` or `name => target` (`output`; `NOT name => target` when `negated`)."""

    pos: int
    name: str | None
    value: Expr | None
    output: bool = False
    negated: bool = False


@dataclass(slots=True, eq=False)
class Call:
    """`had_enable`: EN or ENO were among the arguments and are handled already."""

    pos: int
    callee: Expr
    args: list[Argument]
    had_enable: bool = False

    @property
    def formal(self) -> bool:
        """Whether arguments are given by name, so that others may be left out."""
        return self.had_enable or any(argument.name is not None for argument in self.args)


class Operator(StrEnum):
    """A sign or word between or before operands. `&` is AND."""

    ADD = "+"
    SUB = "-"
    MUL = "*"
    DIV = "/"
    MOD = "MOD"
    POWER = "**"
    EQ = "="
    NE = "<>"
    LT = "<"
    LE = "<="
    GT = ">"
    GE = ">="
    AND = "AND"
    AND_THEN = "AND_THEN"
    OR = "OR"
    OR_ELSE = "OR_ELSE"
    XOR = "XOR"
    NOT = "NOT"


COMPARISONS = frozenset((Operator.EQ, Operator.NE, Operator.LT, Operator.LE, Operator.GT, Operator.GE))


@dataclass(slots=True, eq=False)
class Unary:
    """`op` is NOT, - or +."""

    pos: int
    op: Operator
    operand: Expr


@dataclass(slots=True, eq=False)
class Binary:
    """`pos` is that of the operator."""

    pos: int
    op: Operator
    left: Expr
    right: Expr


@dataclass(slots=True, eq=False)
class Assigned:
    """`(target := value)`: the target after the assignment. `bare`: it is a whole condition, without parentheses."""

    pos: int
    target: Expr
    value: Expr
    bare: bool = False


@dataclass(slots=True, eq=False)
class TypeArgument:
    """A type that is no name, as the argument of a call: `__NEW(POINTER TO INT)`."""

    pos: int
    spec: TypeSpec


Value = Literal | Name | Temp | EnumValue | DirectAddress | Member | BitAccess | Index | Deref | Call
Expr = Value | Unary | Binary | Assigned | TypeArgument

# ---- initial values ------------------------------------------------------------------------------------------------


@dataclass(slots=True, eq=False)
class Repeat:
    """`count(value)` in an array initialiser; without values the elements keep their default."""

    pos: int
    count: Expr
    values: list[Init]


@dataclass(slots=True, eq=False)
class ArrayInit:
    """`[a, b, 3(c)]`"""

    pos: int
    items: list[Init | Repeat]


@dataclass(slots=True, eq=False)
class StructInit:
    """`(member := value, ...)`. `arguments`: it follows the name of a type, `Pump(limit := 5)`, where the inputs
    of FB_Init come before members of the same name; a value without a name ("") is always one of them."""

    pos: int
    members: list[tuple[int, str, Init]]
    arguments: bool = False


Init = Expr | ArrayInit | StructInit

# ---- types ---------------------------------------------------------------------------------------------------------


@dataclass(slots=True, eq=False)
class NamedType:
    """A type by its name; `length` for STRING[length], `inits` for the elements of `ARRAY[1..2] OF Block[(id := 1), (id
    := 2)]`. `constants`: of `Fifo<10>`, whose `template` is Fifo."""

    pos: int
    name: str
    length: Expr | None = None
    inits: ArrayInit | None = None
    constants: list[Expr] = field(default_factory=list)
    template: str = ""


@dataclass(slots=True, eq=False)
class SubrangeSpec:
    """`INT (low .. high)`"""

    pos: int
    base: str
    low: Expr
    high: Expr


@dataclass(slots=True, eq=False)
class EnumSpec:
    """`(a, b := 3)` or `INT (a, b := 3)`. With a base and in a variable declaration it may mean `TON(PT := T#1s)`."""

    pos: int
    base: str | None
    values: list[tuple[int, str, Init | None]]


@dataclass(slots=True, eq=False)
class ArraySpec:
    pos: int
    bounds: list[tuple[Expr, Expr] | None]  # None for *
    element: TypeSpec


class Pointing(StrEnum):
    """A type that holds an address, by its keyword."""

    POINTER = "POINTER"
    REFERENCE = "REFERENCE"
    REF_TO = "REF_TO"


@dataclass(slots=True, eq=False)
class PointerSpec:
    pos: int
    keyword: Pointing
    target: TypeSpec


@dataclass(slots=True, eq=False)
class StructSpec:
    pos: int
    fields: list[VarDecl]
    union: bool = False
    base: NamedType | None = None  # what it EXTENDS
    pack_mode: str | None = None  # the value of the attribute


@dataclass(slots=True, eq=False)
class TypeOf:
    """`@type(value)`: the type of a value. Readers of diagrams write it; no program has it."""

    pos: int
    value: Expr


TypeSpec = TypeOf | NamedType | SubrangeSpec | EnumSpec | ArraySpec | PointerSpec | StructSpec

# ---- declarations --------------------------------------------------------------------------------------------------


class Modifier(StrEnum):
    """A word in front of the name of a unit or type, or after the keyword of a section (a qualifier)."""

    PUBLIC = "PUBLIC"
    PRIVATE = "PRIVATE"
    PROTECTED = "PROTECTED"
    INTERNAL = "INTERNAL"
    FINAL = "FINAL"
    ABSTRACT = "ABSTRACT"
    OVERRIDE = "OVERRIDE"
    CLASS = "CLASS"  # of a FUNCTION_BLOCK that is one
    CONSTANT = "CONSTANT"
    RETAIN = "RETAIN"
    NON_RETAIN = "NON_RETAIN"
    PERSISTENT = "PERSISTENT"


ACCESS = frozenset((Modifier.PUBLIC, Modifier.PRIVATE, Modifier.PROTECTED, Modifier.INTERNAL))


class Section(StrEnum):
    """A section of declarations, by its keyword."""

    VAR = "VAR"
    VAR_INPUT = "VAR_INPUT"
    VAR_OUTPUT = "VAR_OUTPUT"
    VAR_IN_OUT = "VAR_IN_OUT"
    VAR_TEMP = "VAR_TEMP"
    VAR_STAT = "VAR_STAT"
    VAR_INST = "VAR_INST"
    VAR_GENERIC = "VAR_GENERIC"
    VAR_EXTERNAL = "VAR_EXTERNAL"
    VAR_GLOBAL = "VAR_GLOBAL"
    STEP = "STEP"  # the steps of a chart, which the compiler declares


class Unit(StrEnum):
    """A program organisation unit, or what one holds, by its keyword. GET and SET are those of a PROPERTY."""

    PROGRAM = "PROGRAM"
    FUNCTION = "FUNCTION"
    FUNCTION_BLOCK = "FUNCTION_BLOCK"
    INTERFACE = "INTERFACE"
    METHOD = "METHOD"
    ACTION = "ACTION"
    GET = "GET"
    SET = "SET"


class TestUnit(StrEnum):
    """A unit of tests, by its keyword."""

    TEST = "TEST"
    SETUP = "SETUP"
    TEARDOWN = "TEARDOWN"


class Edge(StrEnum):
    """What an input says of the last call: that it was FALSE, or that it was TRUE."""

    RISING = "R_EDGE"
    FALLING = "F_EDGE"


@dataclass(slots=True, eq=False)
class VarDecl:
    """One declaration line: `names AT location : type edge := init`."""

    pos: int
    names: list[tuple[int, str]]
    location: DirectAddress | None
    type: TypeSpec
    init: Init | None
    attributes: dict[str, str] = field(default_factory=dict)
    edge: Edge | None = None


@dataclass(slots=True, eq=False)
class VarBlock:
    """`VAR_INPUT RETAIN ... END_VAR`"""

    pos: int
    keyword: Section
    qualifiers: set[Modifier]
    decls: list[VarDecl]


@dataclass(slots=True, eq=False)
class TypeDecl:
    """A type with what stands before it or of its TYPE."""

    pos: int
    name: str
    spec: TypeSpec
    init: Init | None
    source: Source
    namespace: Namespace | None = None
    attributes: dict[str, str] = field(default_factory=dict)
    modifiers: set[Modifier] = field(default_factory=set)  # PUBLIC, INTERNAL

    @property
    def qualified(self) -> bool:
        """Whether the values of the enumeration need its name in front."""
        return "qualified_only" in self.attributes


@dataclass(slots=True, eq=False)
class Namespace:
    """Where a declaration stands: the dotted name of its NAMESPACE, "" for none, and what it is USING. `internal`: of
    an INTERNAL one, the namespace around it, which may use it; "" if there is none. `imported`: it is that of a
    library, which does not see the program."""

    name: str = ""
    using: list[tuple[int, str]] = field(default_factory=list)
    internal: str | None = None
    imported: bool = False


@dataclass(slots=True, eq=False)
class PouDecl:
    """A unit, or what it holds (`members`). A CLASS is a FUNCTION_BLOCK with that among its `modifiers`. `attributes`
    by lower-case name."""

    pos: int
    keyword: Unit
    name: str
    result: TypeSpec | None
    blocks: list[VarBlock]
    body: list[Stmt]
    attributes: dict[str, str]
    source: Source
    modifiers: set[Modifier] = field(default_factory=set)  # PUBLIC, FINAL ...
    bases: list[tuple[int, str]] = field(default_factory=list)  # EXTENDS
    interfaces: list[tuple[int, str]] = field(default_factory=list)  # IMPLEMENTS
    members: list[PouDecl] = field(default_factory=list)
    namespace: Namespace | None = None
    chart: Chart | None = None  # in place of the body
    accesses: list[AccessLine] = field(default_factory=list)  # VAR_ACCESS of a PROGRAM

    @property
    def full_name(self) -> str:
        """With the namespace in front."""
        return f"{self.namespace.name}.{self.name}" if self.namespace and self.namespace.name else self.name

    @property
    def is_property(self) -> bool:
        """Whether it reads or writes a property of the unit it is in."""
        return self.keyword in (Unit.GET, Unit.SET)

    @property
    def member_key(self) -> str:
        """Under which it is found among the members of a unit; a property has two."""
        name = self.name.casefold()
        return f"{name}.{self.keyword.lower()}" if self.is_property else name


@dataclass(slots=True, eq=False)
class StepAction:
    """`name(qualifier, time, indicators)` in a step: an ACTION or a BOOL variable, which `target` names. `qualifier` in
    capitals."""

    pos: int
    name: str
    target: Expr
    qualifier: str
    time: Expr | None
    indicators: list[Expr]


@dataclass(slots=True, eq=False)
class Step:
    pos: int
    name: str
    initial: bool
    actions: list[StepAction]


@dataclass(slots=True, eq=False)
class Transition:
    """`TRANSITION (PRIORITY := priority) FROM sources TO targets := condition`"""

    pos: int
    priority: int | None
    sources: list[tuple[int, str]]
    targets: list[tuple[int, str]]
    condition: Expr


@dataclass(slots=True, eq=False)
class Chart:
    """A body that is a Sequential Function Chart; its ACTIONs are members of the unit. `valid`: it has no errors.
    `asked`: the actions, case-folded, whose A is read."""

    steps: list[Step]
    transitions: list[Transition]
    valid: bool = True
    asked: set[str] = field(default_factory=set)


@dataclass(slots=True, eq=False)
class GlobalBlock:
    """`qualified`: the names need that of the list in front, {attribute 'qualified_only'}."""

    block: VarBlock
    source: Source
    namespace: Namespace | None = None
    qualified: bool = False


@dataclass(slots=True, eq=False)
class TaskDecl:
    """`TASK name(INTERVAL := ..., ...)`"""

    pos: int
    name: str
    properties: list[tuple[int, str, Init]]


@dataclass(slots=True, eq=False)
class ProgramInstance:
    """`PROGRAM name WITH task : type(args)`"""

    pos: int
    name: str
    task: tuple[int, str] | None
    type_pos: int
    type_name: str
    args: list[Argument]
    qualifiers: set[Modifier]


@dataclass(slots=True, eq=False)
class ConfigLine:
    """`resource.program.fb.variable AT location : type := init` of VAR_CONFIG."""

    pos: int
    path: Expr
    location: DirectAddress | None
    type: TypeSpec
    init: Init | None


@dataclass(slots=True, eq=False)
class AccessLine:
    """`name : resource.program.fb.variable : type READ_WRITE` of VAR_ACCESS; without it the variable is only read."""

    pos: int
    name: str
    path: Expr
    type: TypeSpec
    writable: bool


@dataclass(slots=True, eq=False)
class InstanceBlock:
    """VAR_CONFIG or VAR_ACCESS: it names variables from outside, by their path."""

    lines: list[ConfigLine] | list[AccessLine]
    source: Source


@dataclass(slots=True, eq=False)
class ConfigurationDecl:
    """A CONFIGURATION with what its resources hold, in order."""

    pos: int
    name: str
    globals: list[VarBlock]
    tasks: list[TaskDecl]
    programs: list[ProgramInstance]
    source: Source
    resources: list[str] = field(default_factory=list)
    instance_blocks: list[InstanceBlock] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class TestDecl:
    """A TEST, or what its file has to do before and after each TEST. The calls in the body may be those of
    unit_tests.py: ASSERT_EQ, MOCK ... `faults`: what {attribute 'fault' := 'text'} says, with the place of each."""

    pos: int
    keyword: TestUnit
    name: str
    blocks: list[VarBlock]
    body: list[Stmt]
    source: Source
    namespace: Namespace | None = None  # what its file is USING
    faults: list[tuple[int, str]] = field(default_factory=list)


Declaration = TypeDecl | PouDecl | GlobalBlock | InstanceBlock | ConfigurationDecl | TestDecl

# ---- statements ----------------------------------------------------------------------------------------------------


class Assigning(StrEnum):
    """The sign of an assignment."""

    VALUE = ":="
    SET = "S="
    RESET = "R="
    REFERENCE = "REF="
    INTERFACE = "?="  # when the instance has it


@dataclass(slots=True, eq=False)
class Assign:
    """`targets[0] := targets[1] := ... := value`. `pos` is that of the operator. `others`: the further targets of
    `a S= b R= value`, each with its operator."""

    pos: int
    targets: list[Expr]
    op: Assigning
    value: Expr
    others: list[tuple[Assigning, Expr]] = field(default_factory=list)


@dataclass(slots=True, eq=False)
class ExprStmt:
    """A call, or an expression that should have been one."""

    pos: int
    value: Expr


@dataclass(slots=True, eq=False)
class If:
    pos: int
    branches: list[tuple[Expr, list[Stmt]]]
    otherwise: list[Stmt]
    has_else: bool = False


@dataclass(slots=True, eq=False)
class CaseLabel:
    """`low` or `low .. high`"""

    pos: int
    low: Expr
    high: Expr | None


@dataclass(slots=True, eq=False)
class Case:
    pos: int
    selector: Expr
    branches: list[tuple[list[CaseLabel], list[Stmt]]]
    otherwise: list[Stmt]
    has_else: bool = False  # also an empty one


@dataclass(slots=True, eq=False)
class For:
    pos: int
    var: Expr
    start: Expr
    stop: Expr
    step: Expr | None
    body: list[Stmt]


@dataclass(slots=True, eq=False)
class While:
    pos: int
    condition: Expr
    body: list[Stmt]


@dataclass(slots=True, eq=False)
class RepeatUntil:
    pos: int
    body: list[Stmt]
    until: Expr


@dataclass(slots=True, eq=False)
class Exit:
    pos: int


@dataclass(slots=True, eq=False)
class Continue:
    pos: int


@dataclass(slots=True, eq=False)
class Return:
    """`RETURN`, or `RETURN(condition)` as CODESYS has it."""

    pos: int
    condition: Expr | None = None


@dataclass(slots=True, eq=False)
class Label:
    """`name:`, where a JMP goes on."""

    pos: int
    name: str


@dataclass(slots=True, eq=False)
class Jump:
    """`JMP name;`"""

    pos: int
    name: str
    name_pos: int


@dataclass(slots=True, eq=False)
class Catch:
    """`__CATCH(var)` with its statements; `var` may be missing."""

    var: Expr | None
    body: list[Stmt]


@dataclass(slots=True, eq=False)
class Try:
    """`__TRY body __CATCH(var) ... __FINALLY last __ENDTRY`"""

    pos: int
    body: list[Stmt]
    catch: Catch | None
    last: list[Stmt] | None


Stmt = Assign | ExprStmt | If | Case | For | While | RepeatUntil | Exit | Continue | Return | Label | Jump | Try


def inner_bodies(statement: Stmt) -> list[list[Stmt]]:
    """The statements in a statement, as the lists they stand in."""
    if isinstance(statement, If | Case):
        return [*(body for _, body in statement.branches), statement.otherwise]
    if isinstance(statement, Try):
        caught = [] if statement.catch is None else [statement.catch.body]
        return [statement.body, *caught, statement.last or []]
    return [statement.body] if isinstance(statement, For | While | RepeatUntil) else []


# ---- looking through a tree ----------------------------------------------------------------------------------------


def every(kind: type[N], root: object) -> Iterator[N]:
    """Every node of a kind in `root` (a node, or lists and tuples of them), in no particular order."""
    stack = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, list | tuple):
            stack.extend(node)
        elif hasattr(node, "__slots__"):
            if isinstance(node, kind):
                yield node
            stack.extend(getattr(node, name) for name in node.__slots__)
