"""The typed program: what the checker makes of the syntax tree and all that the lowering needs.

Everything is resolved here: names point to `Variable`s, implicit conversions are `Convert` nodes, call arguments are in
order of declaration with defaults filled in, generic functions are instantiated, constants are folded. The lowering
decides nothing about the language; it only chooses instructions. Every node says where it came from, for run-time
errors and the debugger.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from enum import Enum
from typing import TYPE_CHECKING, ClassVar

from plctool.files import Pos as Pos
from plctool.iec.areas import Area
from plctool.iec.types import BYTE, ArrayType, Field, Keep, StructType, Type
from plctool.image.c_functions import C_FUNCTIONS, VERSION
from plctool.records import dataclass

if TYPE_CHECKING:
    from plctool.io.model import Description


class Storage(Enum):
    """Where a variable lives."""

    AREA = "area"  # globals and program variables: area base + offset
    SELF = "self"  # a member of the function block instance: instance pointer + offset
    LOCAL = "local"  # on the stack: function variables, VAR_TEMP; zeroed or initialised at every call
    REFERENCE = "reference"  # VAR_IN_OUT and the like: `offset` holds no value, a pointer is passed or stored instead


@dataclass(eq=False)
class Variable:
    """A declared variable. `initial` is None for all zero.

    `offset`: bytes in the area (AREA) or in the instance (SELF); for REFERENCE in a function block the offset of the
    stored 8-byte pointer in the instance (SELF slot), in a function the parameter itself. `bounds`: the variables with
    the bounds of an ARRAY[*], lower and upper one of each dimension.
    """

    name: str
    type: Type
    storage: Storage
    pos: Pos
    area: Area = Area.DATA
    offset: int = -1
    initial: Initial | None = None
    constant: bool = False
    keep: Keep = Keep.UNSAID
    bit: int | None = None  # a BOOL at an address such as %IX0.3: the bit in the byte at `offset`
    bounds: list[tuple[Variable, Variable]] = field(default_factory=list)
    shared_output: bool = False  # several tasks are meant to write it
    from_c: bool = False  # components in C use it by its name


# ---- initial values ------------------------------------------------------------------------------------------------


@dataclass
class ScalarInit:
    """A number (BOOL: 0 or 1; TIME: ms), a float, or a string for STRING."""

    value: int | float | str


@dataclass
class ArrayInit:
    """Runs of (count, value) in element order. `rest`: what elements without a value take, at the end and where the
    value is None; it is the default of the element's declared type."""

    runs: list[tuple[int, Initial | None]]
    rest: Initial | None = None


@dataclass
class StructInit:
    """Only the members given, spelt as in the type; the rest take its defaults (`TypedProgram.defaults`). `arguments`:
    what the FB_Init of an instance gets besides; `properties`: what its properties are set to after it, by name."""

    members: dict[str, Initial]
    arguments: dict[str, Expr] = field(default_factory=dict)
    properties: dict[str, Expr] = field(default_factory=dict)


@dataclass
class ComputedInit:
    """What is not known before the program runs, such as an address: assigned by `TypedProgram.startup`. Members of an
    instance are SELF variables in it."""

    value: Expr


Initial = ScalarInit | ArrayInit | StructInit | ComputedInit


def overlay(t: Type, given: Initial, default: Initial | None) -> Initial:
    """An initial value that is complete: members that `given` does not name, at any depth, are as in `default`, and
    elements as in its rest. The members of a union share their memory, so there the given ones are all."""
    if isinstance(t, StructType) and isinstance(given, StructInit) and isinstance(default, StructInit):
        named = {
            f.name: overlay(f.type, given.members[f.name], default.members.get(f.name))
            for f in t.fields
            if f.name in given.members
        }
        others = {} if t.union and named else default.members
        arguments = {**default.arguments, **given.arguments}
        return StructInit({**others, **named}, arguments, {**default.properties, **given.properties})
    if isinstance(t, ArrayType) and isinstance(given, ArrayInit) and isinstance(default, ArrayInit):
        rest = default.rest if given.rest is None else given.rest
        runs = [(count, None if value is None else overlay(t.element, value, rest)) for count, value in given.runs]
        return ArrayInit(runs, rest)
    return given


def array_runs(t: ArrayType, initial: Initial | None) -> Iterator[tuple[int, Initial | None]]:
    """Runs of equal elements that cover the whole array."""
    left = t.count
    given = initial if isinstance(initial, ArrayInit) else ArrayInit([])
    for count, value in given.runs:
        yield min(count, left), given.rest if value is None else value
        left -= min(count, left)
    if left:
        yield left, given.rest


def struct_members(
    t: StructType, initial: Initial | None, default: Initial | None
) -> Iterator[tuple[Field, Initial | None]]:
    """Every member with the value it gets: the one given, else the one in the `default` of the struct type, else None.
    Of a union those with a value."""
    complete = overlay(t, initial if isinstance(initial, StructInit) else StructInit({}), default)
    assert isinstance(complete, StructInit)
    for f in t.fields:
        if not t.union or f.name in complete.members:
            yield f, complete.members.get(f.name)


# ---- nodes of a body ------------------------------------------------------------------------------------------------


class Node:
    """A place, an expression or a statement. `children`: the fields that hold nodes, or lists and tuples with nodes."""

    children: ClassVar[tuple[str, ...]] = ()


# ---- places: what can stand left of := ----------------------------------------------------------------------------


@dataclass
class VarPlace(Node):
    var: Variable
    type: Type
    pos: Pos


@dataclass
class MemberPlace(Node):
    children: ClassVar = ("base",)
    base: Place
    offset: int
    type: Type
    pos: Pos


@dataclass
class IndexPlace(Node):
    """`base` is an array; one index per dimension, each any integer type. Or a STRING with one 0-based index (type
    BYTE, of a WSTRING WORD). `limits`: of an ARRAY[*], the bounds of each dimension (DINT)."""

    children: ClassVar = ("base", "indices", "limits")
    base: Place
    indices: list[Expr]
    type: Type
    pos: Pos
    limits: list[tuple[Expr, Expr]] | None = None


@dataclass
class DerefPlace(Node):
    """`pointer^`; NULL raises ACCESS_VIOLATION when checks are on."""

    children: ClassVar = ("pointer",)
    pointer: Expr
    type: Type
    pos: Pos


@dataclass
class BitPlace(Node):
    """`base.bit` of a bit string or integer; type BOOL."""

    children: ClassVar = ("base",)
    base: Place
    bit: int
    type: Type
    pos: Pos


@dataclass
class ValuePlace(Node):
    """A value that has to be passed by reference (a literal or a result): materialised in a temporary on the stack."""

    children: ClassVar = ("value",)
    value: Expr
    type: Type
    pos: Pos


@dataclass
class SelfPlace(Node):
    """The instance a method or function block body runs on: THIS^. `exact`: SUPER^, which calls what its own type
    declares."""

    type: Type
    pos: Pos
    exact: bool = False


def member_place(base: Place, f: Field, pos: Pos) -> Place:
    """A member of a struct or an instance; a BIT is a bit of its byte."""
    if f.bit is None:
        return MemberPlace(base, f.offset, f.type, pos)
    return BitPlace(MemberPlace(base, f.offset, BYTE, pos), f.bit, f.type, pos)


Place = VarPlace | MemberPlace | IndexPlace | DerefPlace | BitPlace | ValuePlace | SelfPlace


# ---- expressions ---------------------------------------------------------------------------------------------------


@dataclass
class Const(Node):
    """int for integers, bits, TIME, enums; bool as 0/1; float for reals; str for STRING (latin-1 characters). `whole`:
    what was computed in 32 bits and does not fit `type` (see `Convert.cuts`)."""

    value: int | float | str
    type: Type
    pos: Pos
    whole: Const | None = None


@dataclass
class Load(Node):
    children: ClassVar = ("place",)
    place: Place
    type: Type
    pos: Pos


class UnaryOp(Enum):
    NEG = "-"
    NOT = "NOT"


@dataclass
class Unary(Node):
    children: ClassVar = ("operand",)
    op: UnaryOp
    operand: Expr
    type: Type
    pos: Pos


class BinaryOp(Enum):
    ADD = "+"
    SUB = "-"
    MUL = "*"
    DIV = "/"
    MOD = "MOD"
    AND = "AND"
    OR = "OR"
    XOR = "XOR"
    AND_THEN = "AND_THEN"  # short circuit, BOOL
    OR_ELSE = "OR_ELSE"
    EQ = "="
    NE = "<>"
    LT = "<"
    LE = "<="
    GT = ">"
    GE = ">="


@dataclass
class Binary(Node):
    """Both operands have the same base type; for comparisons `type` is BOOL. Strings may only be compared.

    Integers wrap. DIV and MOD by zero raise DIVIDEBYZERO for integers; MIN / -1 wraps, MIN MOD -1 is 0. MOD takes the
    sign of the dividend.
    """

    children: ClassVar = ("left", "right")
    op: BinaryOp
    left: Expr
    right: Expr
    type: Type
    pos: Pos


class Rounding(Enum):
    """How a real becomes an integer."""

    EVEN = "halves to even; stays within the type, NaN is 0"
    ZERO = "towards zero; stays within the type, NaN is 0"
    AWAY = "to LINT only: halves away from zero; what does not fit, and NaN, is the lowest LINT"


@dataclass
class Convert(Node):
    """A value conversion between scalars.

    integer/bit/time/enum -> integer/bit/time/enum: sign- or zero-extend by the source, truncate to the target; anything
    -> BOOL: <> 0; real -> integer: as `rounding` says; integer -> real: nearest. `check` carries the subrange limits to
    test first. `cuts`: the operand was computed in 32 bits or more, and the rules that need its whole value take it
    from there (`whole_value`).
    """

    children: ClassVar = ("operand",)
    operand: Expr
    type: Type
    pos: Pos
    rounding: Rounding = Rounding.EVEN
    check: tuple[int, int] | None = None
    cuts: bool = False


class Intrinsic(Enum):
    """Operations the lowering knows how to emit; everything else is written in ST (stdlib)."""

    ABS = "ABS"
    SQRT = "SQRT"
    SHL = "SHL"  # (value, count): counts of the width or more give 0; negative counts give 0
    SHR = "SHR"
    ROL = "ROL"  # count modulo the width
    ROR = "ROR"
    MUX = "MUX"  # (k, in0, in1, ...): the chosen one alone is evaluated; any k that is no index chooses the last
    SELECT = "SEL"  # (g, in0, in1): the chosen one alone is evaluated
    MIN = "MIN"  # two operands of one scalar type
    MAX = "MAX"
    TIME = "TIME"  # () -> TIME of this cycle [ms]
    LTIME = "LTIME"  # () -> LTIME of this cycle [ns]
    BITCAST = "BITCAST"  # same size, bits kept (REAL <-> DWORD, LREAL <-> LWORD)
    EXCHANGE = "EXCHANGE"  # (address of a DINT, old, new) -> BOOL: it was old and is new, in one step
    TASK = "TASK"  # () -> UDINT: number of the task that runs, from 1; 0 in code outside of tasks
    STRING_SIZE = "STRING_SIZE"  # (string place load) -> capacity in characters of the actual argument


@dataclass
class IntrinsicCall(Node):
    children: ClassVar = ("args",)
    intrinsic: Intrinsic
    args: list[Expr]
    type: Type
    pos: Pos


@dataclass
class AddressOf(Node):
    """ADR(x) / REF(x)."""

    children: ClassVar = ("place",)
    place: Place
    type: Type
    pos: Pos


@dataclass(eq=False)
class Dispatch:
    """What a call runs, by the class number that the instance carries in its first four bytes; `targets` is complete
    when the check is done, and holds only classes that have instances. `function` has the signature."""

    function: Pou
    targets: dict[int, Pou] = field(default_factory=dict)


@dataclass
class Call(Node):
    """A call of a FUNCTION (or an EXTERNAL one), or of a method of `instance`. `args` in order of
    `function.parameters`: an expression for VAR_INPUT,
    a place for VAR_IN_OUT, a place or None for VAR_OUTPUT. The result is `type`; strings and structs come back in a
    temporary.
    """

    children: ClassVar = ("args", "instance")
    function: Pou
    args: list[Expr | Place | None]
    type: Type
    pos: Pos
    instance: Place | None = None
    dispatch: Dispatch | None = None  # when the type of the instance is not known; `function` is its signature then


@dataclass
class AssignedValue(Node):
    """`(a := e)`: an assignment, and what was assigned."""

    children: ClassVar = ("assignment",)
    assignment: Assign
    type: Type
    pos: Pos


Expr = Const | Load | Unary | Binary | Convert | IntrinsicCall | AddressOf | Call | AssignedValue


# ---- statements ----------------------------------------------------------------------------------------------------


@dataclass
class Assign(Node):
    """Same type on both sides, except strings, which are cut to the target's length. Arrays and structs are copied."""

    children: ClassVar = ("target", "value")
    target: Place
    value: Expr
    pos: Pos


@dataclass
class CallStatement(Node):
    children: ClassVar = ("call",)
    call: Call
    pos: Pos


@dataclass
class FbCall(Node):
    """`instance(in := e, out => p)`: inputs are assigned, VAR_IN_OUT pointers stored, the body called, outputs
    copied."""

    children: ClassVar = ("instance", "inputs", "in_outs", "outputs")
    block: Pou
    instance: Place
    inputs: list[tuple[Variable, Expr]]
    in_outs: list[tuple[Variable, Place]]
    outputs: list[tuple[Variable, Place]]
    pos: Pos
    dispatch: Dispatch | None = None  # when the type of the instance is not known


@dataclass
class If(Node):
    children: ClassVar = ("branches", "otherwise")
    branches: list[tuple[Expr, list[Statement]]]
    otherwise: list[Statement]
    pos: Pos


@dataclass
class Case(Node):
    """Labels are inclusive ranges (low, high) in the selector's type; they do not overlap."""

    children: ClassVar = ("selector", "branches", "otherwise")
    selector: Expr
    branches: list[tuple[list[tuple[int, int]], list[Statement]]]
    otherwise: list[Statement]
    pos: Pos


@dataclass
class For(Node):
    """`stop` and `step` are evaluated once, before `var` is set. If `each_turn`, `stop` is evaluated after that and
    after each step, `step` at first and after each turn. The loop ends without wrapping,
    also at the limits of the type; `FOR i := 5 TO 5` runs once. A step of 0 raises DIVIDEBYZERO when it is not a
    constant (a constant 0 is a compile error). `step` is signed when it leads downwards, whatever the type of
    `var`."""

    children: ClassVar = ("var", "start", "stop", "step", "body")
    var: Place
    start: Expr
    stop: Expr
    step: Expr
    body: list[Statement]
    pos: Pos
    each_turn: bool = False


@dataclass
class While(Node):
    children: ClassVar = ("condition", "body")
    condition: Expr
    body: list[Statement]
    pos: Pos


@dataclass
class Repeat(Node):
    children: ClassVar = ("body", "until")
    body: list[Statement]
    until: Expr
    pos: Pos


@dataclass
class Exit(Node):
    pos: Pos


@dataclass
class Continue(Node):
    pos: Pos


@dataclass
class Return(Node):
    pos: Pos


@dataclass
class Label(Node):
    """Where a Jump goes on. `name` exists once in the body."""

    name: str
    pos: Pos


@dataclass
class Jump(Node):
    """To the Label of that name, which is among the statements around it or around those."""

    name: str
    pos: Pos


@dataclass
class Try(Node):
    """`body`; `exception` gets the number (RTSEXCPT_*) of an exception in it or in what it calls, which goes on in
    `caught`; outward if that is None. `last` runs after these, however they are left; nothing leads out of it but an
    exception."""

    children: ClassVar = ("body", "exception", "caught", "last")
    body: list[Statement]
    exception: Place | None
    caught: list[Statement]
    last: list[Statement]
    pos: Pos


@dataclass
class Initialise(Node):
    """Gives a place the initial value of its type, whatever it held."""

    children: ClassVar = ("place",)
    place: Place
    pos: Pos


@dataclass
class Raise(Node):
    """Raises RTSEXCPT_* `code`, whatever is checked."""

    code: int
    pos: Pos


Statement = (
    Assign
    | CallStatement
    | FbCall
    | If
    | Case
    | For
    | While
    | Repeat
    | Exit
    | Continue
    | Return
    | Label
    | Jump
    | Try
    | Initialise
    | Raise
)


# ---- program organisation units and the whole -----------------------------------------------------------------------


class PouKind(Enum):
    PROGRAM = "PROGRAM"
    FUNCTION = "FUNCTION"
    FUNCTION_BLOCK = "FUNCTION_BLOCK"
    METHOD = "METHOD"  # a function that gets an instance


class Direction(Enum):
    INPUT = "VAR_INPUT"
    OUTPUT = "VAR_OUTPUT"
    IN_OUT = "VAR_IN_OUT"


@dataclass
class Parameter:
    """`by_reference`: a VAR_IN_OUT, an output of a function, or a read-only string/array/struct input.

    A STRING passed by reference travels as (pointer, u32 capacity), so that STRING_SIZE and cutting work for any
    length.

    After the parameters that the program declares come the bounds of those that are an ARRAY[*] (Variable.bounds).
    """

    variable: Variable
    direction: Direction
    by_reference: bool = False


@dataclass(eq=False)
class Pou:
    """A compiled unit. A PROGRAM instance is one Pou each (its variables are AREA variables at fixed offsets); a
    FUNCTION_BLOCK is compiled once and gets the instance pointer."""

    name: str
    kind: PouKind
    pos: Pos
    parameters: list[Parameter] = field(default_factory=list)
    locals: list[Variable] = field(default_factory=list)  # Storage.LOCAL, with the result variable of a function
    result: Variable | None = None
    instance: StructType | None = None  # function blocks: the layout of an instance
    body: list[Statement] = field(default_factory=list)
    external: External | None = None  # implemented in C
    checks: bool = True  # False in the standard library where it is proven
    cuts_result: bool = False  # the body keeps within STRING_SIZE of its string result, whatever that is
    in_place: bool = False  # the result may be the very variable that is the first argument
    no_init: bool = False  # locals need no zeroing: the body writes each before it reads it (standard library)
    connects: Pou | None = None  # the program before or after which this assigns what a CONFIGURATION says


@dataclass(frozen=True)
class External:
    """A C function of the runtime: lower-case name, CRC of its interface text, library version (major<<16 | minor)."""

    name: str
    signature: int
    version: int


def runtime_function(name: str) -> External:
    """One that plctool knows of the runtime."""
    return External(name, C_FUNCTIONS[name].signature, VERSION)


class TaskKind(Enum):
    """As in CmpIecTask (codesys-v3-protocol 5.5)."""

    CYCLIC = 0
    EVENT = 1
    EXTERNAL = 2
    FREEWHEELING = 3
    LEVEL = 4


@dataclass(frozen=True)
class TaskPart:
    """What a task uses of the inputs or outputs: bytes from `start` up to `end`, which is 0 for nothing. `written`: it
    changes some of them; `shared`: another task uses some of them too."""

    start: int = 0
    end: int = 0
    written: bool = False
    shared: bool = False


@dataclass
class TaskEvent:
    """The BOOL a task waits for: in `variable`, `offset` bytes after its start. `bit` of that byte; None for all."""

    variable: Variable
    offset: int = 0
    bit: int | None = None


@dataclass
class Task:
    """`parts`: what it needs a copy of where others use it, of the inputs and of the outputs."""

    name: str
    kind: TaskKind
    priority: int  # 0 highest .. 31
    interval_us: int
    programs: list[Pou]
    event: TaskEvent | None = None  # TASK(SINGLE := place), TASK(LEVEL := place)
    external: str = ""  # TASK(EVENT := 'name')
    watchdog_us: int = 0
    watchdog_sensitivity: int = 1
    parts: dict[Area, TaskPart] = field(default_factory=dict)


@dataclass(frozen=True)
class EventFunction:
    """A FUNCTION that the runtime calls when something happens to the application. `event`: EVT_* (AppEventIds.h);
    `name`: of the function in the program; `pou` calls it, and hands over its answer."""

    event: int
    name: str
    pou: Pou


@dataclass(frozen=True)
class Export:
    """What components in C find by its name. `variable`: of the program; of a function that with its parameters and
    result, None if it has neither. `caller`: calls the function; None for a variable."""

    name: str
    signature: int
    pos: Pos
    variable: Variable | None
    caller: Pou | None = None


@dataclass
class TypedProgram:
    """A checked program. `globals` holds every AREA variable, program variables included (with dotted names Main.x)."""

    pous: list[Pou]
    globals: list[Variable]
    tasks: list[Task]
    area_sizes: dict[Area, int]
    defaults: dict[str, StructInit]  # struct and FB type name -> initial values that are not zero
    programs: dict[str, Pou]  # instance name -> Pou
    aliases: dict[str, str] = field(
        default_factory=dict
    )  # other names of globals -> name in `globals`: `x` for `GVL.x`
    accesses: list[Variable] = field(default_factory=list)  # VAR_ACCESS: other names of parts of globals
    constants: dict[str, Const] = field(default_factory=dict)  # that have no memory, by full name
    startup: Pou | None = None  # (init_retains : BOOL): what is called when the variables have their initial values
    startup_of_new: Pou | None = None  # the same of the variables that an online change adds
    shutdown: Pou | None = None  # what is called when the application ends, or its variables are initialised
    events: list[EventFunction] = field(default_factory=list)
    exports: list[Export] = field(default_factory=list)
    externals: list[Pou] = field(default_factory=list)  # functions in C that the sources declare, called or not
    io: Description | None = None  # the inputs and outputs, each with its address
    may_recurse: bool = False  # a call may lead back to its caller, so that the depth of calls is not known
    inferred: dict[tuple[str, str, int], Type] = field(default_factory=dict)  # as in World
    trail: Variable | None = None  # where the way of an exception is left that passed a `__TRY`
