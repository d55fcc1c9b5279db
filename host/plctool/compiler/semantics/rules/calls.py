"""Calls that have a value: of functions, of methods, of what is built in, and of properties.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.semantics.checker import Checker, checks
from plctool.compiler.semantics.conversions import error_value, is_exact, load
from plctool.compiler.semantics.rules.arguments import bind, declared_names, plain_arguments, typed_call
from plctool.compiler.semantics.rules.callees import (
    Builtin,
    Called,
    Function,
    Member,
    NotCallable,
    Overload,
    Special,
    TextFunction,
    TypedForm,
    Unknown,
    resolve_callee,
)
from plctool.compiler.semantics.rules.intrinsics import overloaded_form
from plctool.compiler.semantics.rules.library_calls import call_symbol, call_text_function, overload_call
from plctool.compiler.semantics.rules.members import Bound, bound_member, instance_member, usable
from plctool.compiler.semantics.symbols import ERROR, BlockInfo, ClassInfo, PouSymbol, Role, VarSymbol
from plctool.compiler.semantics.symbols import Member as ClassMember
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    Call,
    CallStatement,
    DerefPlace,
    Dispatch,
    Expr,
    Load,
    MemberPlace,
    Place,
    Pos,
    Pou,
    SelfPlace,
    Statement,
)
from plctool.iec.types import ReferenceType, StructType, Type

# ---- methods, actions and properties ----


def method_call(c: Checker, bound: Bound, node: ast.Call) -> Expr:
    """A call of a method or action."""
    args = plain_arguments(c, node, declared_names(bound.callable))
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
    member: ClassMember,
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


# ---- functions and what is built in ----


@checks(ast.Call)
def called_value(c: Checker, node: ast.Call, expected: Type | None) -> Expr:
    """The value of a call, or what it refers to."""
    return followed(call(c, node, expected))


def call(c: Checker, node: ast.Call, expected: Type | None) -> Expr:
    """A call as a value, or as a statement when it is not one of a function block."""
    callee, node = resolve_callee(c, node)
    match callee:
        case Special(rule):
            return rule(node, expected)
        case Member(bound):
            return method_call(c, bound, node)
        case Called():
            return _call_of_place(c, node)
        case Function(symbol):
            return _call_function(c, symbol, node, expected)
    args = plain_arguments(c, node)
    if args is None:
        return error_value(c.pos(node.pos))
    return _call_by_name(c, callee, replace(node, args=args), expected)


def _call_by_name(
    c: Checker,
    callee: Builtin | TextFunction | Overload | TypedForm | NotCallable | Unknown,
    node: ast.Call,
    expected: Type | None,
) -> Expr:
    """A call of what is built in or overloaded, or of what cannot be called."""
    offset = node.callee.pos
    match callee:
        case Builtin(rule):
            return rule(node, expected)
        case TextFunction(symbol):
            return call_text_function(c, symbol, node)
        case Overload(name):
            return overload_call(c, name, node, expected)
        case TypedForm():
            return call(c, overloaded_form(node) or node, expected)
        case NotCallable(code, message):
            return c.error(offset, code, message)
        case Unknown(inherited=True):
            return error_value(c.pos(node.pos))
        case Unknown(name, hint) if hint:
            return c.error(offset, "unknown", f"unknown function {name}{hint}")
        case Unknown(name):
            return c.missing(offset, name, f"unknown function {name}")


def called_variable(c: Checker, node: ast.Call) -> Expr | None:
    """`timer.start()`: an error for a variable that a block of the library has for its own use; None for all else."""
    callee = node.callee
    if not isinstance(callee, ast.Member) or not isinstance(callee.base, ast.Name):
        return None
    symbol = c.scope.lookup(callee.base.name)
    t = symbol.type if isinstance(symbol, VarSymbol) else None
    block = c.world.blocks.get(t) if isinstance(t, StructType) else None
    member = None if block is None else block.members.get(callee.name.casefold())
    if block is None or t is None or member is None or member.role is not Role.LOCAL:
        return None
    unit = c.scope.unit(t.name)
    if not isinstance(unit, PouSymbol) or not unit.library:
        return None
    inputs = ", ".join(f"{s.name} := ..." for s in block.members.values() if s.role is Role.INPUT)
    message = f"{t} has no method {callee.name}; write {callee.base.name}({inputs})"
    return c.error(callee.name_pos, "call", message)


def _call_of_place(c: Checker, node: ast.Call) -> Expr:
    started = called_variable(c, node)
    if started is not None:
        return started
    e = c.expr(node.callee)
    if e.type is ERROR:
        return e
    if isinstance(e.type, StructType) and e.type in c.world.blocks:
        outputs = (s.name for s in c.world.blocks[e.type].members.values() if s.role is Role.OUTPUT)
        name, output = node.callee.name if isinstance(node.callee, ast.Name) else "", next(outputs, "")
        read = f"; call it first, then read {name}.{output}" if name and output else ""
        message = f"a call of the function block {e.type} is a statement and has no value{read}"
        return c.error(node.pos, "call", message)
    if isinstance(node.callee, ast.Member) and isinstance(e, Load) and not node.args:
        owner = e.place.base.type if isinstance(e.place, MemberPlace) else None
        of = f" of {owner}" if owner is not None else ""
        return c.error(node.pos, "call", f"{node.callee.name} is a variable{of}, not a method; leave out ()")
    return c.error(node.pos, "call", f"{e.type} cannot be called")


def _call_function(c: Checker, symbol: PouSymbol, node: ast.Call, expected: Type | None) -> Expr:
    if not c.scope.may_use(symbol, symbol.decl.name, node.callee.pos):
        return error_value(c.pos(node.pos))
    args = plain_arguments(c, node, declared_names(symbol))
    if args is None:
        return error_value(c.pos(node.pos))
    return call_symbol(c, symbol, args, node.pos, expected, formal=node.formal)
