"""Functions the compiler knows itself, among them those about variables: SIZEOF, ADR, REF, bounds, __QUERYINTERFACE.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable

from plctool.compiler.base.missing_names import known_name_like
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import convert, elementary, error_value, place_of, settle
from plctool.compiler.semantics.event_functions import may_be_registered, number_of
from plctool.compiler.semantics.generics import bounds_of
from plctool.compiler.semantics.rules import intrinsics
from plctool.compiler.semantics.rules.arguments import packed, packed_and_pointed_to, size_of
from plctool.compiler.semantics.rules.conversion_calls import conversion_hint, find_conversion
from plctool.compiler.semantics.rules.information import INFORMATION_FUNCTIONS, information
from plctool.compiler.semantics.rules.intrinsics import Applied, BuiltIn, named
from plctool.compiler.semantics.rules.members import space_of
from plctool.compiler.semantics.rules.places import changeable_place, named_place
from plctool.compiler.semantics.symbols import ERROR, UNTYPED_INT, GlobalSymbol, PouSymbol, TypeSymbol, VarSymbol
from plctool.compiler.semantics.task_links import number_of_program
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    AddressOf,
    Binary,
    BinaryOp,
    BitPlace,
    Call,
    CallStatement,
    Const,
    Convert,
    DerefPlace,
    Expr,
    Intrinsic,
    IntrinsicCall,
    Load,
    Place,
    Pos,
    Statement,
    Storage,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import is_unaligned
from plctool.iec.common_types import NUMBERS
from plctool.iec.types import (
    BOOL,
    BYTE,
    DINT,
    ELEMENTARY,
    INT,
    LINT,
    UDINT,
    ULINT,
    ArrayType,
    InterfaceType,
    OpenArrayType,
    PointerType,
    RawPointerType,
    ReferenceType,
    StringType,
    StructType,
    SubrangeType,
    Type,
)

# ---- what is known of variables ----

_OF_VARIABLES = ("SIZEOF", "XSIZEOF", "ADR", "REF", "__ISVALIDREF")
"""Functions whose argument is a variable or a type, not a value."""


def of_variable(c: Checker, name: str, node: ast.Call, expected: Type | None) -> Expr:
    """The call of one of _OF_VARIABLES; `expected` is the type the surroundings would like."""
    if len(node.args) != 1 or node.args[0].value is None:
        return c.error(node.pos, "arguments", f"{name} takes 1 argument, not {len(node.args)}")
    argument = node.args[0].value
    if name == "__ISVALIDREF":
        return _is_valid(c, argument)
    if name not in ("SIZEOF", "XSIZEOF"):
        return _address_of(c, argument, RawPointerType if name == "ADR" else PointerType, expected)
    if isinstance(argument, ast.Name):
        symbol = c.scope.lookup(argument.name)
        is_block = isinstance(symbol, PouSymbol) and symbol.keyword is ast.Unit.FUNCTION_BLOCK
        if argument.name.upper() in ELEMENTARY or is_block or isinstance(symbol, TypeSymbol):
            t = c.world.declared.type_named(argument.pos, argument.name, c.scope)
            return error_value(c.pos(node.pos)) if t is ERROR else _size(c, t, node)
    e = settle(c.expr(argument))
    if e.type is ERROR:
        return e
    size = size_of(c, place_of(e))
    if isinstance(size, Const):
        return _size(c, e.type, node)
    to = None if expected is None else elementary(expected)
    return convert(size, to) if to in (UDINT, LINT, ULINT) else size  # it is never below zero


def _is_valid(c: Checker, node: ast.Expr) -> Expr:
    """Whether a reference refers to something."""
    e, pos = c.expr(node), c.pos(node.pos)
    in_out = _in_out_given(c, e)
    if in_out is not None:
        return in_out
    pointer = e.place.pointer if isinstance(e, Load) and isinstance(e.place, DerefPlace) else None
    if pointer is None or not isinstance(pointer.type, ReferenceType):
        return e if e.type is ERROR else c.error(node.pos, "type", f"{e.type} is not a REFERENCE TO")
    return Binary(BinaryOp.NE, pointer, Const(0, pointer.type, pos), BOOL, pos)


def _in_out_given(c: Checker, e: Expr) -> Expr | None:
    """Whether a VAR_IN_OUT was given: that of a function always is, that of an instance from its first call on. None
    when it is none."""
    variable = e.place.var if isinstance(e, Load) and isinstance(e.place, VarPlace) else None
    if variable is None or variable.storage is not Storage.REFERENCE:
        return None
    block = None if c.scope.cls is None else c.scope.cls.block
    symbol = None if block is None else block.members.get(variable.name.casefold())
    if block is None or symbol is None or symbol.variable is not variable:
        return Const(1, BOOL, e.pos)
    t = RawPointerType(BYTE)
    slot = Load(VarPlace(Variable(variable.name, t, Storage.SELF, e.pos, offset=variable.offset), t, e.pos), t, e.pos)
    return Binary(BinaryOp.NE, slot, Const(0, t, e.pos), BOOL, e.pos)


def _size(c: Checker, t: Type, node: ast.Call) -> Expr:
    return Const(t.size, UNTYPED_INT, c.pos(node.pos))


def _address_of(c: Checker, node: ast.Expr, kind: type[PointerType], expected: Type | None) -> Expr:
    """ADR(x), REF(x); of a constant, the address of a variable that holds it."""
    constant = _constant_text(c, node)
    if constant is not None and isinstance(constant.type, StringType):
        return AddressOf(
            VarPlace(c.world.text(constant), constant.type, constant.pos), kind(constant.type), constant.pos
        )
    place = named_place(c, node, "an address")
    if place is None:
        return error_value(c.pos(node.pos))
    if isinstance(place, BitPlace):
        return c.error(node.pos, "type", "a single bit has no address")
    if kind is PointerType and is_unaligned(place):
        return c.error(node.pos, "type", packed(place, "a reference"))
    if is_unaligned(place) and not _is_of_bytes(expected):
        c.warning(node.pos, "pointer", packed_and_pointed_to(place))
    t = place.type.element if isinstance(place.type, OpenArrayType) else place.type
    return AddressOf(place, kind(t), c.pos(node.pos))


def _is_of_bytes(t: Type | None) -> bool:
    """Whether what is wanted is a pointer to something that may be anywhere, or the number of an address."""
    return t is not None and (not isinstance(t, PointerType) or t.target.align == 1)


def _constant_text(c: Checker, node: ast.Expr) -> Const | None:
    """The value of a text, or of a constant that is one; None for anything else."""
    symbol: object = None
    if isinstance(node, ast.Name):
        symbol = c.scope.lookup(node.name)
    elif isinstance(node, ast.Member):
        space = space_of(c, node.base)
        symbol = None if space is None else space.members.get(node.name.casefold())
    elif not isinstance(node, ast.Literal) or node.kind not in (ast.LiteralKind.STRING, ast.LiteralKind.WSTRING):
        return None
    if isinstance(symbol, GlobalSymbol):
        symbol = c.world.declared.variable(symbol)
    if not isinstance(node, ast.Literal) and not (isinstance(symbol, VarSymbol) and symbol.value is not None):
        return None
    e = c.expr(node)
    return e if isinstance(e, Const) and isinstance(e.type, StringType) else None


def _string_size(c: Checker, f: Applied) -> Expr:
    """`STRING_SIZE(text)`: the bytes of its variable."""
    text = f.args[0]
    if not isinstance(text.type, StringType):
        return c.error(f.node.pos, "type", f"{f.name} needs a STRING, not {text.type}")
    loaded = Load(place_of(text), text.type, text.pos)
    return IntrinsicCall(Intrinsic.STRING_SIZE, [loaded], UDINT, c.pos(f.node.pos))


def _exchange(c: Checker, f: Applied) -> Expr:
    """`__EXCHANGE(variable, old, new)` of the standard library."""
    if not c.scope.library:
        return c.missing(f.node.pos, f.name, f"unknown function {f.name}")
    variable, old, new = f.args
    address = AddressOf(place_of(variable), PointerType(DINT), variable.pos)
    args: list[Expr] = [address, c.coerce(old, DINT), c.coerce(new, DINT)]
    return IntrinsicCall(Intrinsic.EXCHANGE, args, BOOL, c.pos(f.node.pos))


def _task(c: Checker, f: Applied) -> Expr:
    """`__TASK()` of the standard library."""
    if not c.scope.library:
        return c.missing(f.node.pos, f.name, f"unknown function {f.name}")
    return IntrinsicCall(Intrinsic.TASK, [], UDINT, c.pos(f.node.pos))


def _bound(c: Checker, f: Applied) -> Expr:
    """`LOWER_BOUND(array, dimension)`"""
    array, dimension = f.args
    if not isinstance(array.type, ArrayType):
        return c.error(f.node.pos, "type", f"{f.name} needs an array, not {array.type}")
    count, pos = len(array.type.bounds), c.pos(f.node.pos)
    bounds = [pair[f.name == "UPPER_BOUND"] for pair in bounds_of(place_of(array))]
    base = elementary(dimension.type)
    if isinstance(dimension, Const) or base is None or base.kind not in NUMBERS:
        number = dimension.value if isinstance(dimension, Const) else None
        if not isinstance(number, int) or not 1 <= number <= count:
            which = "1" if count == 1 else f"a number from 1 to {count}"
            return c.error(f.node.args[1].pos, "range", f"the dimension of {array.type} is {which}")
        return bounds[number - 1]
    within = c.coerce(dimension, SubrangeType(f"DINT (1..{count})", DINT, 1, count))
    if within.type is ERROR:
        return within
    index = Binary(BinaryOp.SUB, Convert(within, DINT, pos), Const(1, DINT, pos), DINT, pos)
    return IntrinsicCall(Intrinsic.MUX, [index, *(c.coerce(bound, DINT) for bound in bounds)], DINT, pos)


_ON_VARIABLES: dict[str, BuiltIn] = {
    "STRING_SIZE": BuiltIn(_string_size, 1, 1),
    "__EXCHANGE": BuiltIn(_exchange, 3, 3),
    "__TASK": BuiltIn(_task, 0, 0),
    "LOWER_BOUND": BuiltIn(_bound, 2, 2, named("ARR", "DIM")),
    "UPPER_BOUND": BuiltIn(_bound, 2, 2, named("ARR", "DIM")),
}


# ---- __QUERYINTERFACE, __QUERYPOINTER and ?= ----

_INTERFACE, _POINTER = "an interface", "a pointer to a function block"
QUERIES = {"__QUERYINTERFACE": _INTERFACE, "__QUERYPOINTER": _POINTER}
"""The functions, and what each needs to know."""


def query(c: Checker, node: ast.Call) -> Expr:
    """`__QUERYINTERFACE(source, target)`: whether the instance is what the target may hold, which is then there."""
    assert isinstance(node.callee, ast.Name)
    name = node.callee.name.upper()
    wanted = QUERIES[name]
    args = [a.value for a in node.args if a.value is not None and a.name is None]
    if len(node.args) != 2 or len(args) != 2:
        return c.error(node.pos, "arguments", f"{name} takes 2 arguments: what is asked, and {wanted}")
    target = changeable_place(c, args[1], f"the second argument of {name}", "take an address")
    t = None if target is None else target.type
    if t is not None and not (_takes_instances(c, t) and isinstance(t, InterfaceType) is (wanted == _INTERFACE)):
        return c.error(args[1].pos, "type", f"the second argument of {name} is {wanted}, not {t}")
    return _ask(c, name, args[0], target, c.pos(node.pos))


def attempt(c: Checker, node: ast.Assign) -> list[Statement]:
    """`target ?= source`: the target holds the instance of the source if it may, and else NULL."""
    pos = c.pos(node.pos)
    target = changeable_place(c, node.targets[0], "the left side of ?=", "take an address")
    reference = target.pointer if isinstance(target, DerefPlace) else None
    if isinstance(reference, Load) and isinstance(reference.type, ReferenceType):
        target = reference.place
    if target is not None and not _takes_instances(c, target.type):
        wanted = f"{_INTERFACE}, a reference or {_POINTER}"
        c.error(node.targets[0].pos, "type", f"the left side of ?= is {wanted}, not {target.type}; write :=")
        return []
    asked = _ask(c, "?=", node.value, target, pos)
    return [CallStatement(asked, pos)] if isinstance(asked, Call) else []


def _takes_instances(c: Checker, t: Type) -> bool:
    return isinstance(t, PointerType) and c.world.class_of(t.target) is not None


def _ask(c: Checker, name: str, node: ast.Expr, target: Place | None, pos: Pos) -> Expr:
    """Whether the instance that `node` gives is what the target may hold, which is then there."""
    source = c.expr(node)
    if source.type is ERROR or target is None:
        return error_value(pos)
    if isinstance(source.type, StructType):
        source = AddressOf(place_of(source), PointerType(source.type), source.pos)
    cls = c.world.class_of(source.type.target) if isinstance(source.type, PointerType) else None
    if cls is None or not isinstance(source.type, PointerType):
        message = f"{name} asks an instance, an interface or a pointer to a function block, not {source.type}"
        return c.error(node.pos, "type", message)
    assert isinstance(target.type, PointerType)
    function = c.world.dispatches.queries.function(cls, source.type, target.type, pos)
    return Call(function, [source, target], BOOL, pos)


# ---- calls by name ----

_PLACES = ("__POUNAME", "__POSITION")
_INDEX = "INDEXOF"
_FUNCTIONS = intrinsics.FUNCTIONS | _ON_VARIABLES


def find_built_in(c: Checker, name: str) -> Callable[[ast.Call, Type | None], Expr] | None:
    """The rule of a built-in function or a conversion; None when there is none of that name."""
    if name in _OF_VARIABLES:
        return lambda node, expected: of_variable(c, name, node, expected)
    if name in _PLACES:
        return lambda node, expected: _place(c, name, node)
    if name == _INDEX:
        return lambda node, _: _function_number(c, node)
    if name in INFORMATION_FUNCTIONS:
        return lambda node, _: information(c, name, node)
    function = _FUNCTIONS.get(name)
    if function is None:
        return find_conversion(c, name)
    return lambda node, expected: _applied(c, name, function, node, expected)


def _applied(c: Checker, name: str, function: BuiltIn, node: ast.Call, expected: Type | None) -> Expr:
    args = _checked_arguments(c, name, function, node, expected)
    if args is None:
        return error_value(c.pos(node.pos))
    if not function.takes(len(args)):
        return c.error(node.pos, "arguments", f"{name} takes {function.needs}, not {len(args)}")
    return function.rule(c, Applied(name, args, node, expected))


def is_built_in(name: str) -> bool:
    """True for a function that the compiler knows itself; conversions are not among them."""
    known_here = (_FUNCTIONS, _OF_VARIABLES, _PLACES, (_INDEX,), QUERIES, INFORMATION_FUNCTIONS)
    return any(name.upper() in known for known in known_here)


def built_in_names() -> list[str]:
    """Returns the functions that the compiler knows itself, but for conversions and what begins with _."""
    known_here = (_FUNCTIONS, _OF_VARIABLES, (_INDEX,), INFORMATION_FUNCTIONS)
    return sorted(name for known in known_here for name in known if not name.startswith("_"))


def _place(c: Checker, name: str, node: ast.Call) -> Expr:
    """`__POUNAME()`: the name of the unit around; `__POSITION()`: line and column, as a text."""
    if node.args:
        return c.error(node.pos, "arguments", f"{name} takes no arguments")
    pos = c.pos(node.pos)
    pou = c.scope.source.stem if c.scope.pou is None else c.scope.pou.name
    text = pou if name == "__POUNAME" else f"Line {pos.line}, Column {pos.column}"
    return Const(text, StringType(max(len(text), 1)), pos)


def _function_number(c: Checker, node: ast.Call) -> Expr:
    """`INDEXOF(Name)`: the number of a function that events may call (event_functions.py), or of a program
    (task_links.py)."""
    given = node.args[0].value if len(node.args) == 1 else None
    name = given.name if isinstance(given, ast.Name) else ""
    if c.world.names.instance(name.casefold()) is not None:
        return _program_number(c, node, name)
    symbol = c.world.names.own_unit(name.casefold())
    if not isinstance(symbol, PouSymbol) or symbol.keyword is not ast.Unit.FUNCTION:
        message = "INDEXOF takes the name of a FUNCTION of the program that events may call, or of a PROGRAM"
        return c.error(node.pos, "arguments", message)
    info = c.world.declared.function(symbol, {})
    if info is not None and not may_be_registered(info):
        message = (
            f"no event can call {symbol.decl.name}: it takes no inputs and has the result BOOL or none, or it takes"
            " 3 inputs of type DWORD and has the result DWORD or none"
        )
        return c.error(node.pos, "arguments", message)
    return Const(number_of(symbol.decl.name), INT, c.pos(node.pos))


def _program_number(c: Checker, node: ast.Call, name: str) -> Expr:
    if c.world.programs_run is not None and name.casefold() not in c.world.programs_run:
        return c.error(node.pos, "arguments", f"INDEXOF takes a PROGRAM that a task runs, which none does with {name}")
    return Const(number_of_program(name), INT, c.pos(node.pos))


def function_hint(c: Checker, name: str) -> str:
    """`; did you mean ADD?` for what is called and unknown, else nothing: what the program has comes first."""
    symbols = (c.scope.outer | c.scope.names).values()
    instances = [s.name for s in symbols if isinstance(s, VarSymbol) and s.type in c.world.blocks]
    members = [] if c.scope.cls is None else c.scope.cls.member_names()
    return (
        conversion_hint(c, name.upper())
        or known_name_like(name, [*instances, *members, *c.world.names.program_names()])
        or known_name_like(name, [*c.world.names.function_names(), *INFORMATION_FUNCTIONS.values()])
        or known_name_like(name, [*_FUNCTIONS, *_OF_VARIABLES])
    )


def _checked_arguments(
    c: Checker, name: str, function: BuiltIn, node: ast.Call, expected: Type | None
) -> list[Expr] | None:
    """Checked arguments in order; formal ones by the names of the standard."""
    found: dict[int, Expr] = {}
    for i, argument in enumerate(node.args):
        at = _index_of(function, argument, i)
        if at is None or at in found or argument.value is None:
            c.error(argument.pos, "arguments", f"{name} has no parameter {argument.name or i + 1}")
            return None
        hint = None if name in intrinsics.COMPARING else expected
        found[at] = c.expr(argument.value, BOOL if name == "SEL" and at == 0 else hint)
    if sorted(found) != list(range(len(found))):
        c.error(node.pos, "arguments", f"an argument of {name} is missing")
        return None
    args = [found[i] for i in sorted(found)]
    return None if any(a.type is ERROR for a in args) else args


def _index_of(function: BuiltIn, argument: ast.Argument, i: int) -> int | None:
    """Which argument this is; None when the function has none of that name."""
    if argument.output:
        return None
    return i if argument.name is None else function.index_of(argument.name.upper())
