"""Literals as constants, and the type that several values are brought to.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re

from plctool.compiler.semantics import arithmetic, constants
from plctool.compiler.semantics.checker import Checker, checks
from plctool.compiler.semantics.conversions import (
    BITS,
    NS_PER_MS,
    character,
    common_type,
    convert,
    elementary,
    error_value,
    is_narrow,
    is_untyped,
    literal_type,
    settle,
    whole_value,
)
from plctool.compiler.semantics.symbols import ERROR, NULL_TYPE, UNTYPED_INT, UNTYPED_REAL
from plctool.compiler.semantics.widths import has_whole_value
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Const, Expr, Pos
from plctool.iec.common_types import NUMBERS
from plctool.iec.types import (
    BOOL,
    CHAR,
    DINT,
    ELEMENTARY,
    LREAL,
    LTIME,
    REAL,
    TIME,
    TOD,
    WCHAR,
    Elementary,
    EnumType,
    Kind,
    PointerType,
    StringType,
    SubrangeType,
    Type,
)

# ---- literals ----

_ESCAPE = re.compile(r"(?:\\[nrt])+\Z")  # where it is no path, as a rule


@checks(ast.Literal)
def literal_value(c: Checker, node: ast.Literal, expected: Type | None) -> Expr:
    """A constant; a number without a type takes the one its surroundings need."""
    pos, value, kind = c.pos(node.pos), node.value, node.kind
    if kind is ast.LiteralKind.INT and node.type_name is None:
        assert isinstance(value, int)
        if literal_type(value) is None:
            return c.error(node.pos, "range", f"{value} fits no integer type")
        return Const(value, UNTYPED_INT, pos)
    if kind is ast.LiteralKind.REAL and node.type_name is None:
        return Const(value, UNTYPED_REAL, pos)
    if kind is ast.LiteralKind.BOOL:
        return Const(value, BOOL, pos)
    if kind in (ast.LiteralKind.STRING, ast.LiteralKind.WSTRING):
        return _text(c, node, pos)
    if kind is ast.LiteralKind.TIME:
        return _duration(c, node, pos)
    if kind is ast.LiteralKind.DATE:
        return _date(c, node, pos)
    if kind is ast.LiteralKind.NULL:
        named = c.scope.lookup("NULL") is not None or (isinstance(expected, EnumType) and expected.has("NULL"))
        return c.expr(ast.Name(node.pos, "NULL"), expected) if named else Const(0, NULL_TYPE, pos)
    if kind is ast.LiteralKind.BAD:
        return error_value(pos)
    return _typed_literal(c, node, pos)


def _text(c: Checker, node: ast.Literal, pos: Pos) -> Expr:
    assert isinstance(node.value, str)
    text = Const(node.value, StringType(len(node.value), node.kind is ast.LiteralKind.WSTRING), pos)
    if node.type_name not in ("CHAR", "WCHAR"):
        if escape := _ESCAPE.search(node.value):
            meant = escape[0].replace("\\", "$").upper()
            c.warning(node.pos, "escape", f"{escape[0]} is {len(escape[0])} characters; write {meant}")
        return text
    single = character(text, ELEMENTARY[node.type_name])
    return single or c.error(node.pos, "literal", f"a {node.type_name} is one character, not {len(node.value)}")


def _date(c: Checker, node: ast.Literal, pos: Pos) -> Expr:
    assert isinstance(node.value, int) and node.type_name is not None
    target = ELEMENTARY[node.type_name]
    value, rest = divmod(node.value, arithmetic.UNIT_NS[target])
    if rest:
        smallest = "milliseconds" if target is TOD else "seconds"
        c.warning(node.pos, "precision", f"{target} counts {smallest}; write L{target}#... for less")
    if not constants.fits(value, target):
        last = "2106-02-07" if target.bits == 32 else "2554-07-21"
        return c.error(node.pos, "range", f"this is too late for {target}, which ends on {last}")
    return Const(value, target, pos)


def _duration(c: Checker, node: ast.Literal, pos: Pos) -> Expr:
    assert isinstance(node.value, int)
    target, value = LTIME, node.value
    if node.type_name == "TIME":
        target, value = TIME, constants.divide(value, NS_PER_MS)
        if value * NS_PER_MS != node.value:
            c.warning(node.pos, "precision", "TIME counts milliseconds; write LTIME#... for less")
    if not constants.fits(value, target):
        longest = constants.limits(target)[1]
        if not 0 <= value <= 2 * longest + 1:
            return c.error(node.pos, "range", f"this duration is too long for {target}")
        days = longest * arithmetic.UNIT_NS[target] // (86400 * 1000 * NS_PER_MS)
        message = f"{target} has a sign, so it ends after {days} days; this is the longest one"
        c.warning(node.pos, "precision", message if target is LTIME else f"{message}; write LTIME#... for more")
        value = longest
    return Const(value, target, pos)


def _typed_literal(c: Checker, node: ast.Literal, pos: Pos) -> Expr:
    assert node.type_name is not None
    target: Type | None = ELEMENTARY.get(node.type_name)
    if target is None:
        target = c.world.declared.type_named(node.pos, node.type_name, c.scope)
    untyped = UNTYPED_INT if node.kind is ast.LiteralKind.INT else UNTYPED_REAL
    return c.coerce(Const(node.value, untyped, pos), target)


# ---- the type that several values are brought to ----


def untyped_bits(c: Checker, e: Expr, expected: Type | None) -> Expr:
    """An untyped constant as the operand of NOT or of a shift: of the type its surroundings would like."""
    base = elementary(expected) if expected is not None else None
    if base is not None and (base.kind in NUMBERS or base is BOOL):
        return c.coerce(e, base)
    return settle(e)


def match_literals(c: Checker, left: Expr, right: Expr, expected: Type | None) -> tuple[Expr, Expr]:
    """Gives an untyped constant the type of the other operand when it fits there."""
    if is_untyped(left) and not is_untyped(right):
        return _literal_for(c, left, right.type, expected), right
    if is_untyped(right) and not is_untyped(left):
        return left, _literal_for(c, right, left.type, expected)
    return left, right


def _literal_for(c: Checker, e: Expr, other: Type, expected: Type | None) -> Expr:
    t = elementary(other)
    assert isinstance(e, Const) and not isinstance(e.value, str)
    if isinstance(other, PointerType) and e.value == 0:
        return Const(0, other, e.pos)
    if t is None or t.kind in (Kind.TIME, Kind.DATE, Kind.CHAR):
        return settle(e)
    if t.kind is Kind.REAL:
        return c.coerce(e, t)
    if isinstance(e.value, float):
        if expected is REAL or expected is LREAL:
            return c.coerce(e, expected)
        return c.coerce(e, REAL if t.bits <= 16 else LREAL)
    if constants.fits(e.value, t):
        return Const(e.value, t, e.pos)
    if t.kind is Kind.BIT and e.value >= 0:
        return c.coerce(e, constants.smallest(e.value, tuple(BITS.values())) or t)
    return settle(e)


def common_of(c: Checker, values: list[Expr], name: str, offset: int, expected: Type | None) -> Type:
    """The type all arguments of `name` are brought to; ERROR after an error."""
    characters = [v.type for v in values if v.type in (CHAR, WCHAR)]
    if characters:  # beside them, a text constant of one character is one
        values = [character(v, characters[0]) or v for v in values]
    typed = [v.type for v in values if not is_untyped(v)]
    if not typed:
        base = elementary(expected) if expected is not None else None
        is_number = base is not None and base.kind in (Kind.INT, Kind.BIT, Kind.REAL)
        typed = [base] if base is not None and is_number else [settle(v, expected).type for v in values]
    result: Type | None = typed[0]
    for t in typed[1:]:
        result = None if result is None else common_type(result, t)
    for v in values:
        if result is not None and is_untyped(v):
            result = _literal_common(v, result, expected)
    if result is None:
        listed = " and ".join(dict.fromkeys(str(t) for t in typed))
        c.error(offset, "type", f"{name} cannot combine {listed}")
        return ERROR
    return result.base if isinstance(result, SubrangeType) else result


def wholly(
    c: Checker, values: list[Expr], name: str, offset: int, expected: Type | None
) -> tuple[Elementary | None, list[Expr]]:
    """The narrow type that arguments have in common, and what was computed for them in 32 bits. None, and the
    arguments as they are, when none was."""
    if not any(has_whole_value(value) for value in values):
        return None, values
    t = elementary(common_of(c, values, name, offset, expected))
    if t is None or not is_narrow(t):
        return None, values
    typed = [whole_value(value) for value in values]
    return t, [value if is_untyped(value) or not is_narrow(value.type) else convert(value, DINT) for value in typed]


def _literal_common(literal: Expr, t: Type, expected: Type | None) -> Type | None:
    """The common type of an untyped constant and a type: the type itself when the constant fits."""
    assert isinstance(literal, Const)
    base = elementary(t)
    if base is None:
        return t
    if isinstance(literal.value, float):
        if base.kind is Kind.INT:
            return expected if expected is REAL or expected is LREAL else LREAL if base.bits > 16 else REAL
        return t
    assert isinstance(literal.value, int)
    if base.kind not in NUMBERS or constants.fits(literal.value, base):
        return t
    return common_type(base, literal_type(literal.value) or base)
