"""Parts of variables: members, elements, characters, bits, and what pointers point to.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics import arithmetic, constants
from plctool.compiler.semantics.checker import Checker, checks
from plctool.compiler.semantics.conversions import (
    convert,
    elementary,
    error_value,
    is_referred,
    is_untyped,
    literal_type,
    load,
    place_of,
    whole_value,
)
from plctool.compiler.semantics.generics import bounds_of
from plctool.compiler.semantics.rules.calls import property_of
from plctool.compiler.semantics.rules.members import may_see, variable_value
from plctool.compiler.semantics.symbols import ERROR, NULL_TYPE, UNTYPED_INT, GlobalSymbol, Role, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.compiler.typed.nodes import (
    AddressOf,
    BitPlace,
    Const,
    DerefPlace,
    Expr,
    IndexPlace,
    Load,
    MemberPlace,
    SelfPlace,
    Storage,
    Variable,
    member_place,
)
from plctool.iec.common_types import NUMBERS
from plctool.iec.types import (
    BOOL,
    BYTE,
    DINT,
    DWORD,
    LWORD,
    WORD,
    ArrayType,
    Elementary,
    InterfaceType,
    OpenArrayType,
    PointerType,
    ReferenceType,
    StringType,
    StructType,
    Type,
)

_PARTS = {"B": BYTE, "W": WORD, "D": DWORD, "L": LWORD}


def member_of(c: Checker, base: Expr, node: ast.Member) -> Expr:
    """`base.name` of a struct or function block instance."""
    member = property_of(c, base, node)
    if member is not None:
        return member
    if isinstance(base, AddressOf) and isinstance(base.place, SelfPlace):  # THIS.x
        base = load(base.place)
    t, name = base.type, node.name
    number = elementary(t)
    if number is not None and number.kind in NUMBERS and not is_untyped(base):
        bit = _bit_number(c, node, number)
        return error_value(c.pos(node.pos)) if bit is None else bit_access(c, bit, None)
    if not isinstance(t, StructType):
        hint = "; write ^. to follow the pointer" if isinstance(t, PointerType) else ""
        if isinstance(t, StringType) and name.upper() in ("LEN", "LENGTH", "SIZE"):
            hint = "; its length is LEN(...)"
        if isinstance(t, ArrayType) and name.upper() in ("LEN", "LENGTH", "SIZE", "COUNT"):
            hint = "; its last index is UPPER_BOUND(..., 1)"
        return c.error(node.name_pos, "type", f"{t} has no members{hint}")
    block = c.world.blocks.get(t)
    if block is not None:
        return _block_member(c, base, block.members, node)
    field = t.member(name)
    if field is None:
        hint = did_you_mean(name, (f.name for f in t.fields))
        return c.error(node.name_pos, "unknown", f"{t} has no member {name}{hint}")
    return load(member_place(place_of(base), field, c.pos(node.pos)))


def _block_member(c: Checker, base: Expr, members: dict[str, VarSymbol], node: ast.Member) -> Expr:
    symbol = members.get(node.name.casefold())
    if symbol is None and (
        c.scope.is_incomplete(str(base.type)) or c.scope.inherits_unknown(c.world.class_of(base.type))
    ):
        return error_value(c.pos(node.pos))
    if symbol is None:
        names = [m.name for m in members.values() if m.role in (Role.INPUT, Role.OUTPUT)]
        cls = c.world.class_of(base.type)
        methods = cls.member_names() if cls is not None else []
        hint = did_you_mean(node.name, names + methods)
        what = "variable or method" if methods else "variable"
        return c.error(node.name_pos, "unknown", f"{base.type} has no {what} {node.name}{hint}")
    symbol.used = True
    if not may_see(c, symbol, base.type, node):
        return error_value(c.pos(node.pos))
    variable = symbol.variable
    if symbol.role is Role.IN_OUT and variable is not None:
        return _in_out_of(c, base, symbol, variable, node)
    if variable is None or variable.storage is Storage.AREA:  # a constant, VAR_STAT, VAR_EXTERNAL
        return variable_value(symbol, c.pos(node.pos))
    return load(MemberPlace(place_of(base), variable.offset, symbol.type, c.pos(node.pos)))


def _in_out_of(c: Checker, base: Expr, symbol: VarSymbol, variable: Variable, node: ast.Member) -> Expr:
    """`THIS^.x`, or what the last call gave an instance for its VAR_IN_OUT."""
    place, pos = place_of(base), c.pos(node.pos)
    if isinstance(place, SelfPlace):
        return variable_value(symbol, pos)
    if isinstance(symbol.type, OpenArrayType):
        return c.error(node.name_pos, "access", f"{symbol.name} is an ARRAY[*]; it can only be given in a call")
    t = ReferenceType(symbol.type)
    return load(DerefPlace(Load(MemberPlace(place, variable.offset, t, pos), t, pos), symbol.type, pos))


def _bit_number(c: Checker, node: ast.Member, t: Elementary) -> ast.BitAccess | None:
    """`word.NAME`: the bit whose number a constant says."""
    symbol = c.scope.lookup(node.name)
    if isinstance(symbol, GlobalSymbol):
        symbol = c.world.declared.variable(symbol)
    constant = symbol.value if isinstance(symbol, VarSymbol) else None
    if constant is None or not isinstance(constant.value, int):
        c.error(node.name_pos, "type", f"{t} has no members, and {node.name} is not a constant bit number")
        return None
    c.expr(ast.Name(node.name_pos, node.name))  # it is used
    return ast.BitAccess(node.pos, node.base, "X", constant.value, node.name_pos)


@checks(ast.BitAccess)
def bit_access(c: Checker, node: ast.BitAccess, expected: Type | None) -> Expr:
    """`base.3`, `base.%W1`: a bit or a part of a number."""
    base = c.expr(node.base)
    t = elementary(base.type)
    if base.type is ERROR:
        return base
    if t is None or t.kind not in NUMBERS or is_untyped(base):
        return c.error(node.index_pos, "type", f"{base.type} has no bits")
    if node.width != "X":
        return _part(c, base, t, node)
    if not 0 <= node.index < t.bits:
        return c.error(node.index_pos, "range", f"{base.type} has the bits 0..{t.bits - 1}")
    if isinstance(base, Const) and isinstance(base.value, int):
        return Const(base.value >> node.index & 1, BOOL, c.pos(node.pos))
    return load(BitPlace(place_of(base), node.index, BOOL, c.pos(node.pos)))


def _part(c: Checker, base: Expr, t: Elementary, node: ast.BitAccess) -> Expr:
    """`base.%B1`: a byte, word ... of a larger number."""
    part = _PARTS[node.width]
    if part.bits >= t.bits or (node.index + 1) * part.bits > t.bits:
        return c.error(node.index_pos, "range", f"{base.type} has no part %{node.width}{node.index}")
    if isinstance(base, Const) and isinstance(base.value, int):
        return convert(Const(base.value >> node.index * part.bits, t, base.pos), part)
    return load(MemberPlace(place_of(base), node.index * part.size, part, c.pos(node.pos)))


@checks(ast.Index)
def indexed(c: Checker, node: ast.Index, expected: Type | None) -> Expr:
    """`base[i, j]`: an element of an array, a character of a string, what a pointer leads to."""
    base = c.expr(node.base)
    indices = node.indices
    while indices and base.type is not ERROR:
        t = base.type
        if isinstance(t, StringType):
            base, indices = _character(c, base, indices), []
            continue
        if arithmetic.is_address(base):
            base, indices = _pointed(c, base, indices[0]), indices[1:]
            continue
        if not isinstance(t, ArrayType):
            more = len(indices) < len(node.indices)
            surplus = "is 1 index" if len(indices) == 1 else f"are {len(indices)} indices"
            message = f"there {surplus} too many" if more else f"{t} is not an array"
            return c.error(node.pos, "type", message)
        count = len(t.bounds)
        if len(indices) < count:
            return c.error(node.pos, "type", f"{t} needs {count} indices, not {len(indices)}; write [i, j]")
        base, indices = _element(c, base, t, indices[:count], node.pos), indices[count:]
    return base


def _element(c: Checker, base: Expr, t: ArrayType, nodes: list[ast.Expr], offset: int) -> Expr:
    values = [_subscript(c, n) for n in nodes]
    for e, node, (low, high) in zip(values, nodes, t.bounds, strict=True):
        if isinstance(t, OpenArrayType) or not isinstance(e, Const) or not isinstance(e.value, int):
            continue
        if e.type is not ERROR and not low <= e.value <= high:
            return c.error(node.pos, "range", f"the index {e.value} is outside {low}..{high}")
    if any(e.type is ERROR for e in values):
        return error_value(c.pos(offset))
    place = place_of(base)
    limits = bounds_of(place) if isinstance(t, OpenArrayType) else None
    return load(IndexPlace(place, values, t.element, c.pos(offset), limits))


def _pointed(c: Checker, pointer: Expr, node: ast.Expr) -> Expr:
    """`pointer[n]`: the n-th value after the one it points to."""
    index = _subscript(c, node)
    if index.type is ERROR:
        return index
    address = arithmetic.element(pointer, index, c.pos(node.pos))
    assert isinstance(address.type, PointerType)
    return load(DerefPlace(address, address.type.target, c.pos(node.pos)))


def _character(c: Checker, base: Expr, nodes: list[ast.Expr]) -> Expr:
    if len(nodes) > 1:
        return c.error(nodes[1].pos, "type", f"{base.type} has one index")
    index = _subscript(c, nodes[0])
    if index.type is ERROR:
        return index
    wide = isinstance(base.type, StringType) and base.type.wide
    return load(IndexPlace(place_of(base), [index], WORD if wide else BYTE, c.pos(nodes[0].pos)))


def _subscript(c: Checker, node: ast.Expr) -> Expr:
    """An array index: any integer type."""
    e = whole_value(c.expr(node, DINT))
    if e.type is UNTYPED_INT:
        assert isinstance(e, Const) and isinstance(e.value, int)
        return Const(e.value, DINT if constants.fits(e.value, DINT) else literal_type(e.value) or DINT, e.pos)
    base = elementary(e.type)
    if base is None or base.kind not in NUMBERS:
        return e if e.type is ERROR else c.error(node.pos, "type", f"an index is an integer, not {e.type}")
    return e if e.type is base else convert(e, base)


@checks(ast.Deref)
def dereferenced(c: Checker, node: ast.Deref, expected: Type | None) -> Expr:
    """`base^`: what a pointer points to."""
    pointer = c.expr(node.base)
    if pointer.type is ERROR:
        return pointer
    if isinstance(pointer, AddressOf):
        return load(pointer.place)
    if (
        not isinstance(pointer.type, PointerType)
        or isinstance(pointer.type, InterfaceType)
        or pointer.type is NULL_TYPE
    ):
        hint = "; a reference is used without ^" if is_referred(pointer) else ""
        return c.error(node.pos, "type", f"{pointer.type} is not a pointer{hint}")
    return load(DerefPlace(pointer, pointer.type.target, c.pos(node.pos)))
