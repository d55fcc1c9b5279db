"""Expressions: names become places, and each kind of node finds who checks it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.semantics import constants, pointers
from plctool.compiler.semantics.checker import is_untyped, load, place_of
from plctool.compiler.semantics.conversions import (
    NUMBERS,
    convert,
    elementary,
    error_value,
    literal_type,
)  # fmt: skip
from plctool.compiler.semantics.literal_values import Literals
from plctool.compiler.semantics.open_arrays import bounds_of
from plctool.compiler.semantics.operators import Operators
from plctool.compiler.semantics.symbols import (
    ERROR,
    NULL_TYPE,
    UNTYPED_INT,
    GlobalSymbol,
    MemberSymbol,
    Namespace,
    PouSymbol,
    Role,
    TypeSymbol,
    VarSymbol,
)  # fmt: skip
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    AddressOf,
    BitPlace,
    Const,
    DerefPlace,
    Expr,
    IndexPlace,
    Load,
    MemberPlace,
    Pos,
    SelfPlace,
    Storage,
    VarPlace,
)  # fmt: skip
from plctool.compiler.types import (
    BOOL,
    BYTE,
    DINT,
    DWORD,
    LWORD,
    WORD,
    ArrayType,
    Elementary,
    EnumType,
    InterfaceType,
    OpenArrayType,
    PointerType,
    StringType,
    StructType,
    Type,
)  # fmt: skip

_PARTS = {"B": BYTE, "W": WORD, "D": DWORD, "L": LWORD}


class Expressions(Literals, Operators):
    """Checks names and parts of variables."""

    def expr(self, node: ast.Expr, expected: Type | None = None) -> Expr:
        """The typed expression; `expected` is the type the surroundings would like. Untyped constants stay untyped."""
        return self._handlers[type(node)](self, node, expected)

    # ---- names ----

    def _name(self, node: ast.Name, expected: Type | None) -> Expr:
        symbol = self.scope.lookup(node.name)
        if isinstance(symbol, GlobalSymbol):
            choices = self.world.same_named(node.name)
            if choices:
                listed = " or ".join(s.full_name for s in choices)
                return self.error(node.pos, "ambiguous", f"{node.name} is in several lists; write {listed}")
            if not self.scope.may_use(symbol, node.name, node.pos):
                return error_value(self.pos(node.pos))
            symbol = self.world.declarations.global_variable(symbol)
        if isinstance(symbol, VarSymbol):
            return self.variable(symbol, self.pos(node.pos))
        own = self.own_name(node, symbol)
        if own is not None:
            return own
        if symbol is None or (isinstance(symbol, PouSymbol) and symbol.library):
            value = self.world.enum_value(node.name, self.scope, node.pos, expected)
            if value is not None or symbol is None:
                return value or self._unknown(node)
        return self.error(node.pos, "name", f"{node.name} is {describe(symbol)}, not a value")

    def _unknown(self, node: ast.Name) -> Expr:
        qualified = self.world.qualified_names(node.name)
        if qualified:
            return self.error(node.pos, "unknown", f"unknown name {node.name}; write {' or '.join(qualified)}")
        names = [*(s for s in self.scope.names), *self.world.visible_names()]
        hint = did_you_mean(node.name, {self._written(n) for n in names} - {""})
        return self.error(node.pos, "unknown", f"unknown name {node.name}{hint}" if node.name else "a name is missing")

    def _written(self, key: str) -> str:
        symbol = self.scope.names.get(key)
        return symbol.name if isinstance(symbol, VarSymbol | GlobalSymbol) else key

    def variable(self, symbol: VarSymbol, pos: Pos) -> Expr:
        """A variable as a value: of constants their value."""
        symbol.used = True
        if symbol.value is not None:
            return Const(symbol.value.value, symbol.type, pos)
        variable = symbol.variable
        if variable is None:
            return error_value(pos)
        if variable.bit is not None:
            return Load(BitPlace(VarPlace(variable, BYTE, pos), variable.bit, BOOL, pos), BOOL, pos)
        return load(VarPlace(variable, symbol.type, pos))

    def _enum_value(self, node: ast.EnumValue, expected: Type | None) -> Expr:
        t = self.world.declarations.named_type(node.pos, node.type_name, self.scope)
        if t is ERROR:
            return error_value(self.pos(node.pos))
        if not isinstance(t, EnumType):
            return self.error(node.pos, "type", f"{node.type_name} is not an enumeration")
        return self._value_of(t, node.name, node.pos, node.pos)

    def _value_of(self, t: EnumType, name: str, offset: int, name_offset: int) -> Expr:
        key = name.casefold()
        for value_name, value in t.values.items():
            if value_name.casefold() == key:
                return Const(value, t, self.pos(offset))
        return self.error(name_offset, "unknown", f"{t} has no value {name}{did_you_mean(name, t.values)}")

    def _direct(self, node: ast.DirectAddress, expected: Type | None) -> Expr:
        symbol = self.world.declarations.direct.find(node, self.scope)
        return error_value(self.pos(node.pos)) if symbol is None else self.variable(symbol, self.pos(node.pos))

    # ---- parts of variables ----

    def _member(self, node: ast.Member, expected: Type | None) -> Expr:
        if isinstance(node.base, ast.Name):
            symbol = self.scope.lookup(node.base.name)
            if isinstance(symbol, Namespace):
                return self._namespace_member(symbol, node)
            if isinstance(symbol, TypeSymbol):
                t = self.world.declarations.resolve_symbol(symbol)
                if isinstance(t, EnumType):
                    return self._value_of(t, node.name, node.pos, node.name_pos)
                return self.error(node.base.pos, "name", f"{node.base.name} is a type, not a variable")
        named = self.qualified(node)
        if named is not None:
            return named
        base = self.expr(node.base)
        if base.type is ERROR:
            return base
        if isinstance(base.type, EnumType) and isinstance(node.base, ast.Name):
            return self._value_of(base.type, node.name, node.pos, node.name_pos)  # color : Color; Color.Red
        return self.member(base, node)

    def _namespace_member(self, namespace: Namespace, node: ast.Member) -> Expr:
        symbol = namespace.members.get(node.name.casefold())
        if symbol is None:
            hint = did_you_mean(node.name, (m.name for m in namespace.members.values()))
            return self.error(node.name_pos, "unknown", f"{namespace.what} {namespace.name} has no {node.name}{hint}")
        if isinstance(symbol, GlobalSymbol):
            symbol = self.world.declarations.global_variable(symbol)
        return self.variable(symbol, self.pos(node.pos))

    def member(self, base: Expr, node: ast.Member) -> Expr:
        """`base.name` of a struct or function block instance."""
        member = self.member_of(base, node)
        if member is not None:
            return member
        if isinstance(base, AddressOf) and isinstance(base.place, SelfPlace):  # THIS.x
            base = load(base.place)
        t, name = base.type, node.name
        number = elementary(t)
        if number is not None and number.kind in NUMBERS and not is_untyped(base):
            bit = self._bit_number(node, number)
            return error_value(self.pos(node.pos)) if bit is None else self._bit(bit, None)
        if not isinstance(t, StructType):
            hint = "; write ^. to follow the pointer" if isinstance(t, PointerType) else ""
            return self.error(node.name_pos, "type", f"{t} has no members{hint}")
        block = self.world.blocks.get(t)
        if block is not None:
            return self._block_member(base, block.members, node)
        field = t.member(name)
        if field is None:
            hint = did_you_mean(name, (f.name for f in t.fields))
            return self.error(node.name_pos, "unknown", f"{t} has no member {name}{hint}")
        return load(MemberPlace(place_of(base), field.offset, field.type, self.pos(node.pos)))

    def _block_member(self, base: Expr, members: dict[str, VarSymbol], node: ast.Member) -> Expr:
        symbol = members.get(node.name.casefold())
        if symbol is None:
            names = [m.name for m in members.values() if m.role in (Role.INPUT, Role.OUTPUT)]
            cls = self.world.classes.class_of(base.type)
            methods = cls.member_names() if cls is not None else []
            hint = did_you_mean(node.name, names + methods)
            what = "variable or method" if methods else "variable"
            return self.error(node.name_pos, "unknown", f"{base.type} has no {what} {node.name}{hint}")
        symbol.used = True
        if not self.may_see(symbol, base.type, node):
            return error_value(self.pos(node.pos))
        if symbol.role is Role.IN_OUT:
            return self.error(node.name_pos, "access", f"{symbol.name} is a VAR_IN_OUT; it can only be given in a call")
        variable = symbol.variable
        if variable is None or variable.storage is Storage.AREA:  # a constant, VAR_STAT, VAR_EXTERNAL
            return self.variable(symbol, self.pos(node.pos))
        return load(MemberPlace(place_of(base), variable.offset, symbol.type, self.pos(node.pos)))

    def _bit_number(self, node: ast.Member, t: Elementary) -> ast.BitAccess | None:
        """`word.NAME`: the bit whose number a constant says."""
        symbol = self.scope.lookup(node.name)
        if isinstance(symbol, GlobalSymbol):
            symbol = self.world.declarations.global_variable(symbol)
        constant = symbol.value if isinstance(symbol, VarSymbol) else None
        if constant is None or not isinstance(constant.value, int):
            self.error(
                node.name_pos, "type", f"{t} has no members, and {node.name} is no constant that counts its bits"
            )
            return None
        self.expr(ast.Name(node.name_pos, node.name))  # it is used
        return ast.BitAccess(node.pos, node.base, "X", constant.value, node.name_pos)

    def _bit(self, node: ast.BitAccess, expected: Type | None) -> Expr:
        base = self.expr(node.base)
        t = elementary(base.type)
        if base.type is ERROR:
            return base
        if t is None or t.kind not in NUMBERS or is_untyped(base):
            return self.error(node.index_pos, "type", f"{base.type} has no bits")
        if node.width != "X":
            return self._part(base, t, node)
        if not 0 <= node.index < t.bits:
            return self.error(node.index_pos, "range", f"{base.type} has the bits 0..{t.bits - 1}")
        if isinstance(base, Const) and isinstance(base.value, int):
            return Const(base.value >> node.index & 1, BOOL, self.pos(node.pos))
        return load(BitPlace(place_of(base), node.index, BOOL, self.pos(node.pos)))

    def _part(self, base: Expr, t: Elementary, node: ast.BitAccess) -> Expr:
        """`base.%B1`: a byte, word ... of a larger number."""
        part = _PARTS[node.width]
        if part.bits >= t.bits or (node.index + 1) * part.bits > t.bits:
            return self.error(node.index_pos, "range", f"{base.type} has no part %{node.width}{node.index}")
        if isinstance(base, Const) and isinstance(base.value, int):
            return convert(Const(base.value >> node.index * part.bits, t, base.pos), part)
        return load(MemberPlace(place_of(base), node.index * part.size, part, self.pos(node.pos)))

    def _index(self, node: ast.Index, expected: Type | None) -> Expr:
        self._deeper(node.pos)
        base = self.expr(node.base)
        indices = node.indices
        while indices and base.type is not ERROR:
            t = base.type
            if isinstance(t, StringType):
                base, indices = self._character(base, indices), []
                continue
            if pointers.is_address(base):
                base, indices = self._pointed(base, indices[0]), indices[1:]
                continue
            if not isinstance(t, ArrayType):
                more = len(indices) < len(node.indices)
                message = f"there are {len(indices)} indices too many" if more else f"{t} is not an array"
                return self.error(node.pos, "type", message)
            count = len(t.bounds)
            if len(indices) < count:
                return self.error(node.pos, "type", f"{t} needs {count} indices, not {len(indices)}")
            base, indices = self._element(base, t, indices[:count], node.pos), indices[count:]
        self._depth -= 1
        return base

    def _element(self, base: Expr, t: ArrayType, nodes: list[ast.Expr], offset: int) -> Expr:
        values = [self.subscript(n) for n in nodes]
        for e, node, (low, high) in zip(values, nodes, t.bounds, strict=True):
            if isinstance(t, OpenArrayType) or not isinstance(e, Const) or not isinstance(e.value, int):
                continue
            if e.type is not ERROR and not low <= e.value <= high:
                return self.error(node.pos, "range", f"the index {e.value} is outside {low}..{high}")
        if any(e.type is ERROR for e in values):
            return error_value(self.pos(offset))
        place = place_of(base)
        limits = bounds_of(place) if isinstance(t, OpenArrayType) else None
        return load(IndexPlace(place, values, t.element, self.pos(offset), limits))

    def _pointed(self, pointer: Expr, node: ast.Expr) -> Expr:
        """`pointer[n]`: the n-th value behind the one it points to."""
        index = self.subscript(node)
        if index.type is ERROR:
            return index
        address = pointers.element(pointer, index, self.pos(node.pos))
        assert isinstance(address.type, PointerType)
        return load(DerefPlace(address, address.type.target, self.pos(node.pos)))

    def _character(self, base: Expr, nodes: list[ast.Expr]) -> Expr:
        if len(nodes) > 1:
            return self.error(nodes[1].pos, "type", f"{base.type} has one index")
        index = self.subscript(nodes[0])
        if index.type is ERROR:
            return index
        wide = isinstance(base.type, StringType) and base.type.wide
        return load(IndexPlace(place_of(base), [index], WORD if wide else BYTE, self.pos(nodes[0].pos)))

    def subscript(self, node: ast.Expr) -> Expr:
        """An array index: any integer type."""
        e = self.expr(node, DINT)
        if e.type is UNTYPED_INT:
            assert isinstance(e, Const) and isinstance(e.value, int)
            return Const(e.value, DINT if constants.fits(e.value, DINT) else literal_type(e.value) or DINT, e.pos)
        base = elementary(e.type)
        if base is None or base.kind not in NUMBERS:
            return e if e.type is ERROR else self.error(node.pos, "type", f"an index is an integer, not {e.type}")
        return e if e.type is base else convert(e, base)

    def _deref(self, node: ast.Deref, expected: Type | None) -> Expr:
        pointer = self.expr(node.base)
        if pointer.type is ERROR:
            return pointer
        if isinstance(pointer, AddressOf):
            return load(pointer.place)
        if (
            not isinstance(pointer.type, PointerType)
            or isinstance(pointer.type, InterfaceType)
            or pointer.type is NULL_TYPE
        ):
            return self.error(node.pos, "type", f"{pointer.type} is not a pointer")
        return load(DerefPlace(pointer, pointer.type.target, self.pos(node.pos)))

    def _call(self, node: ast.Call, expected: Type | None) -> Expr:
        self._deeper(node.pos)
        e = self.followed(self.call(node, expected))
        self._depth -= 1
        return e

    _handlers: ClassVar[dict[type, Callable[[Any, Any, Type | None], Expr]]] = {
        ast.Literal: Literals.literal,
        ast.Name: _name,
        ast.EnumValue: _enum_value,
        ast.DirectAddress: _direct,
        ast.Member: _member,
        ast.BitAccess: _bit,
        ast.Index: _index,
        ast.Deref: _deref,
        ast.Call: _call,
        ast.Unary: Operators.unary,
        ast.Binary: Operators.binary,
    }


def describe(symbol: object) -> str:
    """What a name that is not a variable stands for."""
    if isinstance(symbol, PouSymbol):
        article = {"FUNCTION": "a function", "FUNCTION_BLOCK": "a function block type", "INTERFACE": "an interface"}
        return article.get(symbol.keyword, "a program")
    if isinstance(symbol, MemberSymbol):
        return "a method"
    if isinstance(symbol, Namespace):
        return f"a {symbol.what}"
    return "a type"
