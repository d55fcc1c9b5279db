"""Arithmetic of integers below 32 bits that is computed in 32 bits, as CODESYS and TwinCAT do it: in which type.

The value is that of mathematics as long as it fits 32 bits, whatever has a sign: `word - 1` of 0 is -1, not
4294967295. CODESYS documents the bits of the register only, which are the same.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.conversions import convert, elementary, is_narrow, whole_value
from plctool.compiler.typed.nodes import BinaryOp, Expr
from plctool.iec.common_types import common_number
from plctool.iec.types import DINT, LINT, UDINT, Elementary, Kind

_ARITHMETIC = (BinaryOp.ADD, BinaryOp.SUB, BinaryOp.MUL, BinaryOp.DIV, BinaryOp.MOD)
_LOGIC = (BinaryOp.AND, BinaryOp.OR, BinaryOp.XOR)


def has_whole_value(e: Expr) -> bool:
    """Whether a value was computed in 32 bits and stands for a narrower one."""
    return whole_value(e) is not e


def is_widened(op: BinaryOp, left: Expr, right: Expr, t: Elementary) -> bool:
    """Whether `op` is computed in another type than `t`, which the types of its operands have in common."""
    whole = [whole_value(e).type for e in (left, right) if has_whole_value(e)]
    if is_narrow(t):
        return op in _ARITHMETIC or (op in _LOGIC and bool(whole))
    return t is DINT and any(of not in (DINT, t) for of in whole)


def in_32_bits(op: BinaryOp, left: Expr, right: Expr) -> tuple[Expr, Expr, Elementary]:
    """The operands of `op`, narrow or whole values of such, and the type it is computed in: DINT; UDINT for the product
    of two unsigned operands of 16 bits, and what is made of it; LINT where it meets a number with a sign."""
    left, right = whole_value(left), whole_value(right)
    a, b = elementary(left.type), elementary(right.type)
    assert a is not None and b is not None
    unsigned = not a.signed and not b.signed
    if unsigned and (UDINT in (a, b) or (op is BinaryOp.MUL and a.bits + b.bits == UDINT.bits)):
        t = UDINT
    else:
        t = common_number(*(DINT if is_narrow(x) else x for x in (a, b))) or LINT
    return convert(left, t), convert(right, t), t


def negated_type(e: Expr) -> Elementary:
    """The type in which minus `e` is computed, a whole value or a narrow one."""
    return DINT if is_narrow(e.type) or e.type is DINT else LINT


def compared(left: Expr, right: Expr) -> tuple[Expr, Expr]:
    """The operands of a comparison with their whole values, by which they are compared. Beside 64 bits without a sign,
    an operand without one stays what it is: there is no type for both."""
    return _beside(left, right), _beside(right, left)


def _beside(e: Expr, other: Expr) -> Expr:
    narrow, wide = elementary(e.type), elementary(other.type)
    if has_whole_value(e):
        long = wide is not None and wide.bits == LINT.bits and wide.kind in (Kind.INT, Kind.BIT) and not wide.signed
        return e if long and narrow is not None and not narrow.signed else whole_value(e)
    if narrow is not None and narrow.kind is Kind.BIT and narrow.bits == UDINT.bits and has_whole_value(other):
        return convert(e, UDINT)
    return e
