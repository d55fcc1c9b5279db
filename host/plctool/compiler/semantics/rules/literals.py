"""Literals as constants.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics import constants, dates
from plctool.compiler.semantics.checker import Checker, checks
from plctool.compiler.semantics.conversions import NS_PER_MS, character, error_value, literal_type
from plctool.compiler.semantics.symbols import NULL_TYPE, UNTYPED_INT, UNTYPED_REAL
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Const, Expr, Pos
from plctool.iec.types import BOOL, ELEMENTARY, LTIME, TIME, TOD, StringType, Type


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
        return Const(0, NULL_TYPE, pos)
    if kind is ast.LiteralKind.BAD:
        return error_value(pos)
    return _typed_literal(c, node, pos)


def _text(c: Checker, node: ast.Literal, pos: Pos) -> Expr:
    assert isinstance(node.value, str)
    text = Const(node.value, StringType(len(node.value), node.kind is ast.LiteralKind.WSTRING), pos)
    if node.type_name not in ("CHAR", "WCHAR"):
        return text
    single = character(text, ELEMENTARY[node.type_name])
    return single or c.error(node.pos, "literal", f"a {node.type_name} is one character, not {len(node.value)}")


def _date(c: Checker, node: ast.Literal, pos: Pos) -> Expr:
    assert isinstance(node.value, int) and node.type_name is not None
    target = ELEMENTARY[node.type_name]
    value, rest = divmod(node.value, dates.UNIT_NS[target])
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
        days = longest * dates.UNIT_NS[target] // (86400 * 1000 * NS_PER_MS)
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
