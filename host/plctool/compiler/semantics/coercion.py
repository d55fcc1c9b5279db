"""Implicit conversions: what fits where, what it costs, and what to say when it does not.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from plctool.compiler.semantics import constants
from plctool.compiler.semantics.conversions import (
    LONGER_DATES,
    UNSIGNED,
    character,
    convert,
    elementary,
    error_value,
    finally_cut,
    same_lengths,
    same_type,
    scaled,
    time_to_ltime,
    whole_value,
)
from plctool.compiler.semantics.pitfalls import lost_fraction, overlays, wrapping
from plctool.compiler.semantics.symbols import ERROR, NOTHING, NULL_TYPE, UNTYPED_INT, UNTYPED_REAL
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.typed.nodes import (
    AddressOf,
    Binary,
    BinaryOp,
    Call,
    Const,
    Convert,
    Expr,
    Load,
    Place,
    Pos,
    VarPlace,
)
from plctool.compiler.typed.ranges import may_wrap
from plctool.iec.common_types import NUMBERS
from plctool.iec.literals import BitPattern
from plctool.iec.types import (
    BOOL,
    BYTE,
    LTIME,
    REAL,
    TIME,
    WORD,
    ArrayType,
    Elementary,
    EnumType,
    InterfaceType,
    Kind,
    PointerType,
    RawPointerType,
    StringType,
    StructType,
    SubrangeType,
    Type,
)  # fmt: skip

_FORMS = {"DATE": "2024-02-29", "TOD": "12:30:15", "DT": "2024-02-29-12:30:15"}


class Coercion:
    """Implicit conversions with their diagnostics."""

    def __init__(self, diagnostics: Diagnostics, text_of: Callable[[Expr], Expr]) -> None:
        """`text_of` makes a text of a CHAR or WCHAR."""
        self._diagnostics = diagnostics
        self._text_of = text_of

    def __call__(self, e: Expr, target: Type) -> Expr:
        """`e` as a value of `target`; what does not fit is reported and becomes the error value."""
        source = e.type
        if source is target or source == target:
            return self._cut(e)
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

    def _cut(self, e: Expr) -> Expr:
        """A value of the type already; of a constant that was computed in 32 bits, what fits."""
        if isinstance(e, Const) and e.whole is not None:
            self._warn(e.pos, "narrowing", f"{e.whole.value} does not fit {e.type}, it is cut off")
            return finally_cut(e)
        return e

    # ---- errors ----

    def _error(self, pos: Pos, code: str, message: str) -> Expr:
        self._diagnostics.error(pos, code, message)
        return error_value(pos)

    def _warn(self, pos: Pos, code: str, message: str) -> None:
        self._diagnostics.warning(pos, code, message)

    def _mismatch(self, e: Expr, target: Type) -> Expr:
        if e.type is NOTHING and isinstance(e, Call):
            name = e.function.name.rpartition(".")[2]
            kind = "METHOD" if e.instance is not None else "FUNCTION"
            message = f"{name} gives no result; call it as a statement, or declare {kind} {name} : {target}"
            return self._error(e.pos, "type", message)
        if e.type is NULL_TYPE:
            message = f"NULL is for pointers, references and interfaces; it does not fit {target}"
            return self._error(e.pos, "type", message)
        counted = isinstance(e.type, ArrayType) and isinstance(target, StringType)
        hint = "; the last index of an array is UPPER_BOUND(..., 1)" if counted else ""
        block = e.type if isinstance(e.type, StructType) else None
        if block is not None and target is BOOL and (output := block.member("Q")) is not None and output.type is BOOL:
            hint = f"; write {_written(e.place if isinstance(e, Load) else None)}.Q"
        return self._error(e.pos, "type", f"{e.type} does not fit {target}{hint}")

    def _no_scalars(self, e: Expr, target: Type) -> Expr:
        """A text and a number need a conversion; anything else does not go together."""
        source, to = elementary(e.type), elementary(target)
        if isinstance(target, StringType) and source is not None:
            return self._needs(e, source.name, target.keyword)
        if isinstance(e, Const) and isinstance(e.value, str) and len(e.value) == 1 and to in (BYTE, WORD):
            message = f"a character of a STRING is a number here: write 16#{ord(e.value):02X} for '{e.value}'"
            return self._error(e.pos, "type", message)
        if isinstance(e.type, StringType) and isinstance(e, Const) and to is not None and to.kind is Kind.TIME:
            message = f"{e.type} does not fit {target}; a duration is written without quotes: T#5s"
            return self._error(e.pos, "type", message)
        if isinstance(e.type, StringType) and to is not None:
            return self._needs(e, e.type.keyword, to.name)
        if same_lengths(e.type, target):
            self._warn(e.pos, "bounds", f"{e.type} becomes {target}: the elements are taken in their order")
            return e
        return self._mismatch(e, target)

    def _needs(self, e: Expr, source: str, target: str) -> Expr:
        base = elementary(e.type)
        of_unit = ""
        if target in ("TIME", "LTIME") and base is not None and base.kind is Kind.INT:
            of_unit = f"multiply a duration, such as {'T' if target == 'TIME' else 'LTIME'}#1s, by it, or "
        compared = ", or compare it: <> 0" if target == "BOOL" and not isinstance(e.type, StringType) else ""
        message = f"{e.type} does not fit {target}; {of_unit}write {source}_TO_{target}(...){compared}"
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
            hint = "; assign to its elements in a loop" if isinstance(target, ArrayType) else ""
            hint = f"; write '{value}'" if isinstance(target, StringType) and not target.wide else hint
            return self._error(e.pos, "type", f"{what} does not fit {target}{hint}")
        if to.kind is Kind.REAL:
            number = constants.rounded(value, to)
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
            return self._error(e.pos, "type", f"{value} is not a {to}; write {_example(to)}")
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
        return Convert(whole_value(value), target, e.pos, check=(target.low, target.high))

    def _to_enum(self, e: Expr, target: EnumType) -> Expr:
        source = elementary(e.type)
        if source is None or source.kind not in NUMBERS:
            return self._mismatch(e, target)
        if isinstance(e.type, EnumType):
            return self._other_enum(e, e.type, target)
        if target.strict and not isinstance(e, Const):
            return self._error(e.pos, "type", f"{e.type} does not fit {target}, which is 'strict'; use its values")
        if isinstance(e, Const):
            assert isinstance(e.value, int)
            if e.value not in target.values.values():
                return self._error(e.pos, "range", f"{e.value} is not a value of {target}; it has {target.choices}")
            name = constants.describe(e.value, target)
            self._warn(e.pos, "enum", f"the number {e.value} stands for a value of {target}; write {target}#{name}")
            return Const(e.value, target, e.pos)
        self._warn(e.pos, "enum", f"{e.type} becomes {target} without a check whether it is one of its values")
        return convert(e, target)

    def _other_enum(self, e: Expr, source: EnumType, target: EnumType) -> Expr:
        """A value of another enumeration: its number."""
        strict = next((t for t in (target, source) if t.strict), None)
        hint = "" if strict is None else f", though {strict} is 'strict'"
        self._warn(e.pos, "enum", f"a value of {source} becomes one of {target} by its number{hint}")
        return convert(e, target)

    def _string(self, e: Expr, target: StringType) -> Expr:
        assert isinstance(e.type, StringType)
        if e.type.wide is not target.wide:
            hint = '; write "..."' if target.wide else "; write '...'" if isinstance(e, Const) else ""
            hint = hint if isinstance(e, Const) else f"; write {e.type.keyword}_TO_{target.keyword}(...)"
            return self._error(e.pos, "type", f"{e.type} does not fit {target}{hint}")
        if isinstance(e, Const) and isinstance(e.value, str) and len(e.value) > target.length:
            self._warn(e.pos, "truncated", f"this string has {len(e.value)} characters, {target} holds {target.length}")
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
                and inner.may_conform(target.target)
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
            if isinstance(e, AddressOf):
                self._address(e, target)
            elif BYTE not in (e.type.target, target.target):
                self._warn(e.pos, "pointer", f"{e.type} becomes {target}: it points to something else")
            return replace(e, type=target)
        number = elementary(e.type if isinstance(target, PointerType) else target)
        if number is None or number.kind not in NUMBERS:
            return self._mismatch(e, target)
        if number.bits < 64:
            right = _instead_of_number(e, target) or "use LWORD"
            self._warn(e.pos, "narrowing", f"a pointer has 64 bits, {number} {number.bits}; {right}")
        return convert(e, target)

    def _address(self, e: AddressOf, target: PointerType) -> None:
        """The address of a variable as a pointer to something else. To look at it as bits, or as a part it begins with,
        is what such pointers are for."""
        found, wanted = e.place.type, target.target
        if not overlays(found, wanted):
            message = f"what {target} points to is read as {wanted}, but this is {found}"
            message = f"{message}; declare POINTER TO {found}, or convert the value"
            self._warn(e.pos, "pointer", message)

    def _to_interface(self, e: Expr, target: InterfaceType) -> Expr:
        """The address of an instance, or what another interface variable holds."""
        source = e.type.target if isinstance(e.type, PointerType) else e.type
        if not isinstance(source, StructType) or (
            isinstance(e.type, PointerType) and not isinstance(e.type, InterfaceType)
        ):
            if isinstance(e, AddressOf) and isinstance(source, StructType):
                message = f"{e.type} does not fit {target}; assign the instance itself, without ADR"
                return self._error(e.pos, "type", message)
            return self._mismatch(e, target)
        if not source.may_conform(target.target):
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
        if (source, target) in LONGER_DATES:
            return scaled(convert(e, target), BinaryOp.MUL, LONGER_DATES[source, target])
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
        elif source.bits < target.bits:
            self._widened(e, target)
        return convert(e, target)

    def _widened(self, e: Expr, target: Elementary) -> None:
        """Warns of what may have wrapped before it becomes a wider type."""
        long_product = target.kind is Kind.INT and isinstance(e, Binary) and e.op is BinaryOp.MUL and may_wrap(e)
        what = "product" if long_product else wrapping(e)
        if what:
            self._warn(
                e.pos,
                "widening",
                f"this {what} is calculated in {e.type} and only then becomes {target}; convert an operand",
            )

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
        lost = lost_fraction(e, target)
        if lost:
            self._warn(e.pos, "integer-division", lost)
            return convert(e, target)
        self._widened(e, target)
        if source.bits > (16 if target is REAL else 32) and not isinstance(e, Const):
            self._warn(e.pos, "precision", f"{e.type} becomes {target}: large values are rounded")
        return convert(e, target)


def _instead_of_number(e: Expr, target: Type) -> str:
    """What to write when a pointer and what it may point to are assigned to each other; "" when they do not match."""
    if isinstance(e, AddressOf):
        return f"a reference is given REF= {_written(e.place)}, an address is kept in an LWORD" * (
            e.place.type == target
        )
    place = e.place if isinstance(e, Load) else None
    if isinstance(e.type, PointerType):
        return f"what it points to is written {_written(place)}^" if e.type.target == target else ""
    to = target.target if isinstance(target, PointerType) else None
    return f"the address is written ADR({_written(place)})" if e.type == to else ""


def _written(place: Place | None) -> str:
    return place.var.name.rpartition(".")[2] if isinstance(place, VarPlace) else "..."


def _example(t: Elementary) -> str:
    """How a value of a date or character type is written."""
    if t.kind is Kind.CHAR:
        return f"{t}#'A'"
    return f"a literal such as {t}#{_FORMS[t.name.removeprefix('L')]}, or ULINT_TO_{t}(...)"
