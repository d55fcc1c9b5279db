"""Pointers that are computed with: POINTER TO counts in bytes. REF_TO, the one of the standard, is only followed.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.conversions import NUMBERS, convert, elementary, settle
from plctool.compiler.typed import Binary, BinaryOp, Const, Expr, Pos
from plctool.iec.types import LINT, LWORD, InterfaceType, PointerType, RawPointerType, ReferenceType


def is_address(e: Expr) -> bool:
    """Whether this is a POINTER TO."""
    return isinstance(e.type, RawPointerType)


def as_number(e: Expr) -> Expr:
    """An address as LWORD; any other value as it is."""
    is_pointer = isinstance(e.type, PointerType) and not isinstance(e.type, InterfaceType | ReferenceType)
    return convert(e, LWORD) if is_pointer else e


def moved(op: BinaryOp, left: Expr, right: Expr, pos: Pos) -> Expr | None:
    """`pointer + n`, `n + pointer`, `pointer - n`: another pointer. None when it is something else."""
    if op is BinaryOp.ADD and is_address(right):
        left, right = right, left
    if op not in (BinaryOp.ADD, BinaryOp.SUB) or not is_address(left) or isinstance(right.type, PointerType):
        return None
    right = settle(right)
    number = elementary(right.type)
    if number is None or number.kind not in NUMBERS:
        return None
    return convert(Binary(op, convert(left, LINT), convert(right, LINT), LINT, pos), left.type)


def element(pointer: Expr, index: Expr, pos: Pos) -> Expr:
    """The address of `pointer[index]`, counted in elements."""
    assert isinstance(pointer.type, PointerType)
    size = Const(pointer.type.target.size, LINT, pos)
    offset = Binary(BinaryOp.MUL, convert(index, LINT), size, LINT, pos)
    return convert(Binary(BinaryOp.ADD, convert(pointer, LINT), offset, LINT, pos), pointer.type)
