"""Implicit conversions: what fits where, what it costs, and what to say when it does not.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from plctool.compiler.diagnostics import Diagnostics
from plctool.compiler.semantics import constants
from plctool.compiler.semantics.symbols import ERROR, NULL_TYPE, UNTYPED_INT, UNTYPED_REAL
from plctool.compiler.syntax.literals import BitPattern
from plctool.compiler.typed import AddressOf, Binary, BinaryOp, Const, Convert, Expr, Load, Pos
from plctool.compiler.types import (
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
    SINT,
    TIME,
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
    Kind,
    OpenArrayType,
    PointerType,
    RawPointerType,
    StringType,
    StructType,
    SubrangeType,
    Type,
    base_of,
)  # fmt: skip

NS_PER_MS = 1_000_000

SIGNED = {8: SINT, 16: INT, 32: DINT, 64: LINT}
UNSIGNED = {8: USINT, 16: UINT, 32: UDINT, 64: ULINT}
BITS = {8: BYTE, 16: WORD, 32: DWORD, 64: LWORD}
_LONGER = {(DATE, LDATE): 1_000_000_000, (TOD, LTOD): NS_PER_MS, (DT, LDT): 1_000_000_000}  # and their factor
_LITERAL_TYPES = (INT, DINT, UDINT, LINT, ULINT)
NUMBERS = (Kind.INT, Kind.BIT)


def elementary(t: Type) -> Elementary | None:
    """The scalar behind a type (of an enum or subrange: its base); None for strings, arrays, structs and pointers."""
    base = base_of(t)
    return base if isinstance(base, Elementary) else None


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


def takes_array(t: Type, actual: Type) -> bool:
    """Whether `t` is an ARRAY[*] and an array of type `actual` can be handed over for it."""
    if not isinstance(t, OpenArrayType) or not isinstance(actual, ArrayType):
        return False
    return len(t.bounds) == len(actual.bounds) and same_type(t.element, actual.element)


# ---- building conversions -----------------------------------------------------------------------------------------


def convert(e: Expr, target: Type, *, truncate: bool = False) -> Expr:
    """A plain `Convert`, folded for constants."""
    if e.type is target:
        return e
    if isinstance(e, Const):
        return Const(constants.convert(e.value, e.type, target, truncate=truncate), target, e.pos)
    return Convert(e, target, e.pos, truncate)


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


def literal_type(value: int) -> Elementary | None:
    """The type of an integer literal without context."""
    return constants.smallest(value, _LITERAL_TYPES)


_EXAMPLES = {Kind.DATE: "a literal such as DT#2024-02-29-12:30:15, or ULINT_TO_{}(...)", Kind.CHAR: "{}#'A'"}


def character(e: Expr, target: Type) -> Expr | None:
    """A text constant of one character as a CHAR or WCHAR; None when it is none."""
    if not isinstance(e, Const) or not isinstance(e.value, str) or len(e.value) != 1 or target not in (CHAR, WCHAR):
        return None
    assert isinstance(e.type, StringType)
    return Const(ord(e.value), target, e.pos) if e.type.wide is (target is WCHAR) else None


class Coercion:
    """Implicit conversions with their diagnoses."""

    def __init__(self, diagnostics: Diagnostics, text_of: Callable[[Expr], Expr]) -> None:
        """`text_of` makes a text of a CHAR or WCHAR."""
        self._diagnostics = diagnostics
        self._text_of = text_of

    def __call__(self, e: Expr, target: Type) -> Expr:
        """`e` as a value of `target`; what does not fit is reported and becomes the error value."""
        source = e.type
        if source is target or source == target:
            return e
        if source is ERROR or target is ERROR:
            return error_value(e.pos)
        if isinstance(target, SubrangeType):
            return self._to_subrange(e, target)
        if isinstance(e, Const) and (source is UNTYPED_INT or source is UNTYPED_REAL):
            return self._literal(e, target)
        if isinstance(source, StringType) and isinstance(target, StringType):
            return self._string(e, target)
        if isinstance(target, EnumType):
            return self._to_enum(e, target)
        if isinstance(target, PointerType) or isinstance(source, PointerType):
            return self._pointer(e, target)
        from_, to = elementary(source), elementary(target)
        if from_ is None or to is None:
            if isinstance(target, StringType) and source is target.character:
                if isinstance(e, Const) and isinstance(e.value, int):
                    return Const(chr(e.value), StringType(1, target.wide), e.pos)
                return self._text_of(e)
            return character(e, target) or (e if same_type(source, target) else self._no_scalars(e, target))
        if from_ is to:
            return Const(e.value, target, e.pos) if isinstance(e, Const) else convert(e, target)
        return self._scalar(e, from_, to)

    # ---- errors ----

    def _error(self, pos: Pos, code: str, message: str) -> Expr:
        self._diagnostics.error(pos, code, message)
        return error_value(pos)

    def _warn(self, pos: Pos, code: str, message: str) -> None:
        self._diagnostics.warning(pos, code, message)

    def _mismatch(self, e: Expr, target: Type) -> Expr:
        return self._error(e.pos, "type", f"{e.type} does not fit {target}")

    def _no_scalars(self, e: Expr, target: Type) -> Expr:
        """A text and a number need a conversion; anything else does not go together."""
        source, to = elementary(e.type), elementary(target)
        if isinstance(target, StringType) and source is not None:
            return self._needs(e, source.name, target.keyword)
        if isinstance(e.type, StringType) and to is not None:
            return self._needs(e, e.type.keyword, to.name)
        return self._mismatch(e, target)

    def _needs(self, e: Expr, source: str, target: str) -> Expr:
        message = f"{e.type} does not fit {target} by itself; write {source}_TO_{target}(...)"
        return self._error(e.pos, "type", message)

    # ---- by kind ----

    def _literal(self, e: Const, target: Type) -> Expr:
        """An untyped integer or real constant."""
        to, value = elementary(target), e.value
        assert not isinstance(value, str)
        if isinstance(target, PointerType) and value == 0:
            return Const(0, target, e.pos)
        what = "an integer" if e.type is UNTYPED_INT else "a real number"
        if to is None:
            return self._error(e.pos, "type", f"{what} does not fit {target}")
        if to.kind is Kind.REAL:
            number = constants.rounded(float(value), to)
            if number in (float("inf"), float("-inf")):
                return self._error(e.pos, "range", f"{value} is too large for {target}")
            return Const(number, target, e.pos)
        if isinstance(value, float):
            if to.kind in NUMBERS:
                return self._error(e.pos, "type", f"{value} does not fit {target}; write REAL_TO_{to}({value})")
            return self._error(e.pos, "type", f"{what} does not fit {target}")
        if isinstance(target, EnumType):
            return self._to_enum(e, target)
        if to.kind is Kind.TIME:
            unit = "ms" if to is TIME else "ns"
            return self._error(
                e.pos, "type", f"{value} is not a duration; write {'T' if to is TIME else 'LTIME'}#{value}{unit}"
            )
        if to.kind in (Kind.DATE, Kind.CHAR):
            return self._error(e.pos, "type", f"{value} is not a {to}; write {_EXAMPLES[to.kind].format(to)}")
        if isinstance(value, BitPattern) and to.signed and value >> to.bits == 0 and not constants.fits(value, to):
            negative = constants.wrap(value, to)
            self._warn(e.pos, "narrowing", f"{value} becomes {target} {negative}, which has the same bits")
            return Const(negative, target, e.pos)
        if not constants.fits(value, to):
            low, high = constants.limits(to)
            return self._error(e.pos, "range", f"{value} does not fit {target} ({low}..{high})")
        return Const(value, target, e.pos)

    def _to_subrange(self, e: Expr, target: SubrangeType) -> Expr:
        value = self(e, target.base)
        if value.type is ERROR:
            return value
        if isinstance(value, Const):
            assert isinstance(value.value, int)
            if not constants.fits(value.value, target):
                return self._error(
                    e.pos, "range", f"{value.value} is outside {target.name} ({target.low}..{target.high})"
                )
            return Const(value.value, target, e.pos)
        if isinstance(e.type, SubrangeType) and target.low <= e.type.low and e.type.high <= target.high:
            return Convert(value, target, e.pos)
        return Convert(value, target, e.pos, check=(target.low, target.high))

    def _to_enum(self, e: Expr, target: EnumType) -> Expr:
        source = elementary(e.type)
        if isinstance(e.type, EnumType) or source is None or source.kind not in NUMBERS:
            return self._mismatch(e, target)
        if isinstance(e, Const):
            assert isinstance(e.value, int)
            if e.value not in target.values.values():
                return self._error(e.pos, "range", f"{e.value} is no value of {target}")
            name = constants.describe(e.value, target)
            self._warn(e.pos, "enum", f"the number {e.value} stands for a value of {target}; write {target}#{name}")
            return Const(e.value, target, e.pos)
        self._warn(e.pos, "enum", f"{e.type} becomes {target} without a check whether it is one of its values")
        return convert(e, target)

    def _string(self, e: Expr, target: StringType) -> Expr:
        assert isinstance(e.type, StringType)
        if e.type.wide is not target.wide:
            hint = '; write "..."' if target.wide else "; write '...'" if isinstance(e, Const) else ""
            hint = hint if isinstance(e, Const) else f"; write {e.type.keyword}_TO_{target.keyword}(...)"
            return self._error(e.pos, "type", f"{e.type} does not fit {target}{hint}")
        if isinstance(e, Const) and isinstance(e.value, str) and len(e.value) > target.length:
            self._warn(e.pos, "truncated", f"this text has {len(e.value)} characters, {target} holds {target.length}")
            return Const(e.value[: target.length], target, e.pos)
        return e

    def _pointer(self, e: Expr, target: Type) -> Expr:
        if e.type is NULL_TYPE and isinstance(target, PointerType):
            return Const(0, target, e.pos)
        if isinstance(target, InterfaceType):
            return self._to_interface(e, target)
        if isinstance(e.type, PointerType) and isinstance(target, PointerType) and e.type is not NULL_TYPE:
            inner = e.type.target
            if (
                isinstance(inner, StructType)
                and not isinstance(e.type, InterfaceType)
                and inner.conforms(target.target)
            ):
                return replace(e, type=target)
        if isinstance(e.type, PointerType) and isinstance(target, PointerType) and same_type(e.type, target):
            return replace(e, type=target)
        if isinstance(e.type, RawPointerType) or isinstance(target, RawPointerType):
            return self._raw_pointer(e, target)
        return self._mismatch(e, target)

    def _raw_pointer(self, e: Expr, target: Type) -> Expr:
        """POINTER TO takes any address; a number becomes one and the other way round."""
        if isinstance(e.type, PointerType) and isinstance(target, PointerType):
            if isinstance(e.type, InterfaceType):
                return self._mismatch(e, target)
            if not isinstance(e, AddressOf) and BYTE not in (e.type.target, target.target):
                self._warn(e.pos, "pointer", f"{e.type} becomes {target}: it points to something else")
            return replace(e, type=target)
        number = elementary(e.type if isinstance(target, PointerType) else target)
        if number is None or number.kind not in NUMBERS:
            return self._mismatch(e, target)
        if number.bits < 64:
            self._warn(e.pos, "narrowing", f"a pointer has 64 bits, {number} {number.bits}; use LWORD")
        return convert(e, target)

    def _to_interface(self, e: Expr, target: InterfaceType) -> Expr:
        """The address of an instance, or what another interface variable holds."""
        source = e.type.target if isinstance(e.type, PointerType) else e.type
        if not isinstance(source, StructType) or (
            isinstance(e.type, PointerType) and not isinstance(e.type, InterfaceType)
        ):
            return self._mismatch(e, target)
        if not source.conforms(target.target):
            what = "extend" if isinstance(e.type, InterfaceType) else "implement"
            return self._error(e.pos, "type", f"{source} does not {what} {target}")
        if isinstance(e.type, InterfaceType):
            return replace(e, type=target)
        return AddressOf(e.place, target, e.pos) if isinstance(e, Load) else self._mismatch(e, target)

    def _scalar(self, e: Expr, source: Elementary, target: Elementary) -> Expr:
        if target is BOOL:
            if isinstance(e, Const) and e.value in (0, 1) and source.kind in NUMBERS:
                return Const(e.value, BOOL, e.pos)
            return self._needs(e, source.name, target.name)
        if source is BOOL:
            return convert(e, target) if target.kind is Kind.BIT else self._needs(e, source.name, target.name)
        if source.kind in NUMBERS and target.kind in NUMBERS:
            return self._integer(e, source, target)
        if target.kind is Kind.REAL:
            return self._to_real(e, source, target)
        if source is TIME and target is LTIME:
            return time_to_ltime(e)
        if (source, target) in _LONGER:
            return scaled(convert(e, target), BinaryOp.MUL, _LONGER[source, target])
        return self._needs(e, source.name, target.name)

    def _integer(self, e: Expr, source: Elementary, target: Elementary) -> Expr:
        if isinstance(e, Const) and isinstance(e.value, int):
            if not constants.fits(e.value, target) and not (
                source.bits == target.bits and Kind.BIT in (source.kind, target.kind)
            ):
                self._warn(e.pos, "narrowing", f"{e.value} does not fit {target}, it is cut off")
            return convert(e, target)
        if source.bits > target.bits:
            self._warn(e.pos, "narrowing", f"{e.type} becomes {target}: values may be cut off")
        elif source.bits == target.bits:
            if source.kind is target.kind:
                self._warn(e.pos, "narrowing", f"{e.type} becomes {target}: half of the values change")
        elif source.signed and not target.signed and target.kind is Kind.INT:
            self._warn(e.pos, "narrowing", f"{e.type} becomes {target}: negative values change")
        elif target.kind is Kind.INT and isinstance(e, Binary) and e.op is BinaryOp.MUL:
            self._warn(
                e.pos,
                "widening",
                f"this product is calculated in {source} and only then becomes {target}; convert a factor",
            )
        return convert(e, target)

    def _to_real(self, e: Expr, source: Elementary, target: Elementary) -> Expr:
        if source.kind is Kind.REAL:
            if target is REAL and not isinstance(e, Const):
                self._warn(e.pos, "narrowing", "LREAL becomes REAL: digits may be lost")
            return convert(e, target)
        if source.kind is Kind.BIT:
            self._warn(e.pos, "bits", f"{e.type} becomes {target}: its bits count as an unsigned number")
            source = UNSIGNED[source.bits]
            e = convert(e, source)
        if source.kind is not Kind.INT:
            return self._needs(e, source.name, target.name)
        if source.bits > (16 if target is REAL else 32) and not isinstance(e, Const):
            self._warn(e.pos, "precision", f"{e.type} becomes {target}: large values are rounded")
        return convert(e, target)


# ---- common types -------------------------------------------------------------------------------------------------


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
    if x is y:
        return x
    if {x, y} == {TIME, LTIME}:
        return LTIME
    if (x, y) in _LONGER or (y, x) in _LONGER:
        return y if (x, y) in _LONGER else x
    if x.kind in (Kind.INT, Kind.BIT, Kind.REAL) and y.kind in (Kind.INT, Kind.BIT, Kind.REAL):
        return common_number(x, y)
    if x is BOOL and y.kind is Kind.BIT:
        return y
    if y is BOOL and x.kind is Kind.BIT:
        return x
    return None
