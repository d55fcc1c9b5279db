"""Assignments.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.semantics.checker import Checker, checks, checks_statement
from plctool.compiler.semantics.conversions import elementary, error_value
from plctool.compiler.semantics.once import calls, kept_value
from plctool.compiler.semantics.rules.arguments import has_enable, input_value, parameter_names
from plctool.compiler.semantics.rules.builtin import attempt
from plctool.compiler.semantics.rules.call_statements import enabled
from plctool.compiler.semantics.rules.calls import assign_property, assigned_property
from plctool.compiler.semantics.rules.places import changeable_place, copied
from plctool.compiler.semantics.rules.temps import define_temp
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Assign, AssignedValue, Const, DerefPlace, Expr, If, Load, Pos, Statement
from plctool.iec.types import BOOL, OpenArrayType, ReferenceType, StructType, Type, is_scalar

_NOTHING = (ast.LiteralKind.NULL, ast.LiteralKind.INT)


@checks_statement(ast.Assign)
def assignment(c: Checker, node: ast.Assign) -> list[Statement]:
    """`a := b := e`, `a S= e`, `a R= e`, `r REF= x`, `i ?= x`"""
    if node.op is ast.Assigning.REFERENCE:
        return _assign_reference(c, node)
    if node.op is ast.Assigning.INTERFACE:
        return attempt(c, node)
    if node.op is not ast.Assigning.VALUE:
        return _set_or_reset(c, node)
    if isinstance(node.targets[0], ast.Temp):
        return define_temp(c, node.targets[0], node.value)
    if isinstance(node.value, ast.Call):
        declared = parameter_names(c, node.value)
        if has_enable(node.value, declared):
            return enabled(c, node.value, declared, lambda plain: assignment(c, replace(node, value=plain)))
    result: list[Statement] = []
    source, known = node.value, None
    for number, target in enumerate(reversed(node.targets), 1):
        statement = _assign_one(c, target, source, c.pos(node.pos), known)
        source, known = target, None
        if isinstance(statement, Assign) and number < len(node.targets) and calls(statement.target):
            first, known = kept_value(c, statement.value, statement.target.type)
            statement = replace(statement, value=first)
        if statement is not None:
            result.append(statement)
    return result


@checks(ast.Assigned)
def assigned_value(c: Checker, node: ast.Assigned, expected: Type | None) -> Expr:
    """`(a := e)` as a value, as C has it."""
    pos = c.pos(node.pos)
    if isinstance(expected, StructType) and isinstance(node.target, ast.Name) and expected.member(node.target.name):
        return c.error(node.pos, "type", "values by name are for declarations and calls; assign the members one by one")
    if node.bare and (t := c.expr(node.target).type) is not ERROR and elementary(t) is not BOOL:
        return c.error(node.pos, "type", "a comparison is written =; := assigns")
    assignment = _assign_one(c, node.target, node.value, pos)
    if not isinstance(assignment, Assign):
        if assignment is not None:
            c.error(node.pos, "type", "a property is assigned in a statement of its own")
        return error_value(pos)
    t = assignment.target.type
    if not is_scalar(t):
        return c.error(node.pos, "type", f"{t} is assigned in a statement of its own")
    c.warning(node.pos, "assignment", "this assigns, and the value is used as well; a comparison is written =")
    return AssignedValue(assignment, t, pos)


def _assign_one(
    c: Checker, target: ast.Expr, source: ast.Expr, pos: Pos, known: Expr | None = None
) -> Statement | None:
    """`known`: the value of `source`, if it is not to be worked out again."""
    bound = assigned_property(c, target)
    if bound is not None:
        return assign_property(c, bound, target, source, pos)
    place = changeable_place(c, target, "the left side of :=", "be assigned to")
    if place is None:
        c.expr(source)
        return None
    value = c.coerce(c.expr(source, place.type) if known is None else known, place.type)
    if value.type is ERROR:
        return None
    if isinstance(place.type, OpenArrayType):
        c.error(target.pos, "type", "an ARRAY[*] cannot be assigned as a whole; assign its elements in a loop")
        return None
    value = copied(c, value, target.pos, place)
    return None if value.type is ERROR else Assign(place, value, pos)


def _assign_reference(c: Checker, node: ast.Assign) -> list[Statement]:
    """`r REF= x` lets r refer to x; `r REF= NULL`, as `r REF= 0`, to nothing."""
    target, pos = node.targets[0], c.pos(node.pos)
    bound = assigned_property(c, target, referring=True)
    if bound is not None:
        statement = assign_property(c, bound, target, node.value, pos)
        return [] if statement is None else [statement]
    place = changeable_place(c, target, "the left side of REF=", "be assigned to")
    pointer = place.pointer if isinstance(place, DerefPlace) else None
    if not isinstance(pointer, Load) or not isinstance(pointer.type, ReferenceType):
        if place is not None:
            c.error(target.pos, "type", f"the left side of REF= is a REFERENCE TO, not {place.type}")
        return []
    if isinstance(node.value, ast.Literal) and node.value.value == 0 and node.value.kind in _NOTHING:
        return [Assign(pointer.place, Const(0, pointer.type, pos), pos)]
    called = node.value.callee if isinstance(node.value, ast.Call) else None
    if isinstance(called, ast.Name) and called.name.upper() == "ADR":
        c.error(node.value.pos, "type", "REF= takes the variable itself, without ADR")
        return []
    value = input_value(c, node.value, pointer.type, "reference")
    return [] if value.type is ERROR else [Assign(pointer.place, value, pos)]


def _set_or_reset(c: Checker, node: ast.Assign) -> list[Statement]:
    """`x S= condition` sets x and never resets it; in `x S= y R= condition` each target heeds the condition."""
    pos = c.pos(node.pos)
    targets = [(node.op, node.targets[0]), *node.others]
    changes = [_changed(c, op, target, pos) for op, target in reversed(targets)]
    condition = c.condition(node.value)
    found = [change for change in changes if change is not None]
    if condition.type is ERROR or len(found) < len(changes):
        return []
    return [If([(condition, list(found))], [], pos)]


def _changed(c: Checker, op: ast.Assigning, target: ast.Expr, pos: Pos) -> Assign | None:
    """What S= or R= does where the condition is TRUE; None after an error."""
    place = changeable_place(c, target, f"the left side of {op}", "be assigned to")
    if place is None:
        return None
    if place.type is not BOOL:
        c.error(target.pos, "type", f"{op} needs a BOOL variable, not {place.type}")
        return None
    return Assign(place, Const(int(op is ast.Assigning.SET), BOOL, pos), pos)


@checks(ast.TypeArgument)
def type_argument(c: Checker, node: ast.TypeArgument, expected: Type | None) -> Expr:
    """A type where a value is wanted; what takes a type does not ask for its value."""
    return c.error(node.pos, "type", "this is a type, but a value is needed here")
