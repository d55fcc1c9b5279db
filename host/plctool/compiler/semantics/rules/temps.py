"""Intermediate results of lists of instructions and diagrams: variables whose type is that of the value they are given.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.semantics.checker import Checker, checks
from plctool.compiler.semantics.conversions import elementary, settle
from plctool.compiler.semantics.once import hidden_place
from plctool.compiler.semantics.rules.places import copied
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Assign, Const, Expr, Load, Statement
from plctool.iec.types import Type


@checks(ast.Temp)
def temp(c: Checker, node: ast.Temp, expected: Type | None) -> Expr:
    """An intermediate result; a constant stays one, and takes the type of its surroundings."""
    value = c.temps.get(node.name)
    if value is None:
        return c.error(node.pos, "language", "nothing gives a result here before it is used; load a value first")
    return replace(value, pos=c.pos(node.pos))


def define_temp(c: Checker, node: ast.Temp, source: ast.Expr) -> list[Statement]:
    """The assignment of an intermediate result."""
    known = c.temps.get(node.name) if node.is_joined else None
    if known is not None:
        return _assign_again(c, node, source, known)
    value = c.expr(source)
    if value.type is ERROR or (isinstance(value, Const) and not node.is_joined):
        c.temps[node.name] = value
        return []
    value = copied(c, settle(value), node.pos)
    if value.type is ERROR:
        c.temps[node.name] = value
        return []
    place = hidden_place(c, value.type, c.pos(node.pos))
    c.temps[node.name] = Load(place, value.type, place.pos)
    return [Assign(place, value, place.pos)]


def _assign_again(c: Checker, node: ast.Temp, source: ast.Expr, known: Expr) -> list[Statement]:
    value = c.expr(source, known.type)
    if value.type is ERROR or not isinstance(known, Load):
        return []
    if not isinstance(value, Const) and elementary(value.type) is not elementary(known.type):
        name, line = node.name.removeprefix("@@"), known.place.pos.line
        c.error(
            source.pos,
            "type",
            f"{name} is reached with {value.type} here, and with {known.type} from line {line}; convert one of them",
        )
        return []
    value = c.coerce(value, known.type)
    return [] if value.type is ERROR else [Assign(known.place, value, c.pos(node.pos))]
