"""Expressions: names become places, operators get their types, constants are folded.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from plctool.compiler import ast, constants, dates
from plctool.compiler.conversions import (
    BITS,
    NS_PER_MS,
    NUMBERS,
    SIGNED,
    character,
    common_number,
    common_type,
    convert,
    elementary,
    error_value,
    literal_type,
    scaled,
    settle,
)  # fmt: skip
from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.scope import Scope
from plctool.compiler.symbols import (
    ERROR,
    NULL_TYPE,
    UNTYPED_INT,
    UNTYPED_REAL,
    GlobalSymbol,
    MemberSymbol,
    Namespace,
    PouSymbol,
    Role,
    TypeSymbol,
    VarSymbol,
)  # fmt: skip
from plctool.compiler.typed import (
    AddressOf,
    Binary,
    BinaryOp,
    BitPlace,
    Const,
    DerefPlace,
    Expr,
    IndexPlace,
    Load,
    MemberPlace,
    Place,
    Pos,
    SelfPlace,
    Storage,
    Unary,
    UnaryOp,
    ValuePlace,
    VarPlace,
)  # fmt: skip
from plctool.compiler.types import (
    BOOL,
    BYTE,
    DINT,
    DT,
    DWORD,
    ELEMENTARY,
    LREAL,
    LTIME,
    LWORD,
    REAL,
    TIME,
    TOD,
    WORD,
    ArrayType,
    Elementary,
    EnumType,
    InterfaceType,
    Kind,
    PointerType,
    ReferenceType,
    StringType,
    StructType,
    Type,
    base_of,
)  # fmt: skip

MAX_DEPTH = 400  # levels of nesting in one expression or of statements; the lowering recurses over them too

_OPERATORS = {op.value: op for op in BinaryOp}
_COMPARISONS = {BinaryOp.EQ, BinaryOp.NE, BinaryOp.LT, BinaryOp.LE, BinaryOp.GT, BinaryOp.GE}
_LOGIC = {BinaryOp.AND, BinaryOp.OR, BinaryOp.XOR}
_LAZY = {BinaryOp.AND_THEN, BinaryOp.OR_ELSE}
_PARTS = {"B": BYTE, "W": WORD, "D": DWORD, "L": LWORD}
_UNTYPED = (UNTYPED_INT, UNTYPED_REAL)


def is_untyped(e: Expr) -> bool:
    """Whether the expression is a constant that takes the type its surroundings need."""
    return e.type is UNTYPED_INT or e.type is UNTYPED_REAL


def place_of(e: Expr) -> Place:
    """The place a value was loaded from, or a temporary one."""
    return e.place if isinstance(e, Load) else ValuePlace(e, e.type, e.pos)


def is_temporary(place: Place) -> bool:
    """Whether a place is (part of) a value that nobody else sees."""
    while not isinstance(place, VarPlace | DerefPlace | ValuePlace | SelfPlace):
        place = place.base
    return isinstance(place, ValuePlace)


class Expressions:
    """Checks the expressions of one scope."""

    def __init__(self, scope: Scope) -> None:
        self.scope = scope
        self.world = scope.world
        self.coerce = scope.world.coerce
        self.pos: Callable[[int], Pos] = scope.source.pos
        self._depth = 0

    # ---- entry points ----

    def expr(self, node: ast.Expr, expected: Type | None = None) -> Expr:
        """The typed expression; `expected` is the type the surroundings would like. Untyped constants stay untyped."""
        return self._handlers[type(node)](self, node, expected)

    def value(self, node: ast.Expr, target: Type) -> Expr:
        """The expression as a value of `target`."""
        return self.coerce(self.expr(node, target), target)

    def settled(self, node: ast.Expr) -> Expr:
        """The expression with the type it has by itself."""
        return settle(self.expr(node))

    def condition(self, node: ast.Expr) -> Expr:
        """The expression as a BOOL."""
        e = self.expr(node, BOOL)
        if e.type is BOOL:
            return e
        return self.coerce(e, BOOL)

    def constant(self, node: ast.Expr, expected: Type | None = None) -> Const | None:
        """The value of a constant expression; anything else is reported."""
        e = self.expr(node, expected)
        if e.type is ERROR:
            return None
        if isinstance(e, Const):
            return e
        self.error(node.pos, "constant", "a constant is needed here")
        return None

    def integer(self, node: ast.Expr) -> int | None:
        """The value of a constant integer expression."""
        e = self.constant(node)
        if e is None:
            return None
        base = elementary(e.type)
        if isinstance(e.value, int) and base is not None and base.kind in NUMBERS:
            return e.value
        self.error(node.pos, "type", "an integer constant is needed here")
        return None

    def place(self, node: ast.Expr, use: str) -> Place | None:
        """The variable (or part of one) an expression names; `use` says what for."""
        e = self.expr(node)
        if e.type is ERROR:
            return None
        if isinstance(e, Load) and not is_temporary(e.place):
            return e.place
        self.error(node.pos, "place", f"{use} needs a variable")
        return None

    def error(self, offset: int, code: str, message: str) -> Expr:
        """Reports an error; the value that stands for the expression."""
        self.scope.error(offset, code, message)
        return error_value(self.pos(offset))

    # ---- literals and names ----

    def _literal(self, node: ast.Literal, expected: Type | None) -> Expr:
        pos, value, kind = self.pos(node.pos), node.value, node.kind
        if kind is ast.LiteralKind.INT and node.type_name is None:
            assert isinstance(value, int)
            if literal_type(value) is None:
                return self.error(node.pos, "range", f"{value} fits no integer type")
            return Const(value, UNTYPED_INT, pos)
        if kind is ast.LiteralKind.REAL and node.type_name is None:
            return Const(value, UNTYPED_REAL, pos)
        if kind is ast.LiteralKind.BOOL:
            return Const(value, BOOL, pos)
        if kind in (ast.LiteralKind.STRING, ast.LiteralKind.WSTRING):
            return self._text(node, pos)
        if kind is ast.LiteralKind.TIME:
            return self._duration(node, pos)
        if kind is ast.LiteralKind.DATE:
            return self._date(node, pos)
        if kind is ast.LiteralKind.NULL:
            return Const(0, NULL_TYPE, pos)
        if kind is ast.LiteralKind.BAD:
            return error_value(pos)
        return self._typed_literal(node, pos)

    def _text(self, node: ast.Literal, pos: Pos) -> Expr:
        assert isinstance(node.value, str)
        text = Const(node.value, StringType(len(node.value), node.kind is ast.LiteralKind.WSTRING), pos)
        if node.type_name not in ("CHAR", "WCHAR"):
            return text
        single = character(text, ELEMENTARY[node.type_name])
        return single or self.error(node.pos, "literal", f"a {node.type_name} is one character, not {len(node.value)}")

    def _date(self, node: ast.Literal, pos: Pos) -> Expr:
        assert isinstance(node.value, int) and node.type_name is not None
        target = ELEMENTARY[node.type_name]
        value, rest = divmod(node.value, dates.UNIT_NS[target])
        if rest:
            smallest = "milliseconds" if target is TOD else "seconds"
            self.scope.warning(node.pos, "precision", f"{target} counts {smallest}; write L{target}#... for less")
        if not constants.fits(value, target):
            last = "2106-02-07" if target.bits == 32 else "2554-07-21"
            return self.error(node.pos, "range", f"this is too late for {target}, which ends on {last}")
        return Const(value, target, pos)

    def _duration(self, node: ast.Literal, pos: Pos) -> Expr:
        assert isinstance(node.value, int)
        target, value = LTIME, node.value
        if node.type_name == "TIME":
            target, value = TIME, constants.divide(value, NS_PER_MS)
            if value * NS_PER_MS != node.value:
                self.scope.warning(node.pos, "precision", "TIME counts milliseconds; write LTIME#... for less")
        if not constants.fits(value, target):
            return self.error(node.pos, "range", f"this duration is too long for {target}")
        return Const(value, target, pos)

    def _typed_literal(self, node: ast.Literal, pos: Pos) -> Expr:
        assert node.type_name is not None
        target: Type | None = ELEMENTARY.get(node.type_name)
        if target is None:
            target = self.world.declarations.named_type(node.pos, node.type_name, self.scope)
        untyped = UNTYPED_INT if node.kind is ast.LiteralKind.INT else UNTYPED_REAL
        return self.coerce(Const(node.value, untyped, pos), target)

    def _name(self, node: ast.Name, expected: Type | None) -> Expr:
        symbol = self.scope.lookup(node.name)
        if isinstance(symbol, GlobalSymbol):
            choices = self.world.same_named(node.name)
            if choices:
                listed = " or ".join(s.full_name for s in choices)
                return self.error(node.pos, "ambiguous", f"{node.name} is in several lists; write {listed}")
            symbol = self.world.declarations.global_variable(symbol)
        if isinstance(symbol, VarSymbol):
            return self.variable(symbol, self.pos(node.pos))
        own = self.own_name(node, symbol)
        if own is not None:
            return own
        if symbol is None:
            value = self.world.enum_value(node.name, self.scope, node.pos, expected)
            if value is not None:
                return value
            return self._unknown(node)
        return self.error(node.pos, "name", f"{node.name} is {describe(symbol)}, not a value")

    def _unknown(self, node: ast.Name) -> Expr:
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
        symbol = self.world.declarations.direct_variable(node, self.scope)
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
        if symbol.access and not self.may_see(symbol, base.type, node):
            return error_value(self.pos(node.pos))
        if symbol.role is Role.IN_OUT:
            return self.error(node.name_pos, "access", f"{symbol.name} is a VAR_IN_OUT; it can only be given in a call")
        variable = symbol.variable
        if variable is None or variable.storage is Storage.AREA:  # a constant, VAR_STAT, VAR_EXTERNAL
            return self.variable(symbol, self.pos(node.pos))
        return load(MemberPlace(place_of(base), variable.offset, symbol.type, self.pos(node.pos)))

    def _bit(self, node: ast.BitAccess, expected: Type | None) -> Expr:
        base = self.expr(node.base)
        t = elementary(base.type)
        if base.type is ERROR:
            return base
        if t is None or t.kind not in NUMBERS or is_untyped(base):
            return self.error(node.index_pos, "type", f"{base.type} has no bits")
        if node.width != "X":
            return self._part(base, t, node)
        if node.index >= t.bits:
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
            if isinstance(e, Const) and isinstance(e.value, int) and e.type is not ERROR and not low <= e.value <= high:
                return self.error(node.pos, "range", f"the index {e.value} is outside {low}..{high}")
        if any(e.type is ERROR for e in values):
            return error_value(self.pos(offset))
        return load(IndexPlace(place_of(base), values, t.element, self.pos(offset)))

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

    # ---- operators ----

    def _unary(self, node: ast.Unary, expected: Type | None) -> Expr:
        self._deeper(node.pos)
        e = self.expr(node.operand, expected)
        self._depth -= 1
        base = elementary(e.type)
        if e.type is ERROR:
            return e
        if node.op == "NOT":
            if base is None or not (base is BOOL or base.kind in NUMBERS):
                return self.error(node.pos, "type", f"NOT needs a BOOL or a bit string, not {e.type}")
            e = self._untyped_bits(e, expected) if is_untyped(e) else convert(e, base)
            return self._fold_unary(UnaryOp.NOT, e, node.pos)
        if base is None or base.kind not in (Kind.INT, Kind.BIT, Kind.REAL, Kind.TIME):
            return self.error(node.pos, "type", f"{node.op} needs a number, not {e.type}")
        if node.op == "+":
            return e
        if not base.signed and base.bits < 64 and not isinstance(e, Const):
            base = SIGNED[base.bits * 2]
        return self._fold_unary(UnaryOp.NEG, convert(e, base), node.pos)

    def _untyped_bits(self, e: Expr, expected: Type | None) -> Expr:
        base = elementary(expected) if expected is not None else None
        if base is not None and (base.kind in NUMBERS or base is BOOL):
            return self.coerce(e, base)
        return settle(e)

    def _fold_unary(self, op: UnaryOp, e: Expr, offset: int) -> Expr:
        pos = self.pos(offset)
        if e.type is ERROR:
            return e
        if isinstance(e, Const):
            fold = constants.negate if op is UnaryOp.NEG else constants.invert
            return Const(fold(e.value, e.type), e.type, pos)
        return Unary(op, e, e.type, pos)

    def _binary(self, node: ast.Binary, expected: Type | None) -> Expr:
        self._deeper(node.pos)
        arithmetic = node.op in ("+", "-", "*", "/", "MOD", "AND", "OR", "XOR")
        wanted = expected if arithmetic else None
        left = self.expr(node.left, wanted)
        right = self.expr(node.right, wanted)
        self._depth -= 1
        if node.op == "**":
            return self.power(left, right, node.pos, expected)
        return self.operate(_OPERATORS[node.op], left, right, node.pos, expected)

    def _deeper(self, offset: int) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise NestingError(self.pos(offset))

    def operate(self, op: BinaryOp, left: Expr, right: Expr, offset: int, expected: Type | None = None) -> Expr:
        """`left op right` with implicit conversions, folded when both are constant."""
        if left.type is ERROR or right.type is ERROR:
            return error_value(self.pos(offset))
        if op in _COMPARISONS:
            return self._compare(op, left, right, offset)
        if op in _LAZY:
            return self._build(op, self.coerce(left, BOOL), self.coerce(right, BOOL), BOOL, offset)
        left, right = self._match_literals(left, right, expected)
        if op in _LOGIC:
            t = self._logic_type(left.type, right.type)
        else:
            duration = self._date_arithmetic(op, left, right, offset, expected)
            if duration is None:
                duration = self._duration_arithmetic(op, left, right, offset)
            if duration is not None:
                return duration
            t = self._number_type(left.type, right.type)
            if t is not None and op is BinaryOp.MOD and t.kind is Kind.REAL:
                t = None
        if t is None:
            return self.error(offset, "type", f"{op.value} cannot combine {left.type} and {right.type}")
        if t in _UNTYPED:
            return self._build(op, left, right, t, offset)
        return self._build(op, self._as_operand(left, t), self._as_operand(right, t), t, offset)

    def _as_operand(self, e: Expr, t: Type) -> Expr:
        """The operand in the common type. Half of an integer type's values may change sign: that is how dialects mix
        them."""
        source = elementary(e.type)
        if (
            isinstance(t, Elementary)
            and source is not None
            and source.kind in NUMBERS
            and t.kind in NUMBERS
            and source.bits == t.bits
        ):
            return convert(e, t)
        return self.coerce(e, t)

    def _match_literals(self, left: Expr, right: Expr, expected: Type | None) -> tuple[Expr, Expr]:
        """Gives an untyped constant the type of the other operand when it fits there."""
        if is_untyped(left) and not is_untyped(right):
            return self._literal_for(left, right.type, expected), right
        if is_untyped(right) and not is_untyped(left):
            return left, self._literal_for(right, left.type, expected)
        return left, right

    def _literal_for(self, e: Expr, other: Type, expected: Type | None) -> Expr:
        t = elementary(other)
        assert isinstance(e, Const) and not isinstance(e.value, str)
        if isinstance(other, PointerType) and e.value == 0:
            return Const(0, other, e.pos)
        if t is None or t.kind is Kind.TIME:
            return settle(e)
        if t.kind is Kind.REAL:
            return self.coerce(e, t)
        if isinstance(e.value, float):
            if expected is REAL or expected is LREAL:
                return self.coerce(e, expected)
            return self.coerce(e, REAL if t.bits <= 16 else LREAL)
        if constants.fits(e.value, t):
            return Const(e.value, t, e.pos)
        if t.kind is Kind.BIT and e.value >= 0:
            return self.coerce(e, constants.smallest(e.value, tuple(BITS.values())) or t)
        return settle(e)

    def _number_type(self, a: Type, b: Type) -> Elementary | None:
        x, y = elementary(a), elementary(b)
        groups = (Kind.INT, Kind.BIT, Kind.REAL)
        if x is None or y is None or x.kind not in groups or y.kind not in groups:
            return None
        if a in _UNTYPED and b in _UNTYPED:
            return x if x is y else UNTYPED_REAL
        return common_number(x, y)

    def _logic_type(self, a: Type, b: Type) -> Elementary | None:
        x, y = elementary(a), elementary(b)
        if x is None or y is None:
            return None
        if x is BOOL and y is BOOL:
            return BOOL
        if x.kind in NUMBERS and y.kind in NUMBERS:
            if Kind.BIT in (x.kind, y.kind) and x.kind is not y.kind:
                return BITS[max(x.bits, y.bits)]
            return common_number(x, y)
        return None

    def _date_arithmetic(
        self, op: BinaryOp, left: Expr, right: Expr, offset: int, expected: Type | None
    ) -> Expr | None:
        """Dates: + and - a duration, and the difference of two of a kind. None when neither operand is one."""
        x, y = elementary(left.type), elementary(right.type)
        if x is None or y is None or Kind.DATE not in (x.kind, y.kind):
            return None
        if op is BinaryOp.ADD and x.kind is Kind.TIME:
            left, right, x, y = right, left, y, x
        if op is BinaryOp.SUB and dates.same_meaning(x, y):
            t = common_type(x, y)
            assert isinstance(t, Elementary)
            difference = self._build(op, self.coerce(left, t), self.coerce(right, t), t, offset)
            result = LTIME if t.bits == 64 or expected is LTIME else TIME
            amount = convert(convert(difference, SIGNED[t.bits]), result)
            factor = dates.UNIT_NS[t] // dates.UNIT_NS[result]
            return amount if factor == 1 else scaled(amount, BinaryOp.MUL, factor)
        if y.kind is Kind.TIME and x.kind is Kind.DATE and op in (BinaryOp.ADD, BinaryOp.SUB):
            if dates.same_meaning(x, TOD):
                return self._move_clock(op, left, right, x, offset)
            if dates.same_meaning(x, DT):
                return self._build(op, left, dates.rescale(right, x), x, offset)
        return self.error(offset, "type", f"{op.value} cannot combine {left.type} and {right.type}")

    def _move_clock(self, op: BinaryOp, left: Expr, right: Expr, t: Elementary, offset: int) -> Expr:
        """A time of day plus or minus a duration: it stays within the day."""
        number, day = SIGNED[t.bits], dates.day(t)
        moved = scaled(right, BinaryOp.MOD, dates.day(right.type))
        moved = convert(dates.rescale(moved, LTIME if t.bits == 64 else TIME), number)
        total = self._build(op, convert(left, number), moved, number, offset)
        return convert(scaled(scaled(total, BinaryOp.ADD, day), BinaryOp.MOD, day), t)

    def _duration_arithmetic(self, op: BinaryOp, left: Expr, right: Expr, offset: int) -> Expr | None:
        """Durations: + and - with durations, * and / with numbers. None when neither operand is one."""
        x, y = elementary(left.type), elementary(right.type)
        if x is None or y is None or Kind.TIME not in (x.kind, y.kind):
            return None
        if x.kind is y.kind and op in (BinaryOp.ADD, BinaryOp.SUB):
            t = x if x is y else LTIME
            return self._build(op, self.coerce(left, t), self.coerce(right, t), t, offset)
        if y.kind is Kind.TIME and op is BinaryOp.MUL:
            left, right, x, y = right, left, y, x
        if x.kind is Kind.TIME and op in (BinaryOp.MUL, BinaryOp.DIV) and y.kind in (Kind.INT, Kind.BIT, Kind.REAL):
            number = SIGNED[x.bits]
            if y.kind is Kind.REAL:
                product = self._build(
                    op, convert(convert(left, number), LREAL), self.coerce(right, LREAL), LREAL, offset
                )
                return convert(convert(product, number), x)
            if y.bits > x.bits or (y.bits == x.bits and not y.signed):
                right = convert(right, number)
            return self._build(op, left, convert(convert(right, number), x), x, offset)
        return self.error(offset, "type", f"{op.value} cannot combine {left.type} and {right.type}")

    def _compare(self, op: BinaryOp, left: Expr, right: Expr, offset: int) -> Expr:
        left, right = self._match_literals(left, right, None)
        if isinstance(left.type, InterfaceType) and isinstance(right.type, StructType):
            right = self.coerce(right, left.type)
        elif isinstance(right.type, InterfaceType) and isinstance(left.type, StructType):
            left = self.coerce(left, right.type)
        left, right = character(left, right.type) or left, character(right, left.type) or right
        if is_untyped(left):
            t: Type | None = left.type if left.type is right.type else UNTYPED_REAL
        else:
            t = common_type(left.type, right.type)
        if isinstance(t, StructType | ArrayType) or (
            isinstance(t, PointerType) and op not in (BinaryOp.EQ, BinaryOp.NE)
        ):
            t = None
        if t is None:
            return self.error(offset, "type", f"{op.value} cannot compare {left.type} with {right.type}")
        if isinstance(t, StringType) or t in _UNTYPED:
            return self._build(op, left, right, BOOL, offset)
        t = base_of(t)
        return self._build(op, self._as_operand(left, t), self._as_operand(right, t), BOOL, offset)

    def _build(self, op: BinaryOp, left: Expr, right: Expr, t: Type, offset: int) -> Expr:
        pos = self.pos(offset)
        if left.type is ERROR or right.type is ERROR:
            return error_value(pos)
        if isinstance(right, Const) and op in (BinaryOp.DIV, BinaryOp.MOD) and right.value == 0:
            return self.error(offset, "division-by-zero", "division by zero")
        if isinstance(left, Const) and isinstance(right, Const):
            try:
                return Const(constants.binary(op, left.value, right.value, t), t, pos)
            except constants.ConstantError as error:
                return self.error(offset, "constant", str(error))
        return Binary(op, left, right, t, pos)

    def power(self, base: Expr, exponent: Expr, offset: int, expected: Type | None) -> Expr:
        """`base ** exponent`: folded, or a call of EXPT."""
        if base.type is ERROR or exponent.type is ERROR:
            return error_value(self.pos(offset))
        if (
            isinstance(base, Const)
            and isinstance(exponent, Const)
            and not isinstance(base.value, str)
            and not isinstance(exponent.value, str)
        ):
            try:
                value = constants.power(base.value, exponent.value)
            except constants.ConstantError as error:
                return self.error(offset, "constant", str(error))
            t = UNTYPED_INT if isinstance(value, int) else UNTYPED_REAL
            return Const(value, t, self.pos(offset))
        return self.call_by_name("EXPT", [base, exponent], offset, expected)

    # ---- what the classes built on this one provide ----

    def call_by_name(self, name: str, args: list[Expr], offset: int, expected: Type | None) -> Expr:
        """A call of a library function with checked arguments."""
        raise NotImplementedError

    def call(self, node: ast.Call, expected: Type | None) -> Expr:
        """A call as a value."""
        raise NotImplementedError

    def input(self, node: ast.Expr, t: Type, name: str) -> Expr:
        """The value of an input."""
        raise NotImplementedError

    def own_name(self, node: ast.Name, symbol: object) -> Expr | None:
        """THIS, SUPER or a property by its bare name."""
        raise NotImplementedError

    def member_of(self, base: Expr, node: ast.Member) -> Expr | None:
        """A property of an instance."""
        raise NotImplementedError

    def qualified(self, node: ast.Member) -> Expr | None:
        """What is in a namespace."""
        raise NotImplementedError

    def followed(self, e: Expr) -> Expr:
        """The result of a call, or what it refers to."""
        raise NotImplementedError

    def may_see(self, symbol: VarSymbol, t: Type, node: ast.Member) -> bool:
        """Whether a variable that is not PUBLIC may be used here; reports it when not."""
        raise NotImplementedError

    def _call(self, node: ast.Call, expected: Type | None) -> Expr:
        self._deeper(node.pos)
        e = self.followed(self.call(node, expected))
        self._depth -= 1
        return e

    _handlers: ClassVar[dict[type, Callable[[Any, Any, Type | None], Expr]]] = {
        ast.Literal: _literal,
        ast.Name: _name,
        ast.EnumValue: _enum_value,
        ast.DirectAddress: _direct,
        ast.Member: _member,
        ast.BitAccess: _bit,
        ast.Index: _index,
        ast.Deref: _deref,
        ast.Call: _call,
        ast.Unary: _unary,
        ast.Binary: _binary,
    }


class NestingError(Exception):
    """Something at `pos` is nested too deeply."""

    def __init__(self, pos: Pos) -> None:
        super().__init__(pos)
        self.pos = pos


def load(place: Place) -> Load:
    """The value of a place; of a reference, the value it refers to."""
    if isinstance(place.type, ReferenceType):
        place = DerefPlace(Load(place, place.type, place.pos), place.type.target, place.pos)
    return Load(place, place.type, place.pos)


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
