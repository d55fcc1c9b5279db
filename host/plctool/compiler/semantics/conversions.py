"""Typed expressions: their conversions, the types of literals, the types that two values have in common, and the place
that a value was loaded from.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from plctool.compiler.semantics import constants
from plctool.compiler.semantics.symbols import ERROR, NULL_TYPE, UNTYPED_INT, UNTYPED_REAL
from plctool.compiler.typed.nodes import (
    Binary,
    BinaryOp,
    BitPlace,
    Call,
    Const,
    Convert,
    DerefPlace,
    Expr,
    Load,
    Place,
    Pos,
    Rounding,
    SelfPlace,
    Storage,
    ValuePlace,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.common_types import NUMBERS, common_scalar
from plctool.iec.types import (
    BOOL,
    BYTE,
    CHAR,
    DATE,
    DINT,
    DT,
    DWORD,
    INT,
    LDATE,
    LDT,
    LINT,
    LREAL,
    LTIME,
    LTOD,
    LWORD,
    REAL,
    TOD,
    UDINT,
    UINT,
    ULINT,
    USINT,
    WCHAR,
    WORD,
    ArrayType,
    Elementary,
    EnumType,
    InterfaceType,
    OpenArrayType,
    PointerType,
    RawPointerType,
    ReferenceType,
    StringType,
    Type,
    base_of,
)

# ---- conversions ----

NS_PER_MS = 1_000_000

UNSIGNED = {8: USINT, 16: UINT, 32: UDINT, 64: ULINT}
BITS = {8: BYTE, 16: WORD, 32: DWORD, 64: LWORD}
LONGER_DATES = {(DATE, LDATE): 1_000_000_000, (TOD, LTOD): NS_PER_MS, (DT, LDT): 1_000_000_000}  # and their factor
_LITERAL_TYPES = (INT, DINT, UDINT, LINT, ULINT)


def elementary(t: Type) -> Elementary | None:
    """The scalar of a type (of an enum or subrange: its base); None for strings, arrays, structs and pointers."""
    base = base_of(t)
    return base if isinstance(base, Elementary) else None


def is_referred(e: Expr) -> bool:
    """Whether this is what a REFERENCE TO refers to."""
    return isinstance(e, Load) and isinstance(e.place, DerefPlace) and isinstance(e.place.pointer.type, ReferenceType)


def is_global(e: Expr) -> bool:
    """True if a value is made of constants and global variables, without a call, so that it is the same anywhere."""
    return all(
        node.var.storage is Storage.AREA if isinstance(node, VarPlace) else not isinstance(node, Call | SelfPlace)
        for node in walk(e)
    )


def error_value(pos: Pos) -> Const:
    """Stands for what is wrong and was reported."""
    return Const(0, ERROR, pos)


def same_type(a: Type, b: Type) -> bool:
    """Whether values of the types are interchangeable, as assignments of whole arrays and VAR_IN_OUT need it."""
    if a is b or a == b:
        return True
    if isinstance(a, ArrayType) and isinstance(b, ArrayType):
        return a.bounds == b.bounds and same_type(a.element, b.element)
    if isinstance(a, PointerType) and isinstance(b, PointerType):
        return same_type(a.target, b.target)
    return ERROR in (a, b)


def same_lengths(a: Type, b: Type) -> bool:
    """Whether both are arrays of the same elements, as many in each dimension, whatever their bounds begin with."""
    if not isinstance(a, ArrayType) or not isinstance(b, ArrayType):
        return False
    lengths = [[high - low for low, high in t.bounds] for t in (a, b)]
    return lengths[0] == lengths[1] and same_type(a.element, b.element)


def takes_array(t: Type, actual: Type) -> bool:
    """Whether `t` is an ARRAY[*] and an array of type `actual` can be passed for it."""
    if not isinstance(t, OpenArrayType) or not isinstance(actual, ArrayType):
        return False
    return len(t.bounds) == len(actual.bounds) and same_type(t.element, actual.element)


# ---- building conversions -----------------------------------------------------------------------------------------


def convert(e: Expr, target: Type, *, rounding: Rounding = Rounding.EVEN) -> Expr:
    """A plain `Convert`, folded for constants."""
    if e.type is target:
        return e
    e = whole_value(e)
    if e.type is target:
        return e
    if isinstance(e, Const):
        return Const(constants.convert(e.value, e.type, target, rounding=rounding), target, e.pos)
    return Convert(e, target, e.pos, rounding)


def whole_value(e: Expr) -> Expr:
    """The value as it was computed: of a result of 32 bits that stands for a narrower one, the former."""
    if isinstance(e, Const):
        return e if e.whole is None else e.whole
    return e.operand if isinstance(e, Convert) and e.cuts else e


def is_narrow(t: Type) -> bool:
    """Whether it is an integer or bit string of less than 32 bits."""
    base = elementary(t)
    return base is not None and base.kind in NUMBERS and base.bits < DINT.bits


def cut(e: Expr, t: Elementary) -> Expr:
    """A result of 32 bits or more as a value of `t`, with the whole of it at hand."""
    if e.type is t or e.type is ERROR:
        return e
    if isinstance(e, Const):
        fits = isinstance(e.value, int) and constants.fits(e.value, t)
        return Const(constants.convert(e.value, e.type, t), t, e.pos, None if fits else e)
    return Convert(e, t, e.pos, cuts=True)


def finally_cut(e: Expr) -> Expr:
    """The value without what does not fit its type, as a conversion to that type has it."""
    if isinstance(e, Const):
        return e if e.whole is None else replace(e, whole=None)
    return replace(e, cuts=False) if isinstance(e, Convert) and e.cuts else e


def time_to_ltime(e: Expr) -> Expr:
    """TIME [ms] as LTIME [ns]."""
    return scaled(convert(e, LTIME), BinaryOp.MUL, NS_PER_MS)


def scaled(e: Expr, op: BinaryOp, factor: int) -> Expr:
    """`e op factor`, folded for constants."""
    if isinstance(e, Const):
        return Const(constants.binary(op, e.value, factor, e.type), e.type, e.pos)
    return Binary(op, e, Const(factor, e.type, e.pos), e.type, e.pos)


# ---- literals -----------------------------------------------------------------------------------------------------


def settle(e: Expr, expected: Type | None = None) -> Expr:
    """Gives an untyped constant the type it has without context: INT, the next larger one that holds it, or LREAL."""
    if e.type is UNTYPED_REAL:
        assert isinstance(e, Const)
        real = expected if expected is REAL else LREAL
        return Const(constants.rounded(float(e.value), real), real, e.pos)
    if e.type is UNTYPED_INT:
        assert isinstance(e, Const) and isinstance(e.value, int)
        return Const(e.value, literal_type(e.value) or ULINT, e.pos)
    return e


@lru_cache(maxsize=4096)  # most are small, and met again
def literal_type(value: int) -> Elementary | None:
    """The type of an integer literal without context."""
    return constants.smallest(value, _LITERAL_TYPES)


def character(e: Expr, target: Type) -> Expr | None:
    """A text constant of one character as a CHAR or WCHAR; None when it is none."""
    if not isinstance(e, Const) or not isinstance(e.value, str) or len(e.value) != 1 or target not in (CHAR, WCHAR):
        return None
    assert isinstance(e.type, StringType)
    return Const(ord(e.value), target, e.pos) if e.type.wide is (target is WCHAR) else None


# ---- common types -------------------------------------------------------------------------------------------------


def common_type(a: Type, b: Type) -> Type | None:
    """The type both operands of a comparison, or of a generic function, are brought to; None when there is none."""
    if ERROR in (a, b):
        return ERROR
    if a == b:
        return a
    for text, other in ((a, b), (b, a)):
        if isinstance(text, StringType) and other is text.character:
            return text
    if isinstance(a, StringType) and isinstance(b, StringType):
        return None if a.wide is not b.wide else a if a.length >= b.length else b
    if isinstance(a, RawPointerType) and isinstance(b, RawPointerType):
        return a
    if isinstance(a, PointerType) and isinstance(b, PointerType):
        both = isinstance(a, InterfaceType) and isinstance(b, InterfaceType)
        return b if a is NULL_TYPE else a if b is NULL_TYPE or both or same_type(a, b) else None
    if isinstance(a, EnumType) and isinstance(b, EnumType):
        return None
    x, y = elementary(a), elementary(b)
    if x is None or y is None:
        return a if same_type(a, b) else None
    return common_scalar(x, y)


# ---- the place that a value was loaded from ----


def is_untyped(e: Expr) -> bool:
    """Whether the expression is a constant that takes the type its surroundings need."""
    return e.type is UNTYPED_INT or e.type is UNTYPED_REAL


def place_of(e: Expr) -> Place:
    """The place a value was loaded from, or a temporary one."""
    return e.place if isinstance(e, Load) else ValuePlace(e, e.type, e.pos)


def whole(variable: Variable, pos: Pos) -> Place:
    """The place of a variable: of a bit at an address, that bit of the byte there."""
    if variable.bit is None:
        return VarPlace(variable, variable.type, pos)
    return BitPlace(VarPlace(variable, BYTE, pos), variable.bit, BOOL, pos)


def is_temporary(place: Place) -> bool:
    """Whether a place is (part of) a value that no other code sees."""
    while not isinstance(place, VarPlace | DerefPlace | ValuePlace | SelfPlace):
        place = place.base
    return isinstance(place, ValuePlace)


def is_exact(place: Place) -> bool:
    """Whether an instance is of just the type it is declared with: it is not reached through a reference."""
    if isinstance(place, VarPlace):
        return place.var.storage is not Storage.REFERENCE
    if isinstance(place, SelfPlace):
        return place.exact
    return not isinstance(place, DerefPlace)


def load(place: Place) -> Load:
    """The value of a place; of a reference, the value it refers to."""
    if isinstance(place.type, ReferenceType):
        place = DerefPlace(Load(place, place.type, place.pos), place.type.target, place.pos)
    return Load(place, place.type, place.pos)
