"""Comparisons with a number beyond what the other side can be: they always give the same.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.ranges import Range, type_range
from plctool.compiler.semantics import constants
from plctool.compiler.semantics.conversions import NUMBERS, SIGNED, elementary
from plctool.compiler.typed import BinaryOp, Const, Expr
from plctool.iec.types import BOOL, EnumType, SubrangeType, Type

_SWAPPED = {BinaryOp.LT: BinaryOp.GT, BinaryOp.GT: BinaryOp.LT, BinaryOp.LE: BinaryOp.GE, BinaryOp.GE: BinaryOp.LE}


def always(op: BinaryOp, value: Expr, number: int, *, swapped: bool) -> str:
    """What to say of `value op number` (`swapped`: of `number op value`) when the type of the value decides it; ""
    when it does not."""
    limits = _limits(value.type)
    if limits is None or isinstance(value, Const):
        return ""
    op = _SWAPPED.get(op, op) if swapped else op
    least, most = (constants.binary(op, limit, number, BOOL) for limit in limits)
    within = limits[0] <= number <= limits[1]
    decided = least == most if op in _SWAPPED else not within
    return f"this is always {'TRUE' if least else 'FALSE'}: {_why(value.type, limits, number)}" if decided else ""


def _limits(t: Type) -> Range | None:
    if isinstance(t, SubrangeType):
        return t.low, t.high
    base = elementary(t)
    return type_range(t) if base is not None and base.kind in NUMBERS and not isinstance(t, EnumType) else None


def _why(t: Type, limits: Range, number: int) -> str:
    low, high = limits
    what = f"{'an' if t.name[0] in 'AEIOU' and not t.name.startswith('U') else 'a'} {t}"
    if number > low:
        return f"{what} is at most {high}; use a larger type or another number"
    base = elementary(t)
    if low == 0 and base is not None and not isinstance(t, SubrangeType):
        signed = SIGNED[min(64, 2 * base.bits)]
        return f"{what} is never negative; use a signed type such as {signed}, or leave the comparison out"
    return f"{what} is at least {low}; use another type or another number"
