"""What can be asked of instances: __QUERYINTERFACE, __QUERYPOINTER and ?=.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.rules.places import changeable_place
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.semantics.values import place_of
from plctool.compiler.syntax import ast
from plctool.compiler.typed import AddressOf, Call, CallStatement, DerefPlace, Expr, Load, Place, Pos, Statement
from plctool.iec.types import BOOL, InterfaceType, PointerType, ReferenceType, StructType, Type

_INTERFACE, _POINTER = "an interface", "a pointer to a function block"
QUERIES = {"__QUERYINTERFACE": _INTERFACE, "__QUERYPOINTER": _POINTER}
"""The functions, and what each needs to know."""


def query(c: Checker, node: ast.Call) -> Expr:
    """`__QUERYINTERFACE(source, target)`: whether the instance is what the target may hold, which is then there."""
    assert isinstance(node.callee, ast.Name)
    name = node.callee.name.upper()
    wanted = QUERIES[name]
    args = [a.value for a in node.args if a.value is not None and a.name is None]
    if len(node.args) != 2 or len(args) != 2:
        return c.error(node.pos, "arguments", f"{name} takes 2 arguments: what is asked, and {wanted}")
    target = changeable_place(c, args[1], f"the second argument of {name}", "take an address")
    t = None if target is None else target.type
    if t is not None and not (_takes_instances(c, t) and isinstance(t, InterfaceType) is (wanted == _INTERFACE)):
        return c.error(args[1].pos, "type", f"the second argument of {name} is {wanted}, not {t}")
    return _ask(c, name, args[0], target, c.pos(node.pos))


def attempt(c: Checker, node: ast.Assign) -> list[Statement]:
    """`target ?= source`: the target holds the instance of the source if it may, and else NULL."""
    pos = c.pos(node.pos)
    target = changeable_place(c, node.targets[0], "the left side of ?=", "take an address")
    reference = target.pointer if isinstance(target, DerefPlace) else None
    if isinstance(reference, Load) and isinstance(reference.type, ReferenceType):
        target = reference.place
    if target is not None and not _takes_instances(c, target.type):
        wanted = f"{_INTERFACE}, a reference or {_POINTER}"
        c.error(node.targets[0].pos, "type", f"the left side of ?= is {wanted}, not {target.type}; write :=")
        return []
    asked = _ask(c, "?=", node.value, target, pos)
    return [CallStatement(asked, pos)] if isinstance(asked, Call) else []


def _takes_instances(c: Checker, t: Type) -> bool:
    return isinstance(t, PointerType) and c.world.class_of(t.target) is not None


def _ask(c: Checker, name: str, node: ast.Expr, target: Place | None, pos: Pos) -> Expr:
    """Whether the instance that `node` gives is what the target may hold, which is then there."""
    source = c.expr(node)
    if source.type is ERROR or target is None:
        return error_value(pos)
    if isinstance(source.type, StructType):
        source = AddressOf(place_of(source), PointerType(source.type), source.pos)
    cls = c.world.class_of(source.type.target) if isinstance(source.type, PointerType) else None
    if cls is None or not isinstance(source.type, PointerType):
        message = f"{name} asks an instance, an interface or a pointer to a function block, not {source.type}"
        return c.error(node.pos, "type", message)
    assert isinstance(target.type, PointerType)
    function = c.world.dispatches.queries.function(cls, source.type, target.type, pos)
    return Call(function, [source, target], BOOL, pos)
