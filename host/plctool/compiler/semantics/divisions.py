"""Integer divisions whose result becomes a REAL: the fraction is lost before.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.conversions import NUMBERS, elementary
from plctool.compiler.typed import Binary, BinaryOp, Convert, Expr, Unary
from plctool.iec.types import Elementary, Kind


def lost_fraction(e: Expr, target: Elementary, *, explicit: bool = False) -> str:
    """What to say when the integer `e` becomes `target`; "" when it is no division. `explicit`: by INT_TO_REAL and the
    like; then whole days, seconds ... of a date or duration are meant as they are, and so are bits."""
    division = _division(e)
    if division is None or (explicit and _is_of_time(division.left)):
        return ""
    source = elementary(division.type)
    if source is None or (explicit and source.kind is not Kind.INT):
        return ""
    drops = f"this division of {source} drops its fraction and only then becomes {target}"
    return f"{drops}; convert an operand: {source}_TO_{target}(...) / ..."


def _division(e: Expr) -> Binary | None:
    """The integer division that an expression is, or that is added to something in it."""
    if isinstance(e, Unary):
        return _division(e.operand)
    if isinstance(e, Convert):
        source = elementary(e.operand.type)
        return _division(e.operand) if source is not None and source.kind in NUMBERS else None
    if not isinstance(e, Binary):
        return None
    if e.op in (BinaryOp.ADD, BinaryOp.SUB):
        return _division(e.left) or _division(e.right)
    return e if e.op is BinaryOp.DIV else None


def _is_of_time(e: Expr) -> bool:
    """Whether a number is a duration or date that was converted."""
    while isinstance(e, Convert):
        e = e.operand
        source = elementary(e.type)
        if source is not None and source.kind in (Kind.TIME, Kind.DATE):
            return True
    return False
