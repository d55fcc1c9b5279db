"""The type that several values are brought to, and what constants without a type become beside others.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics import constants
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import (
    BITS,
    NUMBERS,
    character,
    common_type,
    elementary,
    literal_type,
    settle,
)
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.semantics.values import is_untyped
from plctool.compiler.typed import Const, Expr
from plctool.iec.types import BOOL, CHAR, LREAL, REAL, WCHAR, Kind, PointerType, SubrangeType, Type


def untyped_bits(c: Checker, e: Expr, expected: Type | None) -> Expr:
    """An untyped constant as the operand of NOT or of a shift: of the type its surroundings would like."""
    base = elementary(expected) if expected is not None else None
    if base is not None and (base.kind in NUMBERS or base is BOOL):
        return c.coerce(e, base)
    return settle(e)


def match_literals(c: Checker, left: Expr, right: Expr, expected: Type | None) -> tuple[Expr, Expr]:
    """Gives an untyped constant the type of the other operand when it fits there."""
    if is_untyped(left) and not is_untyped(right):
        return _literal_for(c, left, right.type, expected), right
    if is_untyped(right) and not is_untyped(left):
        return left, _literal_for(c, right, left.type, expected)
    return left, right


def _literal_for(c: Checker, e: Expr, other: Type, expected: Type | None) -> Expr:
    t = elementary(other)
    assert isinstance(e, Const) and not isinstance(e.value, str)
    if isinstance(other, PointerType) and e.value == 0:
        return Const(0, other, e.pos)
    if t is None or t.kind is Kind.TIME:
        return settle(e)
    if t.kind is Kind.REAL:
        return c.coerce(e, t)
    if isinstance(e.value, float):
        if expected is REAL or expected is LREAL:
            return c.coerce(e, expected)
        return c.coerce(e, REAL if t.bits <= 16 else LREAL)
    if constants.fits(e.value, t):
        return Const(e.value, t, e.pos)
    if t.kind is Kind.BIT and e.value >= 0:
        return c.coerce(e, constants.smallest(e.value, tuple(BITS.values())) or t)
    return settle(e)


def common_of(c: Checker, values: list[Expr], name: str, offset: int, expected: Type | None) -> Type:
    """The type all arguments of `name` are brought to; ERROR after an error."""
    characters = [v.type for v in values if v.type in (CHAR, WCHAR)]
    if characters:  # beside them, a text constant of one character is one
        values = [character(v, characters[0]) or v for v in values]
    typed = [v.type for v in values if not is_untyped(v)]
    if not typed:
        base = elementary(expected) if expected is not None else None
        is_number = base is not None and base.kind in (Kind.INT, Kind.BIT, Kind.REAL)
        typed = [base] if base is not None and is_number else [settle(v, expected).type for v in values]
    result: Type | None = typed[0]
    for t in typed[1:]:
        result = None if result is None else common_type(result, t)
    for v in values:
        if result is not None and is_untyped(v):
            result = _literal_common(v, result, expected)
    if result is None:
        listed = " and ".join(dict.fromkeys(str(t) for t in typed))
        c.error(offset, "type", f"{name} cannot combine {listed}")
        return ERROR
    return result.base if isinstance(result, SubrangeType) else result


def _literal_common(literal: Expr, t: Type, expected: Type | None) -> Type | None:
    """The common type of an untyped constant and a type: the type itself when the constant fits."""
    assert isinstance(literal, Const)
    base = elementary(t)
    if base is None:
        return t
    if isinstance(literal.value, float):
        if base.kind is Kind.INT:
            return expected if expected is REAL or expected is LREAL else LREAL if base.bits > 16 else REAL
        return t
    assert isinstance(literal.value, int)
    if base.kind not in NUMBERS or constants.fits(literal.value, base):
        return t
    return common_type(base, literal_type(literal.value) or base)
