"""Operators: the type they are calculated in, and folding of constants.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics import constants, dates, pointers
from plctool.compiler.semantics.checker import Checker, is_untyped
from plctool.compiler.semantics.conversions import (
    BITS,
    NUMBERS,
    SIGNED,
    character,
    common_number,
    common_type,
    convert,
    elementary,
    error_value,
    scaled,
    settle,
)  # fmt: skip
from plctool.compiler.semantics.symbols import (
    ERROR,
    UNTYPED_INT,
    UNTYPED_REAL,
)  # fmt: skip
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    Binary,
    BinaryOp,
    Const,
    Expr,
    Unary,
    UnaryOp,
)  # fmt: skip
from plctool.compiler.types import (
    BOOL,
    DT,
    LREAL,
    LTIME,
    REAL,
    TIME,
    TOD,
    ArrayType,
    Elementary,
    InterfaceType,
    Kind,
    PointerType,
    StringType,
    StructType,
    Type,
    base_of,
)  # fmt: skip

_OPERATORS = {op.value: op for op in BinaryOp}
_COMPARISONS = {BinaryOp.EQ, BinaryOp.NE, BinaryOp.LT, BinaryOp.LE, BinaryOp.GT, BinaryOp.GE}
_LOGIC = {BinaryOp.AND, BinaryOp.OR, BinaryOp.XOR}
_LAZY = {BinaryOp.AND_THEN, BinaryOp.OR_ELSE}
_UNTYPED = (UNTYPED_INT, UNTYPED_REAL)


class Operators(Checker):
    """Checks unary and binary operators."""

    def unary(self, node: ast.Unary, expected: Type | None) -> Expr:
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

    def binary(self, node: ast.Binary, expected: Type | None) -> Expr:
        self._deeper(node.pos)
        arithmetic = node.op in ("+", "-", "*", "/", "MOD", "AND", "OR", "XOR")
        wanted = expected if arithmetic else None
        left = self.expr(node.left, wanted)
        right = self.expr(node.right, wanted)
        self._depth -= 1
        if node.op == "**":
            return self.power(left, right, node.pos, expected)
        return self.operate(_OPERATORS[node.op], left, right, node.pos, expected)

    def operate(self, op: BinaryOp, left: Expr, right: Expr, offset: int, expected: Type | None = None) -> Expr:
        """`left op right` with implicit conversions, folded when both are constant."""
        if left.type is ERROR or right.type is ERROR:
            return error_value(self.pos(offset))
        if pointers.is_address(left) or pointers.is_address(right):
            moved = pointers.moved(op, left, right, self.pos(offset))
            if moved is not None:
                return moved
            left, right = pointers.as_number(left), pointers.as_number(right)
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
        if isinstance(t, StringType):
            return self._build(op, self.coerce(left, t), self.coerce(right, t), BOOL, offset)
        if t in _UNTYPED:
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
