"""Calls of methods and actions, and what properties stand for.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.rules.arguments import bind, plain_arguments, typed_call
from plctool.compiler.semantics.rules.members import Bound, bound_member, instance_member, usable
from plctool.compiler.semantics.symbols import BlockInfo, ClassInfo, Member
from plctool.compiler.semantics.values import is_exact, load
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    Call,
    CallStatement,
    DerefPlace,
    Dispatch,
    Expr,
    Place,
    Pos,
    Pou,
    SelfPlace,
    Statement,
)
from plctool.iec.types import ReferenceType


def method_call(c: Checker, bound: Bound, node: ast.Call) -> Expr:
    """A call of a method or action."""
    args = plain_arguments(c, node)
    offset = node.callee.name_pos if isinstance(node.callee, ast.Member) else node.pos
    if args is None:
        return error_value(c.pos(node.pos))
    if bound.callable is None and bound.getter is not None:
        return c.error(offset, "call", f"{bound.cls.name}.{bound.key} is a property and is used without ()")
    member = usable(c, bound, bound.callable, offset)
    if member is None:
        return error_value(c.pos(node.pos))
    return _member_call(c, bound, member, args, node.pos, offset, formal=node.formal)


def _member_call(
    c: Checker,
    bound: Bound,
    member: Member,
    args: list[ast.Argument],
    offset: int,
    name_offset: int,
    *,
    formal: bool = False,
) -> Expr:
    place = bound.place
    if isinstance(place, SelfPlace) and place.exact and member.abstract:
        return c.error(name_offset, "inheritance", f"{member.name} is ABSTRACT and has no body to call")
    info = c.world.declared.member(member)
    dispatch = _dispatch_of(c, bound.cls, member.decl.member_key, place, info.pou)
    bound_args = bind(c, args, [(s.name, d) for s, d in info.parameters], info.pou.name, offset)
    if bound_args is None:
        return error_value(c.pos(offset))
    elsewhere = dispatch is not None or isinstance(place, DerefPlace)
    e = typed_call(c, info, dict(bound_args), offset, formal=formal, noted=not elsewhere)
    if isinstance(e, Call):
        e.instance, e.dispatch = place, dispatch
        if dispatch is not None and isinstance(place, SelfPlace):
            c.world.dispatches.note_own_call(c.scope.pou, dispatch, e.pos)
        elif elsewhere:
            c.world.dispatches.note_other_call(c.scope.pou, info.pou, dispatch, e.pos)
    return e


def _dispatch_of(c: Checker, cls: ClassInfo, key: str, place: Place | None, function: Pou) -> Dispatch | None:
    """None when the type of the instance is known."""
    if place is None or is_exact(place):
        return None
    return c.world.dispatches.dispatch(cls, key, function)


def body_dispatch(c: Checker, block: BlockInfo, instance: Place) -> Dispatch | None:
    """How the body of a function block is found when the instance may be of a derived one."""
    return None if block.cls is None else _dispatch_of(c, block.cls, "", instance, block.pou)


def property_value(c: Checker, bound: Bound, offset: int, name_offset: int) -> Expr:
    """The value of a property."""
    if bound.getter is None and bound.callable is not None:
        return c.error(name_offset, "call", f"{bound.key} is a method and is called with ()")
    if bound.getter is None and bound.setter is not None:
        return c.error(name_offset, "access", f"the property {bound.key} has no GET, it can only be written")
    member = usable(c, bound, bound.getter, name_offset)
    if member is None:
        return error_value(c.pos(offset))
    return followed(_member_call(c, bound, member, [], offset, name_offset))


def followed(e: Expr) -> Expr:
    """A result that is a REFERENCE TO stands for what it refers to."""
    if isinstance(e, Call) and isinstance(e.type, ReferenceType):
        return load(DerefPlace(e, e.type.target, e.pos))
    return e


def assigned_property(c: Checker, target: ast.Expr, *, referring: bool = False) -> Bound | None:
    """The property that an assignment is about; None when it is a variable, or what the property refers to.
    `referring`: for REF=, which gives a property that is a REFERENCE TO another target."""
    if not isinstance(target, ast.Name | ast.Member):
        return None
    bound = bound_member(c, target)
    if bound is None or bound.callable is not None:
        return None
    if bound.getter is None:
        return bound
    refers = isinstance(c.world.declared.member(bound.getter).result, ReferenceType)
    if referring:
        return bound if refers and bound.setter is not None else None
    return None if refers else bound


def assign_property(c: Checker, bound: Bound, target: ast.Expr, source: ast.Expr, pos: Pos) -> Statement | None:
    """Calls the SET of a property."""
    offset = target.name_pos if isinstance(target, ast.Member) else target.pos
    if bound.setter is None and bound.getter is not None:
        c.error(offset, "access", f"the property {bound.key} has no SET, it can only be read")
        return None
    member = usable(c, bound, bound.setter, offset)
    if member is None:
        return None
    e = _member_call(c, bound, member, [ast.Argument(source.pos, None, source)], target.pos, offset)
    return CallStatement(e, pos) if isinstance(e, Call) else None


def property_of(c: Checker, base: Expr, node: ast.Member) -> Expr | None:
    """`base.name` when it is a property; None when it is a variable. Methods need to be called."""
    bound = instance_member(c, base, node)
    if bound is None:
        return None
    if bound.callable is not None:
        return c.error(node.name_pos, "call", f"{bound.cls.name}.{node.name} is called with ()")
    return property_value(c, bound, node.pos, node.name_pos)
