"""Calculating with constants, with the same results the compiled code would have.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from fractions import Fraction
from typing import Any

from plctool.compiler.semantics.symbols import UNTYPED_INT
from plctool.compiler.typed.nodes import BinaryOp, Intrinsic, Rounding
from plctool.iec.types import BOOL, REAL, Elementary, EnumType, Kind, PointerType, SubrangeType, Type, base_of

Value = int | float | str

_LARGEST = 1 << 64  # no integer type holds more
_REAL_BITS = 24  # digits of a REAL


class ConstantError(Exception):
    """The calculation has no result; the message says why in one sentence."""


def limits(t: Elementary) -> tuple[int, int]:
    """Least and greatest value of an integer, bit string, BOOL or duration type."""
    if t is BOOL:
        return 0, 1
    if t.signed:
        return -(1 << (t.bits - 1)), (1 << (t.bits - 1)) - 1
    return 0, (1 << t.bits) - 1


def wrap(value: int, t: Elementary) -> int:
    """The value modulo the width of the type."""
    value &= (1 << t.bits) - 1
    return value - (1 << t.bits) if t.signed and value >> (t.bits - 1) else value


def rounded(value: int | float, t: Type) -> float:
    """To the precision of REAL or LREAL."""
    if t is not REAL:
        return float(value)
    if isinstance(value, int):  # not to that of LREAL first: it may be halfway between two REALs then
        step = 1 << max(0, value.bit_length() - _REAL_BITS)
        value = float(round(Fraction(value, step)) * step)
    try:
        return float(struct.unpack("<f", struct.pack("<f", value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


def convert(value: Value, source: Type, target: Type, *, rounding: Rounding = Rounding.EVEN) -> Value:
    """As typed.Convert does it."""
    to = base_of(target)
    if isinstance(to, PointerType):
        return value
    assert isinstance(to, Elementary) and not isinstance(value, str)
    if to is BOOL:
        return int(value != 0)
    if to.kind is Kind.REAL:
        return rounded(value, to)
    if isinstance(value, float):
        return _to_integer(value, to, rounding)
    return wrap(value, to)


def _to_integer(value: float, to: Elementary, rounding: Rounding) -> int:
    low, high = limits(to)
    if rounding is Rounding.AWAY:
        return _away_from_zero(value) if abs(value) < -low else low
    if math.isnan(value):
        return 0
    if math.isinf(value):
        return high if value > 0 else low
    whole = math.trunc(value) if rounding is Rounding.ZERO else round(value)
    return max(low, min(high, whole))


def _away_from_zero(value: float) -> int:
    whole = math.trunc(value)
    rest = value - whole
    return whole + (rest >= 0.5) - (rest <= -0.5)


def binary(op: BinaryOp, left: Value, right: Value, t: Type) -> Value:
    """`left op right`, both of type `t`; comparisons give 0 or 1. Raises ConstantError."""
    compare = _COMPARE.get(op)
    if compare is not None:
        return int(compare(left, right))
    base = base_of(t)
    assert isinstance(base, Elementary) and not isinstance(left, str) and not isinstance(right, str)
    if base.kind is Kind.REAL:
        return _real(op, float(left), float(right), base)
    assert isinstance(left, int) and isinstance(right, int)
    value = _integer(op, left, right)
    if base is UNTYPED_INT:
        if abs(value) > _LARGEST:
            raise ConstantError("the result of this calculation fits no integer type")
        return value
    return wrap(value, base)


_COMPARE: dict[BinaryOp, Callable[[Any, Any], bool]] = {
    BinaryOp.EQ: lambda a, b: a == b,
    BinaryOp.NE: lambda a, b: a != b,
    BinaryOp.LT: lambda a, b: a < b,
    BinaryOp.LE: lambda a, b: a <= b,
    BinaryOp.GT: lambda a, b: a > b,
    BinaryOp.GE: lambda a, b: a >= b,
}


def divide(a: int, b: int) -> int:
    """Integer division towards zero; `b` is not 0."""
    return abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)


def _integer(op: BinaryOp, a: int, b: int) -> int:
    if op in (BinaryOp.DIV, BinaryOp.MOD):
        if b == 0:
            raise ConstantError("division by zero")
        quotient = divide(a, b)
        return quotient if op is BinaryOp.DIV else a - b * quotient
    if op is BinaryOp.ADD:
        return a + b
    if op is BinaryOp.SUB:
        return a - b
    if op is BinaryOp.MUL:
        return a * b
    if op in (BinaryOp.AND, BinaryOp.AND_THEN):
        return a & b
    if op in (BinaryOp.OR, BinaryOp.OR_ELSE):
        return a | b
    return a ^ b


def _real(op: BinaryOp, a: float, b: float, t: Elementary) -> float:
    try:
        if op is BinaryOp.ADD:
            value = a + b
        elif op is BinaryOp.SUB:
            value = a - b
        elif op is BinaryOp.MUL:
            value = a * b
        else:
            value = a / b
    except ZeroDivisionError:
        raise ConstantError("division by zero") from None
    return rounded(value, t)


def negate(value: Value, t: Type) -> Value:
    """`-value`"""
    base = base_of(t)
    assert isinstance(base, Elementary) and not isinstance(value, str)
    if isinstance(value, float):
        return -value
    return -value if base is UNTYPED_INT else wrap(-value, base)


def invert(value: Value, t: Type) -> Value:
    """`NOT value`"""
    base = base_of(t)
    assert isinstance(base, Elementary) and isinstance(value, int)
    if base is BOOL:
        return 1 - value
    return ~value if base is UNTYPED_INT else wrap(~value, base)


def power(base: Value, exponent: Value) -> Value:
    """`base ** exponent`: an integer for integers and a non-negative exponent, else a float. Raises ConstantError."""
    assert not isinstance(base, str) and not isinstance(exponent, str)
    if isinstance(base, int) and isinstance(exponent, int) and exponent >= 0:
        if abs(base) > 1 and exponent > 64:
            raise ConstantError("the result of this calculation fits no integer type")
        result: int = base**exponent
        if abs(result) > _LARGEST:
            raise ConstantError("the result of this calculation fits no integer type")
        return result
    try:
        value = math.pow(base, exponent)
    except (OverflowError, ValueError):
        raise ConstantError("this power has no value in LREAL") from None
    return value


def intrinsic(op: Intrinsic, values: list[Value], t: Type) -> Value | None:
    """The value of an intrinsic of constants; None when it is left to run time."""
    base = base_of(t)
    if op is Intrinsic.SELECT:
        return values[2] if values[0] else values[1]
    if op is Intrinsic.MUX:
        assert isinstance(values[0], int)
        others = len(values) - 2
        return values[1 + (values[0] if 0 <= values[0] < others else others)]
    numbers = [v for v in values if not isinstance(v, str)]
    if not isinstance(base, Elementary) or len(numbers) < len(values):
        return None
    if op is Intrinsic.ABS:
        value = abs(numbers[0])
        return value if isinstance(value, float) or base.type_class < 0 else wrap(value, base)
    if op is Intrinsic.SQRT:
        return rounded(math.sqrt(numbers[0]), base) if numbers[0] >= 0 else None
    if op in (Intrinsic.MIN, Intrinsic.MAX):
        left, right = numbers  # of two zeros, or with NaN, the right one, as at run time
        return left if (left < right if op is Intrinsic.MIN else left > right) else right
    value, count = numbers
    assert isinstance(value, int) and isinstance(count, int)
    return _shifted(op, value, count, base)


def _shifted(op: Intrinsic, value: int, count: int, t: Elementary) -> int:
    bits, pattern = t.bits, value & ((1 << t.bits) - 1)
    if op in (Intrinsic.SHL, Intrinsic.SHR):
        if not 0 <= count < bits:
            return 0
        return wrap(pattern << count, t) if op is Intrinsic.SHL else value >> count
    count = (count if op is Intrinsic.ROL else -count) % bits
    return wrap(pattern << count | pattern >> (bits - count), t)


def fits(value: int, t: Type) -> bool:
    """Whether a whole number is a value of the type."""
    if isinstance(t, SubrangeType):
        return t.low <= value <= t.high
    base = base_of(t)
    assert isinstance(base, Elementary)
    low, high = limits(base)
    return low <= value <= high


def smallest(value: int, candidates: tuple[Elementary, ...]) -> Elementary | None:
    """The first of the types that holds the value."""
    return next((t for t in candidates if fits(value, t)), None)


def describe(value: Value, t: Type) -> str:
    """A constant as the user would write it."""
    if isinstance(t, EnumType):
        return next((n for n, v in t.values.items() if v == value), str(value))
    if t is BOOL:
        return "TRUE" if value else "FALSE"
    return f"'{value}'" if isinstance(value, str) else str(value)
