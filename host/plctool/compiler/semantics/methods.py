"""Methods, actions and properties in expressions; THIS, SUPER.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass

from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.semantics.calls import Calls
from plctool.compiler.semantics.checker import load, place_of
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.symbols import (
    ERROR,
    BlockInfo,
    ClassInfo,
    Member,
    MemberSymbol,
    PouSymbol,
    Role,
    TypeSymbol,
    VarSymbol,
)  # fmt: skip
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    AddressOf,
    Call,
    CallStatement,
    DerefPlace,
    Dispatch,
    Expr,
    Load,
    Place,
    Pos,
    Pou,
    SelfPlace,
    Statement,
    Storage,
    VarPlace,
)  # fmt: skip
from plctool.compiler.types import InterfaceType, PointerType, ReferenceType, StructType, Type

_OWN = ("THIS", "SUPER")


@dataclass
class Bound:
    """A member and the instance it is called on; None for a member of a program."""

    cls: ClassInfo
    key: str  # without .get and .set
    place: Place | None


class ObjectCalls(Calls):
    """Checks what belongs to instances."""

    # ---- names ----

    def own_name(self, node: ast.Name, symbol: object) -> Expr | None:
        """THIS, SUPER, or a property of the unit around; None when the name is nothing of the kind."""
        if isinstance(symbol, MemberSymbol):
            bound = self._own_member(node.name)
            return None if bound is None else self._property(bound, node.pos, node.pos)
        if symbol is None and self.is_namespace(node.name):
            return self.error(node.pos, "name", f"{node.name} is a namespace, not a value")
        if symbol is None and node.name.upper() in _OWN:
            place = self._own_instance(node)
            return error_value(self.pos(node.pos)) if place is None else _address(place)
        return None

    def _own_instance(self, node: ast.Name) -> SelfPlace | None:
        """The instance THIS or SUPER stands for; None after a diagnosis."""
        cls, name = self.scope.cls, node.name.upper()
        if cls is None or cls.type is None:
            self.error(node.pos, "name", f"{name} stands for the instance, which only a function block has")
            return None
        if name == "THIS":
            return SelfPlace(cls.type, self.pos(node.pos))
        if cls.base is None or cls.base.type is None:
            self.error(node.pos, "name", f"SUPER stands for the base, but {cls.name} extends nothing")
            return None
        return SelfPlace(cls.base.type, self.pos(node.pos), exact=True)

    def _own_member(self, name: str) -> Bound | None:
        cls = self.scope.cls
        if cls is None:
            return None
        place = None if cls.type is None else SelfPlace(cls.type, self.pos(0))
        return Bound(cls, name.casefold(), place)

    def member_of(self, base: Expr, node: ast.Member) -> Expr | None:
        """`base.name` when it is a property; None when it is a variable. Methods need to be called."""
        bound = self._bind(base, node)
        if bound is None:
            return None
        if bound.cls.find(bound.key) is not None:
            return self.error(node.name_pos, "call", f"{bound.cls.name}.{node.name} is called with ()")
        return self._property(bound, node.pos, node.name_pos)

    # ---- members ----

    def _bind(self, base: Expr, node: ast.Member) -> Bound | None:
        """The member `name` of an instance; None when it is not one but may be a variable."""
        key, t = node.name.casefold(), base.type
        if isinstance(t, InterfaceType):
            place: Place = DerefPlace(base, t.target, self.pos(node.pos))
        elif isinstance(base, AddressOf) and isinstance(base.place, SelfPlace):  # THIS.x
            place = base.place
        elif isinstance(t, StructType):
            place = place_of(base)
        else:
            return None
        cls = self.world.classes.class_of(place.type)
        if cls is None:
            return None
        known = any(cls.find(k) is not None for k in (key, f"{key}.get", f"{key}.set"))
        if not known and not cls.is_interface:
            return None
        return Bound(cls, key, place)

    def is_called_by_name(self, node: ast.Expr) -> bool:
        """Whether a name alone is a call: of an action or a program, as older programs write it."""
        if self.called_program(node) is not None:
            return True
        bound = self.bound_member(node)
        member = None if bound is None else bound.cls.find(bound.key)
        return member is not None and member.decl.keyword == "ACTION"

    def bound_member(self, node: ast.Expr, *, called: bool = False) -> Bound | None:
        """What `m`, `fb.m` or `prog.m` stands for when it is a method, action or property. `called`: the name of the
        method around is not its result."""
        if not self.world.classes.used:
            return None
        if isinstance(node, ast.Name):
            symbol = self.scope.lookup(node.name)
            if called and isinstance(symbol, VarSymbol) and symbol.role is Role.RESULT:
                symbol = self.scope.outer.get(node.name.casefold())
            return self._own_member(node.name) if isinstance(symbol, MemberSymbol) else None
        if not isinstance(node, ast.Member):
            return None
        space = self.space_of(node.base)
        if space is not None:
            key = node.name.casefold()
            found = space.cls is not None and any(space.cls.find(k) for k in (key, f"{key}.get", f"{key}.set"))
            return Bound(space.cls, key, None) if found and space.cls is not None else None
        if isinstance(node.base, ast.Name) and isinstance(self.scope.lookup(node.base.name), TypeSymbol | PouSymbol):
            return None
        dotted = self.dotted(node)
        if dotted is not None and (self.scope.lookup(dotted) is not None or dotted.casefold() in self.world.namespaces):
            return None
        if isinstance(node.base, ast.Name) and self.is_namespace(node.base.name):
            return None
        if isinstance(node.base, ast.Member) and self._dotted_type(node.base):
            return None
        base = self.expr(node.base)
        return None if base.type is ERROR else self._bind(base, node)

    def _dotted_type(self, node: ast.Member) -> bool:
        name = self.dotted(node)
        return name is not None and isinstance(self.scope.lookup(name), TypeSymbol)

    def _find(self, bound: Bound, key: str, offset: int) -> Member | None:
        """The member, checked for access; None after a diagnosis."""
        member = bound.cls.find(key)
        if member is not None:
            return member if self._accessible(member, offset) else None
        names = bound.cls.member_names()
        written = bound.key
        hint = did_you_mean(written, names)
        self.error(offset, "unknown", f"{bound.cls.name} has no method {written}{hint}")
        return None

    def may_see(self, symbol: VarSymbol, t: Type, node: ast.Member) -> bool:
        """Whether a variable of an instance may be used here; reports it when not. A VAR is for its own block, but
        existing programs read it from outside, so that is a warning only; writing it is an error anyway."""
        plain = not symbol.access
        if plain and (symbol.role is not Role.LOCAL or symbol.constant or self.scope.sees_inside):
            return True
        cls = self.world.classes.class_of(t)
        key = symbol.name.casefold()
        while cls is not None and cls.base is not None and cls.base.block is not None:
            if cls.base.block.members.get(key) is not symbol:
                break
            cls = cls.base
        here = self.scope.cls
        if plain and cls is not None and (here is None or not here.derives(cls)):
            message = f"{symbol.name} is a VAR of {cls.name} for its own use; make it VAR_OUTPUT to read it outside"
            self.scope.warning(node.name_pos, "access", message)
        return cls is None or plain or self._permitted({symbol.access}, cls, f"{cls.name}.{symbol.name}", node.name_pos)

    def _accessible(self, member: Member, offset: int) -> bool:
        return self._permitted(member.decl.modifiers, member.owner, member.name, offset)

    def _permitted(self, modifiers: set[str], owner: ClassInfo, name: str, offset: int) -> bool:
        here = self.scope.cls
        if "PRIVATE" in modifiers and here is not owner:
            self.error(offset, "access", f"{name} is PRIVATE: only {owner.name} itself may use it")
            return False
        if "PROTECTED" in modifiers and (here is None or not here.derives(owner)):
            message = f"{name} is PROTECTED: only {owner.name} and what extends it may use it"
            self.error(offset, "access", message)
            return False
        space = owner.symbol.decl.namespace
        if "INTERNAL" in modifiers and space is not None and not self.scope.is_within(space.name):
            self.error(offset, "access", f"{name} is INTERNAL: only the namespace {space.name} may use it")
            return False
        return True

    # ---- calls ----

    def call(self, node: ast.Call, expected: Type | None) -> Expr:
        """A call as a value, or as a statement when it is not one of a function block."""
        bound = self.bound_member(node.callee, called=True)
        if bound is None:
            dotted = self.dotted(node.callee)
            symbol = self.scope.unit(dotted) if dotted is not None else None
            if isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION":
                return self._call_function(symbol, node, expected)
            if isinstance(symbol, PouSymbol):
                return self.error(node.pos, "call", self._not_callable(symbol, symbol.decl.full_name))
            return super().call(node, expected)
        args, enable = self.split_enable(node)
        offset = node.callee.name_pos if isinstance(node.callee, ast.Member) else node.pos
        if enable.en is not None or enable.eno is not None:
            return self.error(node.pos, "arguments", "EN and ENO need the call to be a statement")
        if bound.cls.find(bound.key) is None and bound.cls.find(f"{bound.key}.get") is not None:
            return self.error(offset, "call", f"{bound.cls.name}.{bound.key} is a property and is used without ()")
        member = self._find(bound, bound.key, offset)
        if member is None:
            return error_value(self.pos(node.pos))
        return self._member_call(bound, member, args, node.pos, offset)

    def _member_call(
        self, bound: Bound, member: Member, args: list[ast.Argument], offset: int, name_offset: int
    ) -> Expr:
        place = bound.place
        if isinstance(place, SelfPlace) and place.exact and member.abstract:
            return self.error(name_offset, "inheritance", f"{member.name} is ABSTRACT and has no body to call")
        info = self.world.classes.signature(member)
        dispatch = self._dispatch(bound.cls, self._key(member), place, info.pou)
        bound_args = self.bind(args, [(s.name, d) for s, d in info.parameters], info.pou.name, offset)
        if bound_args is None:
            return error_value(self.pos(offset))
        elsewhere = dispatch is not None or isinstance(place, DerefPlace)
        e = self._typed_call(info, dict(bound_args), offset, noted=not elsewhere)
        if isinstance(e, Call):
            e.instance, e.dispatch = place, dispatch
            if dispatch is not None and isinstance(place, SelfPlace):
                self.world.classes.note_own_call(self.scope.pou, dispatch, e.pos)
            elif elsewhere:
                self.world.classes.note_other_call(self.scope.pou, info.pou, dispatch, e.pos)
        return e

    def _key(self, member: Member) -> str:
        suffix = f".{member.decl.keyword.lower()}" if member.is_property else ""
        return member.decl.name.casefold() + suffix

    def _dispatch(self, cls: ClassInfo, key: str, place: Place | None, function: Pou) -> Dispatch | None:
        """None when the type of the instance is known."""
        if place is None or _is_exact(place):
            return None
        return self.world.classes.dispatch(cls, key, function)

    def body_dispatch(self, block: BlockInfo, instance: Place) -> Dispatch | None:
        """How the body of a function block is found when the instance may be of a derived one."""
        return None if block.cls is None else self._dispatch(block.cls, "", instance, block.pou)

    # ---- properties ----

    def _property(self, bound: Bound, offset: int, name_offset: int) -> Expr:
        """The value of a property."""
        key = f"{bound.key}.get"
        if bound.cls.find(key) is None:
            if bound.cls.find(bound.key) is not None:
                return self.error(name_offset, "call", f"{bound.key} is a method and is called with ()")
            if bound.cls.find(f"{bound.key}.set") is not None:
                return self.error(name_offset, "access", f"the property {bound.key} has no GET, it can only be written")
        member = self._find(bound, key, name_offset)
        if member is None:
            return error_value(self.pos(offset))
        return self.followed(self._member_call(bound, member, [], offset, name_offset))

    def followed(self, e: Expr) -> Expr:
        """A result that is a REFERENCE TO stands for what it refers to."""
        if isinstance(e, Call) and isinstance(e.type, ReferenceType):
            return load(DerefPlace(e, e.type.target, e.pos))
        return e

    def assigned_property(self, target: ast.Expr) -> Bound | None:
        """The property that an assignment is about; None when it is a variable."""
        if not isinstance(target, ast.Name | ast.Member):
            return None
        bound = self.bound_member(target)
        if bound is None or bound.cls.find(bound.key) is not None:
            return None
        get = bound.cls.find(f"{bound.key}.get")
        if get is None or bound.cls.find(f"{bound.key}.set") is not None:
            return bound
        refers = isinstance(self.world.classes.signature(get).result, ReferenceType)
        return None if refers else bound  # what it refers to is assigned

    def assign_property(self, bound: Bound, target: ast.Expr, source: ast.Expr, pos: Pos) -> Statement | None:
        """Calls the SET of a property."""
        offset = target.name_pos if isinstance(target, ast.Member) else target.pos
        if bound.cls.find(f"{bound.key}.set") is None and bound.cls.find(f"{bound.key}.get") is not None:
            self.error(offset, "access", f"the property {bound.key} has no SET, it can only be read")
            return None
        member = self._find(bound, f"{bound.key}.set", offset)
        if member is None:
            return None
        e = self._member_call(bound, member, [ast.Argument(source.pos, None, source)], target.pos, offset)
        return CallStatement(e, pos) if isinstance(e, Call) else None

    def place(self, node: ast.Expr, use: str) -> Place | None:
        """The variable an expression names; a property is none."""
        if isinstance(node, ast.Name | ast.Member):
            bound = self.bound_member(node)
            if bound is not None and bound.cls.find(bound.key) is None and bound.cls.find(f"{bound.key}.get"):
                e = self.expr(node)
                if isinstance(e, Load) and isinstance(e.place, DerefPlace):
                    return e.place
                message = f"{use} needs a variable; {bound.cls.name}.{bound.key} is a property"
                self.error(node.pos, "place", message)
                return None
        return super().place(node, use)


def _is_exact(place: Place) -> bool:
    """Whether an instance is of just the type it is declared with: it is not reached through a reference."""
    if isinstance(place, VarPlace):
        return place.var.storage is not Storage.REFERENCE
    if isinstance(place, SelfPlace):
        return place.exact
    return not isinstance(place, DerefPlace)


def _address(place: SelfPlace) -> Expr:
    return AddressOf(place, PointerType(place.type), place.pos)
