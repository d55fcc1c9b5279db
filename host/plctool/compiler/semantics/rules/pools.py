"""Calls of __NEW and __DELETE.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.instances import COPY_CODE, INIT_RETAINS, initialisers, require_instances
from plctool.compiler.semantics.pools import (
    DEFAULT_ELEMENTS,
    DEFAULT_OF_VARIABLE,
    DEFAULT_ROWS,
    MAX_ELEMENTS,
    closer_of,
    creator_of,
    pool_of,
)
from plctool.compiler.semantics.rules.arguments import input_value
from plctool.compiler.semantics.rules.members import dotted_name
from plctool.compiler.semantics.rules.places import changeable_place
from plctool.compiler.semantics.symbols import ERROR, TypeSymbol, Unit, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    Assign,
    Call,
    Const,
    Direction,
    Expr,
    If,
    Load,
    Pos,
    Raise,
    Statement,
    Unary,
    UnaryOp,
)
from plctool.core import lib
from plctool.iec.types import (
    BOOL,
    DINT,
    InterfaceType,
    OpenArrayType,
    PointerType,
    ReferenceType,
    StructType,
    Type,
)

NEW, DELETE = "__NEW", "__DELETE"


def new(c: Checker, node: ast.Call) -> Expr:
    """`__NEW(T)`, `__NEW(T, n)`, `__NEW(T(inputs), n)`: the address of an element, or of the first of n in a row; 0 if
    there is none."""
    args = [a.value for a in node.args if a.value is not None and a.name is None]
    if len(args) != len(node.args) or not 1 <= len(args) <= 2:
        return c.error(node.pos, "arguments", "__NEW takes a type, and how many of it: __NEW(T) or __NEW(T, 5)")
    given = args[0].args if isinstance(args[0], ast.Call) else []
    named = args[0].callee if isinstance(args[0], ast.Call) else args[0]
    t, symbol = _type(c, named)
    declared = None if t is ERROR else _declared(c, symbol, named.pos)
    number = Const(1, DINT, c.pos(node.pos)) if len(args) == 1 else c.value(args[1], DINT)
    if t is ERROR or number.type is ERROR or declared is None or not _may_be_made(c, t, named.pos):
        return error_value(c.pos(node.pos))
    inputs = _inputs(c, t, given, named.pos)
    if inputs is None:
        return error_value(c.pos(node.pos))
    pool = pool_of(c.world, t, c.pos(named.pos))
    pool.declared = max(pool.declared, declared)
    pool.asked = max(pool.asked, _asked(number))
    start = c.world.start_of(symbol) if isinstance(symbol, TypeSymbol) else None
    creator = creator_of(pool, start, [(symbol.name, symbol.type) for symbol, _ in inputs], c.pos(named.pos))
    c.world.calls.add(c.scope.pou, creator, c.pos(node.pos))
    assert creator.result is not None
    return Call(creator, [number, *(e for _, e in inputs)], creator.result.type, c.pos(node.pos))


def _asked(number: Expr) -> int:
    """How many elements a pool without an attribute has for one __NEW."""
    if not isinstance(number, Const) or not isinstance(number.value, int):
        return DEFAULT_OF_VARIABLE
    return min(max(DEFAULT_ELEMENTS, DEFAULT_ROWS * number.value if number.value > 1 else 0), MAX_ELEMENTS)


def _type(c: Checker, node: ast.Expr) -> tuple[Type, Unit | None]:
    """The type that __NEW makes, and its declaration if it has one."""
    if isinstance(node, ast.TypeArgument):
        return c.world.declared.type_written(node.spec, c.scope), None
    name = node.name if isinstance(node, ast.Name) else dotted_name(c, node)
    if name is None:
        c.error(node.pos, "type", "the first argument of __NEW is the name of a type")
        return ERROR, None
    return c.world.declared.type_named(node.pos, name, c.scope), c.scope.unit(name)


def _declared(c: Checker, symbol: Unit | None, offset: int) -> int | None:
    """How many elements the attribute of a type has room for: 0 without one, None after an error."""
    text = None if symbol is None else symbol.decl.attributes.get("pool")
    if symbol is None or text is None:
        return 0
    size = text.strip().lstrip("0")
    if not (size.isascii() and size.isdigit() and len(size) <= len(str(MAX_ELEMENTS))) or int(size) > MAX_ELEMENTS:
        message = f"the pool of {symbol.decl.name} has 1 to {MAX_ELEMENTS} elements, not '{text}'"
        c.error(offset, "attribute", message)
        return None
    return int(size)


def _may_be_made(c: Checker, t: Type, offset: int) -> bool:
    """False after an error: no variable of the type can stand alone."""
    if isinstance(t, InterfaceType):
        c.error(offset, "type", f"{t} is an interface; __NEW needs a function block that implements it")
    elif isinstance(t, ReferenceType | OpenArrayType):
        c.error(offset, "type", f"__NEW cannot make {t}; give it the type of a variable")
    else:
        require_instances(c.world, t, c.scope, offset)
        return True
    return False


def _inputs(c: Checker, t: Type, given: list[ast.Argument], offset: int) -> list[tuple[VarSymbol, Expr]] | None:
    """The inputs of FB_Init in `__NEW(T(limit := 5))`, by name or in their order; None after an error."""
    known = _initialiser_inputs(c, t)
    found: list[tuple[VarSymbol, Expr]] = []
    for number, argument in enumerate(given):
        named = [s for s in known if s.name.casefold() == (argument.name or "").casefold()]
        symbol = next(iter(named if argument.name else known[number : number + 1]), None)
        if symbol is None or argument.output:
            listed = ", ".join(s.name for s in known)
            hint = f"it has {listed}" if listed else "it has none; assign what it shall have after __NEW"
            c.error(argument.pos, "arguments", f"FB_Init of {t} has no input {argument.name or number + 1}; {hint}")
            return None
        if any(s is symbol for s, _ in found):
            c.error(argument.pos, "arguments", f"{symbol.name} is given twice")
            return None
        if argument.value is not None:
            e = input_value(c, argument.value, symbol.type, symbol.name)
            if e.type is ERROR:
                return None
            found.append((symbol, e))
    missing = next((s for s in known if s.default is None and not s.given and all(s is not f for f, _ in found)), None)
    if missing is not None:
        c.error(offset, "arguments", f"FB_Init of {t} needs {missing.name}; write __NEW({t}({missing.name} := ...))")
        return None
    return found


def _initialiser_inputs(c: Checker, t: Type) -> list[VarSymbol]:
    """The inputs of FB_Init, those of the base first; of one name, that of the derived block."""
    found: dict[str, VarSymbol] = {}
    for member in initialisers(c.world, t) if isinstance(t, StructType) else ():
        for symbol, direction in c.world.declared.member(member).parameters:
            if direction is Direction.INPUT and symbol.name.casefold() not in (INIT_RETAINS, COPY_CODE):
                found[symbol.name.casefold()] = symbol
    return list(found.values())


def delete(c: Checker, node: ast.Call) -> list[Statement]:
    """`__DELETE(pointer)`: ends what __NEW made; the pointer is 0 then. Anything else is an access violation."""
    args = [a.value for a in node.args if a.value is not None and a.name is None]
    if len(node.args) != 1 or len(args) != 1:
        c.error(node.pos, "arguments", "__DELETE takes 1 argument: a pointer that __NEW gave")
        return []
    pos = c.pos(node.pos)
    if isinstance(args[0], ast.Name) and args[0].name.upper() == "THIS":
        own = c.expr(args[0])
        return _ended(c, own, own.type.target, pos) if isinstance(own.type, PointerType) else []
    place = changeable_place(c, args[0], "__DELETE", "be set to 0")
    t = None if place is None else place.type
    if place is None or t is ERROR:
        return []
    if not isinstance(t, PointerType) or isinstance(t, ReferenceType):
        c.error(args[0].pos, "type", f"__DELETE needs a POINTER TO what __NEW made, not {t}")
        return []
    return [*_ended(c, Load(place, t, pos), t.target, pos), Assign(place, Const(0, t, pos), pos)]


def _ended(c: Checker, address: Expr, t: Type, pos: Pos) -> list[Statement]:
    """Ends what is at an address; an access violation if __NEW did not make it."""
    closer = closer_of(c.world, t, pos)
    c.world.calls.add(c.scope.pou, closer, pos)
    ended = Call(closer, [address], BOOL, pos)
    return [If([(Unary(UnaryOp.NOT, ended, BOOL, pos), [Raise(int(lib.RTSEXCPT_ACCESS_VIOLATION), pos)])], [], pos)]
