"""What the compiler knows of variables: SIZEOF, ADR, REF, __ISVALIDREF, LOWER_BOUND, UPPER_BOUND, STRING_SIZE.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import error_value, settle
from plctool.compiler.semantics.open_arrays import bounds_of, total_size
from plctool.compiler.semantics.rules.applied import Applied, BuiltIn, named
from plctool.compiler.semantics.rules.places import named_place
from plctool.compiler.semantics.rules.qualified_names import space_of
from plctool.compiler.semantics.symbols import ERROR, UNTYPED_INT, GlobalSymbol, PouSymbol, TypeSymbol, VarSymbol
from plctool.compiler.semantics.values import place_of
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    AddressOf,
    Binary,
    BinaryOp,
    BitPlace,
    Const,
    DerefPlace,
    Expr,
    Intrinsic,
    IntrinsicCall,
    Load,
    Storage,
    Variable,
    VarPlace,
)
from plctool.iec.types import (
    BOOL,
    BYTE,
    ELEMENTARY,
    UDINT,
    ArrayType,
    OpenArrayType,
    PointerType,
    RawPointerType,
    ReferenceType,
    StringType,
    Type,
)

OF_VARIABLES = ("SIZEOF", "XSIZEOF", "ADR", "REF", "__ISVALIDREF")
"""Functions whose argument is a variable or a type, not a value."""


def of_variable(c: Checker, name: str, node: ast.Call) -> Expr:
    """The call of one of OF_VARIABLES."""
    if len(node.args) != 1 or node.args[0].value is None:
        return c.error(node.pos, "arguments", f"{name} takes 1 argument, not {len(node.args)}")
    argument = node.args[0].value
    if name == "__ISVALIDREF":
        return _is_valid(c, argument)
    if name not in ("SIZEOF", "XSIZEOF"):
        return _address_of(c, argument, RawPointerType if name == "ADR" else PointerType)
    if isinstance(argument, ast.Name):
        symbol = c.scope.lookup(argument.name)
        is_block = isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION_BLOCK"
        if argument.name.upper() in ELEMENTARY or is_block or isinstance(symbol, TypeSymbol):
            t = c.world.declared.type_named(argument.pos, argument.name, c.scope)
            return error_value(c.pos(node.pos)) if t is ERROR else _size(c, t, node)
    e = settle(c.expr(argument))
    if isinstance(e.type, OpenArrayType):
        return total_size(place_of(e))
    return e if e.type is ERROR else _size(c, e.type, node)


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


def _address_of(c: Checker, node: ast.Expr, kind: type[PointerType]) -> Expr:
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
    t = place.type.element if isinstance(place.type, OpenArrayType) else place.type
    return AddressOf(place, kind(t), c.pos(node.pos))


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


def _bound(c: Checker, f: Applied) -> Expr:
    """`LOWER_BOUND(array, dimension)`"""
    array, dimension = f.args
    if not isinstance(array.type, ArrayType):
        return c.error(f.node.pos, "type", f"{f.name} needs an array, not {array.type}")
    count = len(array.type.bounds)
    number = dimension.value if isinstance(dimension, Const) else None
    if not isinstance(number, int) or not 1 <= number <= count:
        which = "the constant 1" if count == 1 else f"a constant from 1 to {count}"
        return c.error(f.node.args[1].pos, "range", f"the dimension of {array.type} is {which}")
    return bounds_of(place_of(array))[number - 1][f.name == "UPPER_BOUND"]


FUNCTIONS: dict[str, BuiltIn] = {
    "STRING_SIZE": BuiltIn(_string_size, 1, 1),
    "LOWER_BOUND": BuiltIn(_bound, 2, 2, named("ARR", "DIM")),
    "UPPER_BOUND": BuiltIn(_bound, 2, 2, named("ARR", "DIM")),
}
