"""Calls of __NEW and __DELETE.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.instances import COPY_CODE, INIT_RETAINS, initialisers, require_instances
from plctool.compiler.semantics.pools import MAX_ELEMENTS, closer_of, pool_of
from plctool.compiler.semantics.rules.members import dotted_name
from plctool.compiler.semantics.rules.places import changeable_place
from plctool.compiler.semantics.symbols import ERROR, PouSymbol, TypeSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Assign, Call, Const, Direction, Expr, If, Load, Raise, Statement, Unary, UnaryOp
from plctool.core import lib
from plctool.iec.types import BOOL, DINT, MAX_SIZE, InterfaceType, PointerType, ReferenceType, StructType, Type

NEW, DELETE = "__NEW", "__DELETE"


def new(c: Checker, node: ast.Call) -> Expr:
    """`__NEW(T)`, `__NEW(T, n)`: the address of an element, or of the first of n in a row; 0 when there are none."""
    args = [a.value for a in node.args if a.value is not None and a.name is None]
    if len(args) != len(node.args) or not 1 <= len(args) <= 2:
        return c.error(node.pos, "arguments", "__NEW takes a type, and how many of it: __NEW(T) or __NEW(T, 5)")
    if isinstance(args[0], ast.Call):
        return c.error(args[0].pos, "arguments", "__NEW gives FB_Init no inputs; set them in a method after it")
    name = args[0].name if isinstance(args[0], ast.Name) else dotted_name(c, args[0])
    symbol = None if name is None else c.scope.unit(name)
    t = ERROR if name is None else c.world.declared.type_named(args[0].pos, name, c.scope)
    if name is None:
        return c.error(args[0].pos, "type", "the first argument of __NEW is the name of a type")
    number = Const(1, DINT, c.pos(node.pos)) if len(args) == 1 else c.value(args[1], DINT)
    count = 0 if t is ERROR else _pool_size(c, symbol, t, name, args[0].pos)
    if ERROR in (t, number.type) or not count:
        return error_value(c.pos(node.pos))
    assert isinstance(symbol, PouSymbol | TypeSymbol)
    assert isinstance(t, StructType)
    pool = pool_of(c.world, t, count, symbol.decl.source.pos(symbol.decl.pos))
    c.world.calls.add(c.scope.pou, pool.create, c.pos(node.pos))
    assert pool.create.result is not None
    return Call(pool.create, [number], pool.create.result.type, c.pos(node.pos))


def _pool_size(c: Checker, symbol: object, t: Type, name: str, offset: int) -> int:
    """How many elements {attribute 'pool'} of a type is for; 0 after an error."""
    if isinstance(t, InterfaceType):
        c.error(offset, "type", f"{name} is an interface; __NEW needs a function block that implements it")
        return 0
    if not isinstance(t, StructType) or not isinstance(symbol, PouSymbol | TypeSymbol):
        message = f"__NEW makes function blocks and STRUCTs, not {t}; declare a STRUCT with it"
        c.error(offset, "type", f"{message}, with {{attribute 'pool' := '8'}} before it for room for 8 of them")
        return 0
    require_instances(c.world, t, c.scope, offset)
    needed = _needed_input(c, t)
    if needed:
        message = f"FB_Init of {t.name} needs {needed}, which __NEW cannot give"
        c.error(offset, "arguments", f"{message}; give it an initial value, and set it in a method")
        return 0
    text = symbol.decl.attributes.get("pool")
    if text is None:
        message = f"{name} has no pool to take memory from; write {{attribute 'pool' := '8'}} before its declaration"
        c.error(offset, "attribute", f"{message} for room for 8 of them, as nothing is allocated while a program runs")
        return 0
    size = text.strip().lstrip("0")
    if not (size.isascii() and size.isdigit() and len(size) <= len(str(MAX_ELEMENTS))) or int(size) > MAX_ELEMENTS:
        c.error(offset, "attribute", f"the pool of {name} has 1 to {MAX_ELEMENTS} elements, not '{text}'")
        return 0
    if int(size) * t.size > MAX_SIZE:
        c.error(offset, "size", f"a pool of {size} {name} with {t.size} bytes each is too large")
        return 0
    return int(size)


def _needed_input(c: Checker, t: StructType) -> str:
    """An input of FB_Init that a declaration has to give; "" when there is none."""
    for member in initialisers(c.world, t):
        for symbol, direction in c.world.declared.member(member).parameters:
            own = direction is Direction.INPUT and symbol.name.casefold() not in (INIT_RETAINS, COPY_CODE)
            if own and symbol.default is None and not symbol.given:
                return symbol.name
    return ""


def delete(c: Checker, node: ast.Call) -> list[Statement]:
    """`__DELETE(pointer)`: ends what __NEW made; the pointer is 0 then. Anything else is an access violation."""
    args = [a.value for a in node.args if a.value is not None and a.name is None]
    if len(node.args) != 1 or len(args) != 1:
        c.error(node.pos, "arguments", "__DELETE takes 1 argument: a pointer that __NEW gave")
        return []
    place, pos = changeable_place(c, args[0], "__DELETE", "be set to 0"), c.pos(node.pos)
    t = None if place is None else place.type
    if place is None or t is ERROR:
        return []
    if not isinstance(t, PointerType) or isinstance(t, ReferenceType) or not isinstance(t.target, StructType):
        message = f"__DELETE needs a POINTER TO the function block or STRUCT that __NEW made, not {t}"
        c.error(args[0].pos, "type", message)
        return []
    closer = closer_of(c.world, t.target, pos)
    c.world.calls.add(c.scope.pou, closer, pos)
    ended = Call(closer, [Load(place, t, pos)], BOOL, pos)
    wrong = If([(Unary(UnaryOp.NOT, ended, BOOL, pos), [Raise(int(lib.RTSEXCPT_ACCESS_VIOLATION), pos)])], [], pos)
    return [wrong, Assign(place, Const(0, t, pos), pos)]
