"""Methods, actions and properties: which of them a name stands for.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass

from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.rules.access import accessible
from plctool.compiler.semantics.rules.qualified_names import called_program, dotted_name, is_namespace, space_of
from plctool.compiler.semantics.symbols import (
    ERROR,
    ClassInfo,
    Member,
    MemberSymbol,
    PouSymbol,
    Role,
    TypeSymbol,
    VarSymbol,
)
from plctool.compiler.semantics.values import place_of
from plctool.compiler.syntax import ast
from plctool.compiler.typed import AddressOf, DerefPlace, Expr, Place, SelfPlace
from plctool.iec.types import InterfaceType, StructType


@dataclass
class Bound:
    """A member and the instance it is called on; None for a member of a program."""

    cls: ClassInfo
    key: str  # without .get and .set
    place: Place | None

    @property
    def callable(self) -> Member | None:
        """The method or action; None for a property."""
        return self.cls.find(self.key)

    @property
    def getter(self) -> Member | None:
        """The GET of the property."""
        return self.cls.find(f"{self.key}.get")

    @property
    def setter(self) -> Member | None:
        """The SET of the property."""
        return self.cls.find(f"{self.key}.set")

    @property
    def exists(self) -> bool:
        """Whether the class has any of them."""
        return self.callable is not None or self.getter is not None or self.setter is not None


def bound_member(c: Checker, node: ast.Expr, *, called: bool = False) -> Bound | None:
    """What `m`, `fb.m` or `prog.m` stands for when it is a method, action or property. `called`: the name of the
    method around is not its result."""
    if not c.world.names.has_members:
        return None
    if isinstance(node, ast.Name):
        symbol = c.scope.lookup(node.name)
        if called and isinstance(symbol, VarSymbol) and symbol.role is Role.RESULT:
            symbol = c.scope.outer.get(node.name.casefold())
        return own_member(c, node.name) if isinstance(symbol, MemberSymbol) else None
    if not isinstance(node, ast.Member):
        return None
    space = space_of(c, node.base)
    if space is not None:
        return None if space.cls is None else _existing(Bound(space.cls, node.name.casefold(), None))
    if isinstance(node.base, ast.Name) and isinstance(c.scope.lookup(node.base.name), TypeSymbol | PouSymbol):
        return None
    dotted = dotted_name(c, node)
    if dotted is not None and (c.scope.lookup(dotted) is not None or dotted.casefold() in c.world.names.namespaces):
        return None
    if isinstance(node.base, ast.Name) and is_namespace(c, node.base.name):
        return None
    if isinstance(node.base, ast.Member) and _dotted_type(c, node.base):
        return None
    base = c.expr(node.base)
    return None if base.type is ERROR else instance_member(c, base, node)


def own_member(c: Checker, name: str) -> Bound | None:
    """The member of the unit around; None outside of a class."""
    cls = c.scope.cls
    if cls is None:
        return None
    place = None if cls.type is None else SelfPlace(cls.type, c.pos(0))
    return Bound(cls, name.casefold(), place)


def instance_member(c: Checker, base: Expr, node: ast.Member) -> Bound | None:
    """The member `name` of an instance; None when it is not one but may be a variable."""
    t = base.type
    if isinstance(t, InterfaceType):
        place: Place = DerefPlace(base, t.target, c.pos(node.pos))
    elif isinstance(base, AddressOf) and isinstance(base.place, SelfPlace):  # THIS.x
        place = base.place
    elif isinstance(t, StructType):
        place = place_of(base)
    else:
        return None
    cls = c.world.class_of(place.type)
    if cls is None:
        return None
    bound = Bound(cls, node.name.casefold(), place)
    return bound if cls.is_interface else _existing(bound)


def _existing(bound: Bound) -> Bound | None:
    return bound if bound.exists else None


def _dotted_type(c: Checker, node: ast.Member) -> bool:
    name = dotted_name(c, node)
    return name is not None and isinstance(c.scope.lookup(name), TypeSymbol)


def usable(c: Checker, bound: Bound, member: Member | None, offset: int) -> Member | None:
    """The member of those that `bound` may be, if it exists and may be used here; None after an error."""
    if member is not None:
        return member if accessible(c, member, offset) else None
    if c.scope.inherits_unknown(bound.cls):
        return None
    hint = did_you_mean(bound.key, bound.cls.member_names())
    c.error(offset, "unknown", f"{bound.cls.name} has no method {bound.key}{hint}")
    return None


def is_called_by_name(c: Checker, node: ast.Expr) -> bool:
    """Whether a name alone is a call: of an action or a program, as older programs write it."""
    if called_program(c, node) is not None:
        return True
    bound = bound_member(c, node)
    member = None if bound is None else bound.callable
    return member is not None and member.decl.keyword == "ACTION"
