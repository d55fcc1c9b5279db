"""Conversions by name: `INT_TO_REAL`, `TO_STRING`, `REAL_TRUNC_INT`, `WORD_BCD_TO_UINT`, `TO_BIG_ENDIAN`.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable
from difflib import get_close_matches

from plctool.compiler.base.source import Source
from plctool.compiler.semantics import arithmetic
from plctool.compiler.semantics.arithmetic import as_number
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import BITS, UNSIGNED, convert, elementary, finally_cut, is_untyped, settle
from plctool.compiler.semantics.pitfalls import lost_fraction, misread, not_a_value
from plctool.compiler.semantics.rules.library_calls import call_by_name
from plctool.compiler.semantics.symbols import ERROR, PouSymbol, TypeSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.parser import parse
from plctool.compiler.typed.nodes import Call, Const, Expr, Intrinsic, IntrinsicCall, Rounding
from plctool.iec.common_types import NUMBERS, SIGNED
from plctool.iec.types import (
    BOOL,
    DINT,
    DWORD,
    ELEMENTARY,
    INT,
    LINT,
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
)

# ---- TO_STRING of an enumeration with {attribute 'to_string'} ----


def value_name(c: Checker, e: Expr, offset: int) -> Expr:
    """The name of a value, by a function made for its enumeration; the number of one without a name."""
    t = e.type
    assert isinstance(t, EnumType)
    made = c.world.enumeration_texts
    symbol = made.get(t)
    if symbol is None:
        symbol = made[t] = _function(t, len(made) + 1)
    info = c.world.declared.function(symbol, {})
    assert info is not None and info.result is not None
    return Call(info.pou, [convert(e, t.base)], info.result, c.pos(offset))


def _function(t: EnumType, number: int) -> PouSymbol:
    """`CASE value OF 1: NAME := 'Run'; ...`"""
    name, wide = f"VALUE_NAME_{number}__", "LINT" if t.base.signed else "ULINT"
    first: dict[int, str] = {}
    for value_name_, value in t.values.items():
        first.setdefault(value, value_name_)
    branches = "\n".join(f"{value}: {name} := '{written}';" for value, written in first.items())
    text = f"""FUNCTION {name} : STRING
VAR_INPUT value : {t.base}; END_VAR
CASE value OF
{branches}
ELSE {name} := {wide}_TO_STRING({t.base}_TO_{wide}(value));
END_CASE
END_FUNCTION
"""
    (decl,) = parse(Source("stdlib/enumerations.st", text), _no_error)
    assert isinstance(decl, ast.PouDecl)
    return PouSymbol(decl, library=True)


def _no_error(offset: int, code: str, message: str) -> None:
    raise AssertionError(message)


# ---- conversions by name ----

_Rule = Callable[[ast.Call, Type | None], Expr]

_CONVERSION = re.compile(r"(?:ANY_|(?P<source>\w+?)_)?(?P<how>TO|TRUNC)_(?P<target>\w+)")
_BITCAST = re.compile(r"(?P<source>[A-Z]+)_AS_(?P<target>[A-Z]+)")
_FROM_BCD = re.compile(r"(?:(?P<source>[A-Z]+)_)?BCD_TO_(?P<target>[A-Z]+)")
_TO_BCD = re.compile(r"(?:(?P<source>[A-Z]+)_)?TO_BCD(?:_(?P<target>[A-Z]+))?")
_ENDIAN = re.compile(r"(?:TO|FROM)_(?P<order>BIG|LITTLE)_ENDIAN")


def find_conversion(c: Checker, name: str) -> Callable[[ast.Call, Type | None], Expr] | None:
    """The rule of a conversion; None when the name is not one."""
    if name in ("TRUNC", "TRUNC_INT"):
        return lambda node, expected: _trunc(c, name, node, expected)
    if endian := _ENDIAN.fullmatch(name):
        return lambda node, expected: _byte_order(c, name, node, swaps=endian["order"] == "BIG")
    for pattern, find in _PATTERNS:
        match = pattern.fullmatch(name)
        rule = None if match is None else find(c, name, match)
        if rule is not None:
            return rule
    return None


def _operand(c: Checker, name: str, node: ast.Call, wanted: Type | None = None) -> Expr:
    """The one argument, IN, as a value of `wanted`; the error value after an error."""
    if len(node.args) != 1:
        return c.error(node.pos, "arguments", f"{name} takes 1 argument, not {len(node.args)}")
    argument = node.args[0]
    if argument.value is None or argument.output or (argument.name or "IN").upper() != "IN":
        return c.error(argument.pos, "arguments", f"{name} has one argument, which is written IN := ...")
    e = c.expr(argument.value, wanted)
    return e if wanted is None or e.type is wanted else c.coerce(e, wanted)


def conversion_hint(c: Checker, name: str) -> str:
    """`; did you mean INT_TO_STRING?` for a conversion with one type misspelt, else nothing."""
    match = _CONVERSION.fullmatch(name)
    if match is None:
        return ""
    for part, other in (("target", "source"), ("source", "target")):
        known = match[other] is None or _conversion_type(c, match[other]) is not None
        close = get_close_matches(match[part] or "", [*ELEMENTARY, "STRING", "WSTRING"], n=1, cutoff=0.7)
        if known and close:
            return f"; did you mean {name[: match.start(part)]}{close[0]}{name[match.end(part) :]}?"
    return ""


def _conversion_type(c: Checker, name: str) -> Type | None:
    if name in ELEMENTARY:
        return ELEMENTARY[name]
    if name in ("STRING", "WSTRING"):
        return StringType(255, name == "WSTRING")
    symbol = c.world.names.unit(name.casefold(), library=c.scope.library)
    if isinstance(symbol, TypeSymbol):
        t = c.world.declared.type_of(symbol)
        return t if isinstance(t, EnumType | SubrangeType) else None
    return None


def _by_types(c: Checker, name: str, match: re.Match[str]) -> _Rule | None:
    """`INT_TO_REAL(x)`, `TO_REAL(x)`, `REAL_TRUNC_INT(x)`"""
    source = _conversion_type(c, match["source"]) if match["source"] else None
    target = _conversion_type(c, match["target"])
    if target is None or (match["source"] and source is None):
        return None
    truncates = match["how"] == "TRUNC"
    return lambda node, expected: _converted(c, name, source, target, node, truncates=truncates)


def _converted(c: Checker, name: str, source: Type | None, target: Type, node: ast.Call, *, truncates: bool) -> Expr:
    e = as_number(settle(_operand(c, name, node, source)))
    if e.type is ERROR:
        return e
    if truncates:
        return _truncated(c, name, e, target, node)
    if isinstance(e.type, StringType) or isinstance(target, StringType):
        return _text_conversion(c, e, target, node)
    if isinstance(target, Elementary) and target.kind is Kind.REAL:
        lost = lost_fraction(e, target, explicit=True)
        if lost:
            c.warning(node.args[0].pos, "integer-division", lost)
    result = convert_explicitly(c, e, target)
    if result is None:
        return c.error(node.pos, "type", f"there is no conversion from {e.type} to {target}")
    to = elementary(target)
    as_elsewhere = to is not None and to.kind is Kind.BIT and c.dialect.reals_wrap
    if to is not None and not as_elsewhere and isinstance(e, Const) and isinstance(e.value, float):
        _tell(c, node, not_a_value(e.value, result, to))
    return result


def _tell(c: Checker, node: ast.Call, message: str) -> None:
    """Of a constant argument that systems convert in different ways."""
    if message:
        c.warning(node.args[0].pos, "conversion", message)


def _text_conversion(c: Checker, e: Expr, target: Type, node: ast.Call) -> Expr:
    """Conversions from and to text are functions of the library."""
    if isinstance(e.type, StringType) and isinstance(target, StringType):
        if e.type.wide is target.wide:
            return e
        return call_by_name(c, f"{e.type.keyword}_TO_{target.keyword}", [e], node.pos, None)
    base = elementary(e.type if isinstance(target, StringType) else target)
    if base is None:
        return c.error(node.pos, "type", f"there is no conversion from {e.type} to {target}")
    text_type = e.type if isinstance(e.type, StringType) else target
    if base is WCHAR and isinstance(text_type, StringType) and text_type.wide:
        name = "WCHAR_TO_WSTRING" if isinstance(target, StringType) else "WSTRING_TO_WCHAR"
        return call_by_name(c, name, [e], node.pos, None)
    if isinstance(target, StringType):
        named = isinstance(e.type, EnumType) and e.type.named
        text = value_name(c, e, node.pos) if named else _text_of(c, convert(e, base), base, node)
        return call_by_name(c, "STRING_TO_WSTRING", [text], node.pos, None) if target.wide else text
    if isinstance(e, Const) and isinstance(e.value, str):
        _tell(c, node, misread(e.value, base))
    if isinstance(e.type, StringType) and e.type.wide:
        e = call_by_name(c, "WSTRING_TO_STRING", [e], node.pos, None)
    reader = "READ_INTEGER__" if base.kind in NUMBERS else f"STRING_TO_{base}"
    value = convert(call_by_name(c, reader, [e], node.pos, None), base)
    return c.coerce(value, target) if isinstance(target, SubrangeType) else convert(value, target)


def _text_of(c: Checker, e: Expr, t: Elementary, node: ast.Call) -> Expr:
    """Integers are written as the widest of their kind in a register."""
    if t.kind in NUMBERS:
        t = (SIGNED if t.signed else UNSIGNED)[max(t.bits, 32)]
    return call_by_name(c, f"{t}_TO_STRING", [convert(e, t)], node.pos, None)


def convert_explicitly(c: Checker, e: Expr, target: Type) -> Expr | None:
    """Any scalar as any other; None where it makes no sense."""
    source, to = elementary(e.type), elementary(target)
    if source is None or to is None:
        return None
    if isinstance(target, SubrangeType):
        return c.coerce(_scalar(c, e, source, to), target)
    result = _scalar(c, e, source, to)
    return result if target is to else convert(result, target)


def _trunc(c: Checker, name: str, node: ast.Call, expected: Type | None) -> Expr:
    wanted = elementary(expected) if expected is not None else None
    target = INT if name == "TRUNC_INT" else DINT
    if name == "TRUNC" and wanted is not None and wanted.kind is Kind.INT:
        target = wanted
    return _truncated(c, name, settle(_operand(c, name, node)), target, node)


def _truncated(c: Checker, name: str, e: Expr, target: Type, node: ast.Call) -> Expr:
    if e.type is ERROR:
        return e
    source, to = elementary(e.type), elementary(target)
    if source is None or source.kind is not Kind.REAL:
        return c.error(node.pos, "type", f"{name} needs a REAL or LREAL, not {e.type}")
    if to is None or to.kind not in NUMBERS:
        return c.error(node.pos, "type", f"{name} cannot give {target}; TRUNC gives integers")
    return c.coerce(_from_real(e, to, rounding=Rounding.ZERO), target)


def _bitcast_call(c: Checker, name: str, match: re.Match[str]) -> _Rule | None:
    """`REAL_AS_DWORD(x)`: the bits, not the value."""
    source, target = ELEMENTARY.get(match["source"]), ELEMENTARY.get(match["target"])
    if source is None or target is None or source.bits != target.bits or BOOL in (source, target):
        return None
    return lambda node, expected: _bitcast(_operand(c, name, node, source), target)


def _byte_order(c: Checker, name: str, node: ast.Call, *, swaps: bool) -> Expr:
    """`TO_BIG_ENDIAN(x)`: the bytes of a scalar the other way round. All targets have the lowest one first."""
    e = settle(_operand(c, name, node))
    base = elementary(e.type)
    if base is None:
        message = f"{name} takes a number, a duration, a date or a character, not {e.type}"
        return e if e.type is ERROR else c.error(node.pos, "type", message)
    if not swaps or base.bits == 8:
        return e
    bits = BITS[base.bits]
    is_real = base.kind is Kind.REAL
    pattern = _bitcast(e, bits) if is_real else convert(e, bits)
    swapped = call_by_name(c, "SWAP", [pattern], node.pos, None)
    return _bitcast(swapped, base) if is_real else convert(swapped, e.type)


def _from_bcd(c: Checker, name: str, match: re.Match[str]) -> _Rule | None:
    """`WORD_BCD_TO_UINT(x)`, `BCD_TO_UINT(x)`"""
    source, target = ELEMENTARY.get(match["source"] or ""), ELEMENTARY.get(match["target"])
    if target is None or target.kind not in NUMBERS:
        return None
    if match["source"] and (source is None or source.kind is not Kind.BIT):
        return None
    return lambda node, expected: _read_bcd(c, name, source, target, node)


def _read_bcd(c: Checker, name: str, source: Elementary | None, target: Elementary, node: ast.Call) -> Expr:
    e = _number(c, name, node, source)
    if e.type is ERROR:
        return e
    wide = e.type.size == 8
    call = call_by_name(
        c, "FROM_LONG_BCD__" if wide else "FROM_BCD__", [convert(e, LWORD if wide else DWORD)], node.pos, None
    )
    return convert(call, target)


def _to_bcd(c: Checker, name: str, match: re.Match[str]) -> _Rule | None:
    """`UINT_TO_BCD_WORD(x)`, `TO_BCD_WORD(x)`, `UINT_TO_BCD(x)`"""
    source, target = ELEMENTARY.get(match["source"] or ""), ELEMENTARY.get(match["target"] or "")
    if match["source"] and (source is None or source.kind not in NUMBERS):
        return None
    if target is None and source is not None and not match["target"]:
        target = BITS[source.bits]
    if target is None or target.kind is not Kind.BIT:
        return None
    return lambda node, expected: _written_bcd(c, name, source, target, node)


def _written_bcd(c: Checker, name: str, source: Elementary | None, target: Elementary, node: ast.Call) -> Expr:
    e = _number(c, name, node, source)
    base = elementary(e.type)
    if e.type is ERROR or base is None:
        return e
    if base.signed:
        e = IntrinsicCall(Intrinsic.MAX, [e, Const(0, base, e.pos)], base, e.pos)
    wide = base.bits == 64 or target.bits == 64
    call = call_by_name(
        c, "TO_LONG_BCD__" if wide else "TO_BCD__", [convert(e, ULINT if wide else UDINT)], node.pos, None
    )
    return convert(call, target)


def _number(c: Checker, name: str, node: ast.Call, wanted: Type | None) -> Expr:
    """The argument as an integer or bit string."""
    e = _operand(c, name, node, wanted)
    if is_untyped(e):
        e = settle(e)
    base = elementary(e.type)
    if base is None or base.kind not in NUMBERS:
        message = f"{name} needs an integer or a bit string, not {e.type}"
        return e if e.type is ERROR else c.error(node.pos, "type", message)
    return convert(e, base)


def _scalar(c: Checker, e: Expr, source: Elementary, to: Elementary) -> Expr:
    if e.type is not source:
        e = convert(e, source)
    if source is to:
        return finally_cut(e)
    if source in arithmetic.UNIT_NS and to in arithmetic.UNIT_NS:
        return arithmetic.convert_date(e, to)
    if to is BOOL:
        return convert(e, BOOL)
    if source.kind is Kind.REAL:
        if to.kind is Kind.BIT and c.dialect.reals_wrap:
            return convert(convert(e, LINT, rounding=Rounding.AWAY), to)
        return convert(e, to) if to.kind is Kind.REAL else _from_real(e, to)
    if to.kind is Kind.REAL and source.kind is not Kind.INT:
        e = convert(e, SIGNED[source.bits] if source.signed else UNSIGNED[source.bits])
    return convert(e, to)


def _from_real(e: Expr, to: Elementary, *, rounding: Rounding = Rounding.EVEN) -> Expr:
    """A real as a whole number, which a bit string, duration or date is as well."""
    number = SIGNED[to.bits] if to.signed else UNSIGNED[to.bits]
    return convert(convert(e, number, rounding=rounding), to)


def _bitcast(e: Expr, target: Elementary) -> Expr:
    return e if e.type is ERROR else IntrinsicCall(Intrinsic.BITCAST, [e], target, e.pos)


_PATTERNS = (
    (_CONVERSION, _by_types), (_FROM_BCD, _from_bcd), (_TO_BCD, _to_bcd), (_BITCAST, _bitcast_call),
)  # fmt: skip
