"""The scalar type that two others have in common.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.iec.types import (
    BOOL,
    DATE,
    DINT,
    DT,
    INT,
    LDATE,
    LDT,
    LINT,
    LREAL,
    LTIME,
    LTOD,
    SINT,
    TIME,
    TOD,
    Elementary,
    Kind,
    Type,
)

NUMBERS = (Kind.INT, Kind.BIT)
SIGNED = {8: SINT, 16: INT, 32: DINT, 64: LINT}
WIDE: dict[Type, Elementary] = {TIME: LTIME, DATE: LDATE, TOD: LTOD, DT: LDT}
"""The type of the same meaning in 64 bits."""


def common_number(a: Elementary, b: Elementary) -> Elementary | None:
    """The type two numbers or bit strings are calculated in."""
    if a is b:
        return a
    if Kind.REAL in (a.kind, b.kind):
        if a.kind is b.kind:
            return LREAL
        real, other = (a, b) if a.kind is Kind.REAL else (b, a)
        return real if other.kind in NUMBERS else None
    if a.kind is Kind.BIT and b.kind is Kind.BIT:
        return a if a.bits >= b.bits else b
    if Kind.BIT in (a.kind, b.kind):
        bit, number = (a, b) if a.kind is Kind.BIT else (b, a)
        return number if number.bits >= bit.bits else bit
    if a.signed is b.signed:
        return a if a.bits >= b.bits else b
    signed, unsigned = (a, b) if a.signed else (b, a)
    return signed if signed.bits > unsigned.bits else SIGNED[min(64, unsigned.bits * 2)]


def common_scalar(a: Elementary, b: Elementary) -> Elementary | None:
    """The type both operands of a comparison, or of a generic function, are brought to; None when there is none."""
    if a is b:
        return a
    if WIDE.get(a) is b or WIDE.get(b) is a:
        return WIDE.get(a, a)
    if a.kind in (*NUMBERS, Kind.REAL) and b.kind in (*NUMBERS, Kind.REAL):
        return common_number(a, b)
    if {a.kind, b.kind} == {Kind.BOOL, Kind.BIT}:
        return b if a is BOOL else a
    return None
