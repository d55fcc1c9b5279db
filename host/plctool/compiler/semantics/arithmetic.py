"""Arithmetic with dates, times of day and pointers: what the operators make of them.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.conversions import NS_PER_MS, convert, elementary, scaled, settle
from plctool.compiler.typed.nodes import Binary, BinaryOp, Const, Expr, Pos
from plctool.iec.common_types import NUMBERS, WIDE
from plctool.iec.types import (
    DATE,
    DT,
    LDATE,
    LDT,
    LINT,
    LTIME,
    LTOD,
    LWORD,
    TIME,
    TOD,
    Elementary,
    InterfaceType,
    PointerType,
    RawPointerType,
    ReferenceType,
    Type,
)

# ---- dates, times of day and durations ----

_DAY_NS = 86_400_000_000_000
_SECOND = 1_000_000_000

UNIT_NS: dict[Type, int] = {
    TIME: NS_PER_MS, LTIME: 1, DATE: _SECOND, TOD: NS_PER_MS, DT: _SECOND, LDATE: 1, LTOD: 1, LDT: 1,
}  # fmt: skip
"""What a value of 1 is worth, for durations and dates."""

_ADD, _SUB, _MUL, _DIV = BinaryOp.ADD, BinaryOp.SUB, BinaryOp.MUL, BinaryOp.DIV
FUNCTIONS: dict[str, tuple[BinaryOp, Elementary, Elementary | None]] = {
    "ADD_TIME": (_ADD, TIME, TIME), "ADD_LTIME": (_ADD, LTIME, LTIME),
    "SUB_TIME": (_SUB, TIME, TIME), "SUB_LTIME": (_SUB, LTIME, LTIME),
    "ADD_TOD_TIME": (_ADD, TOD, TIME), "ADD_LTOD_LTIME": (_ADD, LTOD, LTIME),
    "ADD_DT_TIME": (_ADD, DT, TIME), "ADD_LDT_LTIME": (_ADD, LDT, LTIME),
    "SUB_DATE_DATE": (_SUB, DATE, DATE), "SUB_LDATE_LDATE": (_SUB, LDATE, LDATE),
    "SUB_TOD_TIME": (_SUB, TOD, TIME), "SUB_LTOD_LTIME": (_SUB, LTOD, LTIME),
    "SUB_TOD_TOD": (_SUB, TOD, TOD), "SUB_LTOD_LTOD": (_SUB, LTOD, LTOD),
    "SUB_DT_TIME": (_SUB, DT, TIME), "SUB_LDT_LTIME": (_SUB, LDT, LTIME),
    "SUB_DT_DT": (_SUB, DT, DT), "SUB_LDT_LDT": (_SUB, LDT, LDT),
    "MUL_TIME": (_MUL, TIME, None), "MUL_LTIME": (_MUL, LTIME, None), "MULTIME": (_MUL, TIME, None),
    "DIV_TIME": (_DIV, TIME, None), "DIV_LTIME": (_DIV, LTIME, None), "DIVTIME": (_DIV, TIME, None),
}  # fmt: skip
"""The operators under the names of the standard, with the types of their operands (None: any number)."""


def same_meaning(a: Type, b: Type) -> bool:
    """Whether two types differ at most in their width, as DT and LDT do."""
    return WIDE.get(a, a) is WIDE.get(b, b)


def day(t: Type) -> int:
    """A day in the unit of the type."""
    return _DAY_NS // UNIT_NS[t]


def rescale(e: Expr, target: Elementary) -> Expr:
    """The amount in the unit of another type."""
    source, wanted = UNIT_NS[e.type], UNIT_NS[target]
    if source >= wanted:
        e = convert(e, target)
        return e if source == wanted else scaled(e, BinaryOp.MUL, source // wanted)
    return convert(scaled(e, BinaryOp.DIV, wanted // source), target)


def convert_date(e: Expr, target: Elementary) -> Expr:
    """A date or duration as another one: a DATE has no time of day, a TOD no days."""
    if not same_meaning(e.type, target):
        if same_meaning(target, TOD):
            whole = day(e.type)
            e = scaled(e, BinaryOp.MOD, whole)
            if same_meaning(e.type, TIME):  # -1s is a second before midnight
                e = scaled(scaled(e, BinaryOp.ADD, whole), BinaryOp.MOD, whole)
        elif same_meaning(target, DATE):
            e = scaled(scaled(e, BinaryOp.DIV, day(e.type)), BinaryOp.MUL, day(e.type))
    return rescale(e, target)


# ---- pointers: POINTER TO counts in bytes; REF_TO, the one of the standard, is only followed ----


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
