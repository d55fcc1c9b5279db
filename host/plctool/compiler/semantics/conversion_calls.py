"""Conversions by name: `INT_TO_REAL`, `TO_STRING`, `REAL_TRUNC_INT`, `WORD_BCD_TO_UINT`, `TO_BIG_ENDIAN`.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from difflib import get_close_matches

from plctool.compiler.semantics import dates
from plctool.compiler.semantics.checker import is_untyped
from plctool.compiler.semantics.conversions import BITS, NUMBERS, SIGNED, UNSIGNED, convert, elementary, settle
from plctool.compiler.semantics.qualified_names import QualifiedNames
from plctool.compiler.semantics.symbols import ERROR, TypeSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Const, Expr, Intrinsic, IntrinsicCall
from plctool.compiler.types import (
    BOOL,
    DINT,
    DWORD,
    ELEMENTARY,
    INT,
    LWORD,
    UDINT,
    ULINT,
    WCHAR,
    Elementary,
    EnumType,
    Kind,
    StringType,
    SubrangeType,
    Type,
)  # fmt: skip

_CONVERSION = re.compile(r"(?:ANY_|(?P<source>\w+?)_)?(?P<how>TO|TRUNC)_(?P<target>\w+)")
_BITCAST = re.compile(r"(?P<source>[A-Z]+)_AS_(?P<target>[A-Z]+)")
_FROM_BCD = re.compile(r"(?:(?P<source>[A-Z]+)_)?BCD_TO_(?P<target>[A-Z]+)")
_TO_BCD = re.compile(r"(?:(?P<source>[A-Z]+)_)?TO_BCD(?:_(?P<target>[A-Z]+))?")
_ENDIAN = re.compile(r"(?:TO|FROM)_(?P<order>BIG|LITTLE)_ENDIAN")


class ConversionCalls(QualifiedNames):
    """Calls of functions with one argument whose name says what becomes of it."""

    def conversion(self, name: str, node: ast.Call, expected: Type | None) -> Expr | None:
        """The call of a conversion; None when the name is none."""
        if name in ("TRUNC", "TRUNC_INT"):
            return self._trunc(name, node, expected)
        if match := _ENDIAN.fullmatch(name):
            return self._byte_order(name, node, swaps=match["order"] == "BIG")
        for pattern, make in (
            (_CONVERSION, self._by_types), (_FROM_BCD, self._from_bcd), (_TO_BCD, self._to_bcd),
            (_BITCAST, self._bitcast),
        ):  # fmt: skip
            match = pattern.fullmatch(name)
            result = None if match is None else make(name, match, node)
            if result is not None:
                return result
        return None

    def _operand(self, name: str, node: ast.Call, wanted: Type | None = None) -> Expr:
        """The one argument, IN, as a value of `wanted`; the error value after a diagnosis."""
        if len(node.args) != 1:
            return self.error(node.pos, "arguments", f"{name} takes 1 argument, not {len(node.args)}")
        argument = node.args[0]
        if argument.value is None or argument.output or (argument.name or "IN").upper() != "IN":
            return self.error(argument.pos, "arguments", f"{name} has one argument, which is written IN := ...")
        e = self.expr(argument.value, wanted)
        return e if wanted is None else self.coerce(e, wanted)

    def conversion_hint(self, name: str) -> str:
        """`; did you mean INT_TO_STRING?` for a conversion with one type misspelt, else nothing."""
        match = _CONVERSION.fullmatch(name)
        if match is None:
            return ""
        for part, other in (("target", "source"), ("source", "target")):
            known = match[other] is None or self._conversion_type(match[other]) is not None
            close = get_close_matches(match[part] or "", [*ELEMENTARY, "STRING", "WSTRING"], n=1, cutoff=0.7)
            if known and close:
                return f"; did you mean {name[: match.start(part)]}{close[0]}{name[match.end(part) :]}?"
        return ""

    # ---- from type to type ----

    def _conversion_type(self, name: str) -> Type | None:
        if name in ELEMENTARY:
            return ELEMENTARY[name]
        if name in ("STRING", "WSTRING"):
            return StringType(255, name == "WSTRING")
        symbol = self.world.unit(name.casefold(), library=self.scope.library)
        if isinstance(symbol, TypeSymbol):
            t = self.world.declarations.resolve_symbol(symbol)
            return t if isinstance(t, EnumType | SubrangeType) else None
        return None

    def _by_types(self, name: str, match: re.Match[str], node: ast.Call) -> Expr | None:
        """`INT_TO_REAL(x)`, `TO_REAL(x)`, `REAL_TRUNC_INT(x)`"""
        source = self._conversion_type(match["source"]) if match["source"] else None
        target = self._conversion_type(match["target"])
        if target is None or (match["source"] and source is None):
            return None
        e = settle(self._operand(name, node, source))
        if e.type is ERROR:
            return e
        if match["how"] == "TRUNC":
            return self._truncated(name, e, target, node)
        if isinstance(e.type, StringType) or isinstance(target, StringType):
            return self._text_conversion(e, target, node)
        result = self.convert_explicitly(e, target)
        return result or self.error(node.pos, "type", f"there is no conversion from {e.type} to {target}")

    def _text_conversion(self, e: Expr, target: Type, node: ast.Call) -> Expr:
        """Conversions from and to text are functions of the library."""
        if isinstance(e.type, StringType) and isinstance(target, StringType):
            if e.type.wide is target.wide:
                return e
            return self.call_by_name(f"{e.type.keyword}_TO_{target.keyword}", [e], node.pos, None)
        base = elementary(e.type if isinstance(target, StringType) else target)
        if base is None:
            return self.error(node.pos, "type", f"there is no conversion from {e.type} to {target}")
        text_type = e.type if isinstance(e.type, StringType) else target
        if base is WCHAR and isinstance(text_type, StringType) and text_type.wide:
            name = "WCHAR_TO_WSTRING" if isinstance(target, StringType) else "WSTRING_TO_WCHAR"
            return self.call_by_name(name, [e], node.pos, None)
        if isinstance(target, StringType):
            text = self._text_of(convert(e, base), base, node)
            return self.call_by_name("STRING_TO_WSTRING", [text], node.pos, None) if target.wide else text
        if isinstance(e.type, StringType) and e.type.wide:
            e = self.call_by_name("WSTRING_TO_STRING", [e], node.pos, None)
        reader = "READ_INTEGER__" if base.kind in NUMBERS else f"STRING_TO_{base}"
        value = convert(self.call_by_name(reader, [e], node.pos, None), base)
        return self.coerce(value, target) if isinstance(target, SubrangeType) else convert(value, target)

    def _text_of(self, e: Expr, t: Elementary, node: ast.Call) -> Expr:
        """Integers are written as the widest of their kind in a register."""
        if t.kind in NUMBERS:
            t = (SIGNED if t.signed else UNSIGNED)[max(t.bits, 32)]
        return self.call_by_name(f"{t}_TO_STRING", [convert(e, t)], node.pos, None)

    def convert_explicitly(self, e: Expr, target: Type) -> Expr | None:
        """Any scalar as any other; None where it makes no sense."""
        source, to = elementary(e.type), elementary(target)
        if source is None or to is None:
            return None
        if isinstance(target, SubrangeType):
            return self.coerce(_scalar(e, source, to), target)
        result = _scalar(e, source, to)
        return result if target is to else convert(result, target)

    # ---- towards zero ----

    def _trunc(self, name: str, node: ast.Call, expected: Type | None) -> Expr:
        wanted = elementary(expected) if expected is not None else None
        target = INT if name == "TRUNC_INT" else DINT
        if name == "TRUNC" and wanted is not None and wanted.kind is Kind.INT:
            target = wanted
        return self._truncated(name, settle(self._operand(name, node)), target, node)

    def _truncated(self, name: str, e: Expr, target: Type, node: ast.Call) -> Expr:
        if e.type is ERROR:
            return e
        source, to = elementary(e.type), elementary(target)
        if source is None or source.kind is not Kind.REAL:
            return self.error(node.pos, "type", f"{name} needs a REAL or LREAL, not {e.type}")
        if to is None or to.kind not in NUMBERS:
            return self.error(node.pos, "type", f"{name} cannot give {target}; TRUNC gives integers")
        return self.coerce(_from_real(e, to, truncate=True), target)

    # ---- patterns of bits ----

    def _bitcast(self, name: str, match: re.Match[str], node: ast.Call) -> Expr | None:
        """`REAL_AS_DWORD(x)`: the bits, not the value."""
        source, target = ELEMENTARY.get(match["source"]), ELEMENTARY.get(match["target"])
        if source is None or target is None or source.bits != target.bits or BOOL in (source, target):
            return None
        return _bitcast(self._operand(name, node, source), target)

    def _byte_order(self, name: str, node: ast.Call, *, swaps: bool) -> Expr:
        """`TO_BIG_ENDIAN(x)`: the bytes of a scalar the other way round. All targets have the lowest one first."""
        e = settle(self._operand(name, node))
        base = elementary(e.type)
        if base is None:
            message = f"{name} takes a number, a duration, a date or a character, not {e.type}"
            return e if e.type is ERROR else self.error(node.pos, "type", message)
        if not swaps or base.bits == 8:
            return e
        bits = BITS[base.bits]
        is_real = base.kind is Kind.REAL
        pattern = _bitcast(e, bits) if is_real else convert(e, bits)
        swapped = self.call_by_name("SWAP", [pattern], node.pos, None)
        return _bitcast(swapped, base) if is_real else convert(swapped, e.type)

    # ---- binary coded decimals ----

    def _from_bcd(self, name: str, match: re.Match[str], node: ast.Call) -> Expr | None:
        """`WORD_BCD_TO_UINT(x)`, `BCD_TO_UINT(x)`"""
        source, target = ELEMENTARY.get(match["source"] or ""), ELEMENTARY.get(match["target"])
        if target is None or target.kind not in NUMBERS:
            return None
        if match["source"] and (source is None or source.kind is not Kind.BIT):
            return None
        e = self._number(name, node, source)
        if e.type is ERROR:
            return e
        wide = e.type.size == 8
        call = self.call_by_name(
            "FROM_LONG_BCD__" if wide else "FROM_BCD__", [convert(e, LWORD if wide else DWORD)], node.pos, None
        )
        return convert(call, target)

    def _to_bcd(self, name: str, match: re.Match[str], node: ast.Call) -> Expr | None:
        """`UINT_TO_BCD_WORD(x)`, `TO_BCD_WORD(x)`, `UINT_TO_BCD(x)`"""
        source, target = ELEMENTARY.get(match["source"] or ""), ELEMENTARY.get(match["target"] or "")
        if match["source"] and (source is None or source.kind not in NUMBERS):
            return None
        if target is None and source is not None and not match["target"]:
            target = BITS[source.bits]
        if target is None or target.kind is not Kind.BIT:
            return None
        e = self._number(name, node, source)
        base = elementary(e.type)
        if e.type is ERROR or base is None:
            return e
        if base.signed:
            e = IntrinsicCall(Intrinsic.MAX, [e, Const(0, base, e.pos)], base, e.pos)
        wide = base.bits == 64 or target.bits == 64
        call = self.call_by_name(
            "TO_LONG_BCD__" if wide else "TO_BCD__", [convert(e, ULINT if wide else UDINT)], node.pos, None
        )
        return convert(call, target)

    def _number(self, name: str, node: ast.Call, wanted: Type | None) -> Expr:
        """The argument as an integer or bit string."""
        e = self._operand(name, node, wanted)
        if is_untyped(e):
            e = settle(e)
        base = elementary(e.type)
        if base is None or base.kind not in NUMBERS:
            message = f"{name} needs an integer or a bit string, not {e.type}"
            return e if e.type is ERROR else self.error(node.pos, "type", message)
        return convert(e, base)


def _scalar(e: Expr, source: Elementary, to: Elementary) -> Expr:
    if e.type is not source:
        e = convert(e, source)
    if source is to:
        return e
    if source in dates.UNIT_NS and to in dates.UNIT_NS:
        return dates.convert_date(e, to)
    if to is BOOL:
        return convert(e, BOOL)
    if source.kind is Kind.REAL:
        return convert(e, to) if to.kind is Kind.REAL else _from_real(e, to)
    if to.kind is Kind.REAL and source.kind is not Kind.INT:
        e = convert(e, SIGNED[source.bits] if source.signed else UNSIGNED[source.bits])
    return convert(e, to)


def _from_real(e: Expr, to: Elementary, *, truncate: bool = False) -> Expr:
    """A real as a whole number, which a bit string, duration or date is as well."""
    number = SIGNED[to.bits] if to.signed else UNSIGNED[to.bits]
    return convert(convert(e, number, truncate=truncate), to)


def _bitcast(e: Expr, target: Elementary) -> Expr:
    return e if e.type is ERROR else IntrinsicCall(Intrinsic.BITCAST, [e], target, e.pos)
