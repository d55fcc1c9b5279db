"""Operators: the type they are calculated in, and folding of constants.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics import arithmetic, constants
from plctool.compiler.semantics.checker import Checker, checks
from plctool.compiler.semantics.conversions import (
    BITS,
    character,
    common_type,
    convert,
    cut,
    elementary,
    error_value,
    is_narrow,
    is_referred,
    is_untyped,
    scaled,
    whole_value,
)
from plctool.compiler.semantics.pitfalls import always, is_next_index, lost_in_constants, negated_number, wrapping
from plctool.compiler.semantics.rules.library_calls import call_by_name
from plctool.compiler.semantics.rules.literals import match_literals, untyped_bits
from plctool.compiler.semantics.symbols import ERROR, NULL_TYPE, UNTYPED_INT, UNTYPED_REAL
from plctool.compiler.semantics.widths import compared, in_32_bits, is_widened, negated_type
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Binary, BinaryOp, Const, Expr, Intrinsic, IntrinsicCall, Unary, UnaryOp
from plctool.compiler.typed.ranges import type_range
from plctool.iec.common_types import NUMBERS, SIGNED, common_number
from plctool.iec.types import (
    BOOL,
    BYTE,
    DT,
    LINT,
    LREAL,
    LTIME,
    TIME,
    TOD,
    ULINT,
    WORD,
    ArrayType,
    Elementary,
    EnumType,
    InterfaceType,
    Kind,
    PointerType,
    StringType,
    StructType,
    Type,
    base_of,
)

_OPERATORS = {operator: BinaryOp[operator.name] for operator in ast.Operator if operator.name in BinaryOp.__members__}
_OF_EXPECTED_TYPE = frozenset(
    (
        ast.Operator.ADD,
        ast.Operator.SUB,
        ast.Operator.MUL,
        ast.Operator.DIV,
        ast.Operator.MOD,
        ast.Operator.AND,
        ast.Operator.OR,
        ast.Operator.XOR,
    )
)
"""Those whose operands have the type of the result."""
_COMPARISONS = {BinaryOp.EQ, BinaryOp.NE, BinaryOp.LT, BinaryOp.LE, BinaryOp.GT, BinaryOp.GE}
_LOGIC = {BinaryOp.AND, BinaryOp.OR, BinaryOp.XOR}
_LAZY = {BinaryOp.AND_THEN, BinaryOp.OR_ELSE}
_UNTYPED = (UNTYPED_INT, UNTYPED_REAL)


@checks(ast.Unary)
def unary_operator(c: Checker, node: ast.Unary, expected: Type | None) -> Expr:
    """`NOT a`, `-a`, `+a`"""
    e = c.expr(node.operand, expected)
    base = elementary(e.type)
    if e.type is ERROR:
        return e
    if node.op is ast.Operator.NOT:
        if base is None or not (base is BOOL or base.kind in NUMBERS):
            return c.error(node.pos, "type", f"NOT needs a BOOL or a bit string, not {e.type}")
        e = untyped_bits(c, e, expected) if is_untyped(e) else convert(e, base)
        return fold_unary(c, UnaryOp.NOT, e, node.pos)
    if base is None or base.kind not in (Kind.INT, Kind.BIT, Kind.REAL, Kind.TIME):
        return c.error(node.pos, "type", f"{node.op} needs a number, not {e.type}")
    if node.op is ast.Operator.ADD:
        return e
    if not base.signed and not is_untyped(e):
        base = _minus_of(base, e)
    if c.dialect.computes_in_32_bits and is_narrow(e.type):
        e = whole_value(e)
        return cut(fold_unary(c, UnaryOp.NEG, convert(e, negated_type(e)), node.pos), base)
    return fold_unary(c, UnaryOp.NEG, convert(e, base), node.pos)


def _minus_of(base: Elementary, e: Expr) -> Elementary:
    """The type of minus an unsigned number. Of 64 bits it wraps, unless it is a constant for which there is one."""
    if base.bits < LINT.bits:
        return SIGNED[base.bits * 2]
    fits = isinstance(e, Const) and isinstance(e.value, int) and e.value <= 1 << (LINT.bits - 1)
    return LINT if fits else base


def fold_unary(c: Checker, op: UnaryOp, e: Expr, offset: int) -> Expr:
    """`op e`, folded when e is constant."""
    pos = c.pos(offset)
    if e.type is ERROR:
        return e
    if isinstance(e, Const):
        fold = constants.negate if op is UnaryOp.NEG else constants.invert
        return Const(fold(e.value, e.type), e.type, pos)
    return Unary(op, e, e.type, pos)


@checks(ast.Binary)
def binary_operator(c: Checker, node: ast.Binary, expected: Type | None) -> Expr:
    """`a op b`"""
    wanted = expected if node.op in _OF_EXPECTED_TYPE else None
    left = c.expr(node.left, wanted)
    if node.op in ast.COMPARISONS and isinstance(left.type, EnumType):
        wanted = left.type  # its values may be written without its name
    right = c.expr(node.right, wanted)
    if node.op is ast.Operator.POWER:
        return _power(c, left, right, node.pos, expected)
    warning = negated_number(node, left, c.scope.source.text)
    if warning:
        c.warning(node.pos, "not", warning)
    result = operate(c, _OPERATORS[node.op], left, right, node.pos, expected)
    lost = lost_in_constants(left, right, result, expected) if node.op is ast.Operator.DIV else ""
    if lost:
        c.warning(node.pos, "integer-division", lost)
    return result


def operate(c: Checker, op: BinaryOp, left: Expr, right: Expr, offset: int, expected: Type | None = None) -> Expr:
    """`left op right` with implicit conversions, folded when both are constant."""
    if left.type is ERROR or right.type is ERROR:
        return error_value(c.pos(offset))
    if arithmetic.is_address(left) or arithmetic.is_address(right):
        moved = arithmetic.moved(op, left, right, c.pos(offset))
        if moved is not None:
            return moved
        left, right = arithmetic.as_number(left), arithmetic.as_number(right)
    if op in _COMPARISONS:
        return _compare(c, op, left, right, offset)
    if op in _LAZY:
        return _build(c, op, c.coerce(left, BOOL), c.coerce(right, BOOL), BOOL, offset)
    left, right = match_literals(c, left, right, expected)
    if op in _LOGIC:
        t = _logic_type(left.type, right.type)
    else:
        duration = _date_arithmetic(c, op, left, right, offset, expected)
        if duration is None:
            duration = _duration_arithmetic(c, op, left, right, offset)
        if duration is not None:
            return duration
        t = _number_type(left.type, right.type)
        if t is not None and op is BinaryOp.MOD and t.kind is Kind.REAL:
            t = None
    texts = isinstance(left.type, StringType) + isinstance(right.type, StringType)
    if t is None and ((texts and op is BinaryOp.AND) or (texts and op is BinaryOp.ADD)):
        sign = "&" if op is BinaryOp.AND else "+"
        return c.error(offset, "type", f"strings are joined by CONCAT(a, b), not by {sign}")
    if t is None:
        return c.error(offset, "type", f"{op.value} cannot combine {left.type} and {right.type}")
    if t in _UNTYPED:
        return _build(c, op, left, right, t, offset)
    if c.dialect.computes_in_32_bits and is_widened(op, left, right, t):
        return cut(_build(c, op, *in_32_bits(op, left, right), offset), t)
    if op in (BinaryOp.DIV, BinaryOp.MOD) and is_narrow(t) and not (op is BinaryOp.MOD and is_next_index(left)):
        _report_wrapping(c, left, right, "divided")
    return _build(c, op, _as_operand(c, left, t), _as_operand(c, right, t), t, offset)


def _report_wrapping(c: Checker, left: Expr, right: Expr, how: str) -> None:
    """Warns of operands that may have wrapped in their type, where other systems have computed them in 32 bits."""
    for e in (left, right):
        what = "" if c.scope.bindings else wrapping(e)
        if what:
            message = f"this {what} wraps in {e.type} before it is {how}; convert an operand to DINT, or use --dialect"
            c.world.diagnostics.warning(e.pos, "wrap", message)


def _as_operand(c: Checker, e: Expr, t: Type) -> Expr:
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
    return c.coerce(e, t)


def _number_type(a: Type, b: Type) -> Elementary | None:
    x, y = elementary(a), elementary(b)
    groups = (Kind.INT, Kind.BIT, Kind.REAL)
    if x is None or y is None or x.kind not in groups or y.kind not in groups:
        return None
    if a in _UNTYPED and b in _UNTYPED:
        return x if x is y else UNTYPED_REAL
    return common_number(x, y)


def _logic_type(a: Type, b: Type) -> Elementary | None:
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
    c: Checker, op: BinaryOp, left: Expr, right: Expr, offset: int, expected: Type | None
) -> Expr | None:
    """Dates: + and - a duration, and the difference of two of a kind. None when neither operand is one."""
    x, y = elementary(left.type), elementary(right.type)
    if x is None or y is None or Kind.DATE not in (x.kind, y.kind):
        return None
    if op is BinaryOp.ADD and x.kind is Kind.TIME:
        left, right, x, y = right, left, y, x
    if op is BinaryOp.SUB and arithmetic.same_meaning(x, y):
        t = common_type(x, y)
        assert isinstance(t, Elementary)
        result = LTIME if t.bits == 64 or expected is LTIME else TIME
        number = SIGNED[result.bits]  # a difference of more than 68 years has no place in 32 bits
        left, right = (convert(c.coerce(e, t), number) for e in (left, right))
        amount = convert(_build(c, op, left, right, number, offset), result)
        factor = arithmetic.UNIT_NS[t] // arithmetic.UNIT_NS[result]
        return amount if factor == 1 else scaled(amount, BinaryOp.MUL, factor)
    if y.kind is Kind.TIME and x.kind is Kind.DATE and op in (BinaryOp.ADD, BinaryOp.SUB):
        if arithmetic.same_meaning(x, TOD):
            return _move_clock(c, op, left, right, x, offset)
        if arithmetic.same_meaning(x, DT):
            return _build(c, op, left, arithmetic.rescale(right, x), x, offset)
    return c.error(offset, "type", f"{op.value} cannot combine {left.type} and {right.type}")


def _move_clock(c: Checker, op: BinaryOp, left: Expr, right: Expr, t: Elementary, offset: int) -> Expr:
    """A time of day plus or minus a duration: it stays within the day."""
    number, day = SIGNED[t.bits], arithmetic.day(t)
    moved = scaled(right, BinaryOp.MOD, arithmetic.day(right.type))
    moved = convert(arithmetic.rescale(moved, LTIME if t.bits == 64 else TIME), number)
    total = _build(c, op, convert(left, number), moved, number, offset)
    return convert(scaled(scaled(total, BinaryOp.ADD, day), BinaryOp.MOD, day), t)


def _duration_arithmetic(c: Checker, op: BinaryOp, left: Expr, right: Expr, offset: int) -> Expr | None:
    """Durations: + and - with durations, * and / with numbers. None when neither operand is one."""
    x, y = elementary(left.type), elementary(right.type)
    if x is None or y is None or Kind.TIME not in (x.kind, y.kind):
        return None
    if x.kind is y.kind and op in (BinaryOp.ADD, BinaryOp.SUB):
        t = x if x is y else LTIME
        return _build(c, op, c.coerce(left, t), c.coerce(right, t), t, offset)
    if y.kind is Kind.TIME and op is BinaryOp.MUL:
        left, right, x, y = right, left, y, x
    if x.kind is Kind.TIME and op in (BinaryOp.MUL, BinaryOp.DIV) and y.kind in (Kind.INT, Kind.BIT, Kind.REAL):
        number = SIGNED[x.bits]
        if y.kind is Kind.REAL:
            product = _build(c, op, convert(convert(left, number), LREAL), c.coerce(right, LREAL), LREAL, offset)
            return convert(convert(product, number), x)
        if y.bits > x.bits or (y.bits == x.bits and not y.signed):
            if op is BinaryOp.DIV:
                quotient = _build(c, op, convert(left, LINT), _divisor(right, y), LINT, offset)
                return convert(quotient, x)
            right = convert(right, number)
        return _build(c, op, left, convert(convert(right, number), x), x, offset)
    return c.error(offset, "type", f"{op.value} cannot combine {left.type} and {right.type}")


def _divisor(e: Expr, t: Elementary) -> Expr:
    """A number of up to 64 bits as LINT. What is larger than all of them gives 0, as the largest one does."""
    most = (1 << 63) - 1  # of LINT
    if t.bits < 64 or t.signed:
        return convert(e, LINT)
    if isinstance(e, Const) and isinstance(e.value, int):
        return Const(min(e.value, most), LINT, e.pos)
    return convert(IntrinsicCall(Intrinsic.MIN, [convert(e, ULINT), Const(most, ULINT, e.pos)], ULINT, e.pos), LINT)


def _duration_hint(left: Expr, right: Expr) -> str:
    """What to write when a duration is compared with a number."""
    bases = elementary(left.type), elementary(right.type)
    if not any(base is not None and base.kind is Kind.TIME for base in bases):
        return ""
    numbers = (e.value for e in (left, right) if isinstance(e, Const) and type(e.value) is int)
    return next((f"; a duration is written T#{number}ms" for number in numbers), "")


def _character_hint(left: Expr, right: Expr) -> str:
    """What to write when a character of a string is compared with a text."""
    for e, other in ((left, right), (right, left)):
        if isinstance(e, Const) and isinstance(e.value, str) and len(e.value) == 1 and other.type in (BYTE, WORD):
            return f"; a character of a string is a number here: write 16#{ord(e.value):02X} for '{e.value}'"
    return ""


def _compare(c: Checker, op: BinaryOp, left: Expr, right: Expr, offset: int) -> Expr:
    left, right = compared(left, right)
    decided = is_untyped(left) is not is_untyped(right) and _report_decided(c, op, left, right, offset)
    left, right = match_literals(c, left, right, None)
    if isinstance(left.type, InterfaceType) and isinstance(right.type, StructType):
        right = c.coerce(right, left.type)
    elif isinstance(right.type, InterfaceType) and isinstance(left.type, StructType):
        left = c.coerce(left, right.type)
    left, right = character(left, right.type) or left, character(right, left.type) or right
    if isinstance(left.type, EnumType) and isinstance(right.type, EnumType) and left.type is not right.type:
        c.warning(offset, "enum", f"{left.type} and {right.type} are compared by the numbers of their values")
        left, right = convert(left, left.type.base), convert(right, right.type.base)
    _report_number(c, left, right, offset)
    if is_untyped(left):
        t: Type | None = left.type if left.type is right.type else UNTYPED_REAL
    else:
        t = common_type(left.type, right.type)
    if isinstance(t, StructType | ArrayType) or (isinstance(t, PointerType) and op not in (BinaryOp.EQ, BinaryOp.NE)):
        t = None
    if t is None:
        hint = ""
        if isinstance(left, Binary) and left.op in _COMPARISONS:
            hint = f"; to compare a value twice, write a {left.op.value} b AND b {op.value} c"
        elif NULL_TYPE in (left.type, right.type) and (is_referred(left) or is_referred(right)):
            hint = "; whether a reference refers to something is __ISVALIDREF(reference)"
        else:
            hint = _duration_hint(left, right) or _character_hint(left, right)
        return c.error(offset, "type", f"{op.value} cannot compare {left.type} with {right.type}{hint}")
    if isinstance(t, StringType):
        return _build(c, op, c.coerce(left, t), c.coerce(right, t), BOOL, offset)
    if t in _UNTYPED:
        return _build(c, op, left, right, BOOL, offset)
    t = base_of(t)
    _report_sign(c, left, right, t, offset)
    if decided:
        return _build(c, op, convert(left, t), convert(right, t), BOOL, offset)
    if is_narrow(t):
        _report_wrapping(c, left, right, "compared")
    return _build(c, op, _as_operand(c, left, t), _as_operand(c, right, t), BOOL, offset)


def _report_sign(c: Checker, left: Expr, right: Expr, t: Type, offset: int) -> None:
    """Warns where bits, or a number without sign, and a number with one are compared in a type that has not all values
    of both."""
    common = elementary(t)
    for e, other in ((left, right), (right, left)):
        signed, unsigned = elementary(e.type), elementary(other.type)
        if common is None or signed is None or unsigned is None or signed.kind is not Kind.INT or not signed.signed:
            continue
        if unsigned.kind is not Kind.BIT and (unsigned.kind is not Kind.INT or unsigned.signed):
            continue
        lost = other if common.kind is Kind.INT and common.signed else e
        if (lost is other and common.bits > unsigned.bits) or (isinstance(lost, Const) and _fits(lost, common)):
            continue
        what = f"large ones of {other.type} count as negative" if lost is other else "negative ones count as large"
        c.warning(offset, "sign", f"{left.type} and {right.type} are compared as {common}: {what}; convert one of them")


def _fits(e: Const, t: Elementary) -> bool:
    limits = type_range(t)
    return isinstance(e.value, int) and limits is not None and limits[0] <= e.value <= limits[1]


def _report_number(c: Checker, left: Expr, right: Expr, offset: int) -> None:
    """Warns of an enumeration that is compared with a number."""
    for e, other in ((left, right), (right, left)):
        number = elementary(other.type)
        if isinstance(e.type, EnumType) and not isinstance(other.type, EnumType) and number is not None:
            c.warning(offset, "enum", f"{e.type} is compared with {other.type} by the numbers of its values")


def _report_decided(c: Checker, op: BinaryOp, left: Expr, right: Expr, offset: int) -> bool:
    """Warns of a comparison with a literal that is always TRUE or FALSE. A generic function may be for other types."""
    literal, value = (left, right) if is_untyped(left) else (right, left)
    if isinstance(literal, Const) and isinstance(literal.value, int) and not c.scope.bindings:
        message = always(op, value, literal.value, swapped=literal is left)
        if message:
            c.warning(offset, "always", message)
            return True
    return False


def _build(c: Checker, op: BinaryOp, left: Expr, right: Expr, t: Type, offset: int) -> Expr:
    pos = c.pos(offset)
    if left.type is ERROR or right.type is ERROR:
        return error_value(pos)
    if isinstance(right, Const) and op in (BinaryOp.DIV, BinaryOp.MOD) and right.value == 0:
        return c.error(offset, "division-by-zero", "division by zero")
    if isinstance(left, Const) and isinstance(right, Const):
        try:
            return Const(constants.binary(op, left.value, right.value, t), t, pos)
        except constants.ConstantError as error:
            return c.error(offset, "constant", str(error))
    return Binary(op, left, right, t, pos)


def _power(c: Checker, base: Expr, exponent: Expr, offset: int, expected: Type | None) -> Expr:
    """`base ** exponent`: folded, or a call of EXPT."""
    if base.type is ERROR or exponent.type is ERROR:
        return error_value(c.pos(offset))
    if (
        isinstance(base, Const)
        and isinstance(exponent, Const)
        and not isinstance(base.value, str)
        and not isinstance(exponent.value, str)
    ):
        try:
            value = constants.power(base.value, exponent.value)
        except constants.ConstantError as error:
            return c.error(offset, "constant", str(error))
        t = UNTYPED_INT if isinstance(value, int) else UNTYPED_REAL
        return Const(value, t, c.pos(offset))
    return call_by_name(c, "EXPT", [base, exponent], offset, expected)
