"""What can be asked of instances: the flags of actions in charts, __QUERYINTERFACE, __QUERYPOINTER and ?=.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics import sfc
from plctool.compiler.semantics.checker import load, place_of
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.methods import ObjectCalls
from plctool.compiler.semantics.symbols import ERROR, ClassInfo, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    AddressOf,
    Call,
    CallStatement,
    DerefPlace,
    Expr,
    Load,
    MemberPlace,
    Place,
    Pos,
    Statement,
)
from plctool.compiler.types import BOOL, InterfaceType, PointerType, ReferenceType, StructType, Type

_INTERFACE, _POINTER = "an interface", "a pointer to a function block"
_QUERIES = {"__QUERYINTERFACE": _INTERFACE, "__QUERYPOINTER": _POINTER}


class InstanceQuestions(ObjectCalls):
    """Checks questions to instances."""

    def qualified(self, node: ast.Member) -> Expr | None:
        """`action.Q`, or what is in a namespace; None when `node` names nothing of the kind."""
        return self._action_flag(node) or super().qualified(node)

    def call(self, node: ast.Call, expected: Type | None) -> Expr:
        """A call as a value, or as a statement when it is not one of a function block."""
        if isinstance(node.callee, ast.Name) and node.callee.name.upper() in _QUERIES:
            return self._query(node, _QUERIES[node.callee.name.upper()])
        return super().call(node, expected)

    def _action_flag(self, node: ast.Member) -> Expr | None:
        """`action.Q` and `action.A` of a Sequential Function Chart, also from outside: whether the action is active,
        and whether it runs, which it does once more behind that."""
        if node.name.upper() not in ("Q", "A"):
            return None
        bound = self.bound_member(node.base)
        member = None if bound is None else bound.cls.find(bound.key)
        if bound is None or member is None or member.decl.keyword != "ACTION":
            return None
        flag = self._flag_symbol(bound.cls, bound.key)
        if flag is None or flag.variable is None:
            message = f"{member.name} has no {node.name}: no step of a chart has it as its action"
            return self.error(node.name_pos, "unknown", message)
        pos = self.pos(node.pos)
        e = self.variable(flag, pos)
        if isinstance(bound.place, Place) and not isinstance(node.base, ast.Name):
            e = load(MemberPlace(bound.place, flag.variable.offset, flag.type, pos))
        if isinstance(e.type, StructType):
            return self.member(e, node)
        if node.name.upper() == "A":
            return self.error(node.name_pos, "unknown", f"from outside only {member.name}.Q is known, not its A")
        return e

    def _flag_symbol(self, cls: ClassInfo | None, action: str) -> VarSymbol | None:
        """The hidden variable of an action."""
        while cls is not None:
            for part in (p for p in (cls.symbol.decl, *cls.symbol.decl.members) if p.chart is not None):
                own = cls.names if part is cls.symbol.decl else cls.instance_variables.get(part.name.casefold(), {})
                symbol = own.get(sfc.hidden_name(part, action).casefold())
                if isinstance(symbol, VarSymbol):
                    return symbol
            cls = cls.base
        return None

    def _query(self, node: ast.Call, wanted: str) -> Expr:
        """`__QUERYINTERFACE(source, target)`: whether the instance is what the target may hold, which is then there."""
        assert isinstance(node.callee, ast.Name)
        name = node.callee.name.upper()
        args = [a.value for a in node.args if a.value is not None and a.name is None]
        if len(node.args) != 2 or len(args) != 2:
            return self.error(node.pos, "arguments", f"{name} takes 2 arguments: what is asked, and {wanted}")
        target = self.target(args[1], f"the second argument of {name}", "take an address")
        t = None if target is None else target.type
        if t is not None and not (self._takes_instances(t) and isinstance(t, InterfaceType) is (wanted == _INTERFACE)):
            return self.error(args[1].pos, "type", f"the second argument of {name} is {wanted}, not {t}")
        return self._ask(name, args[0], target, self.pos(node.pos))

    def attempt(self, node: ast.Assign) -> list[Statement]:
        """`target ?= source`: the target holds the instance behind the source if it may, and else NULL."""
        pos = self.pos(node.pos)
        target = self.target(node.targets[0], "the left side of ?=", "take an address")
        reference = target.pointer if isinstance(target, DerefPlace) else None
        if isinstance(reference, Load) and isinstance(reference.type, ReferenceType):
            target = reference.place
        if target is not None and not self._takes_instances(target.type):
            wanted = f"{_INTERFACE}, a reference or {_POINTER}"
            self.error(node.targets[0].pos, "type", f"the left side of ?= is {wanted}, not {target.type}; write :=")
            return []
        asked = self._ask("?=", node.value, target, pos)
        return [CallStatement(asked, pos)] if isinstance(asked, Call) else []

    def _takes_instances(self, t: Type) -> bool:
        return isinstance(t, PointerType) and self.world.classes.class_of(t.target) is not None

    def _ask(self, name: str, node: ast.Expr, target: Place | None, pos: Pos) -> Expr:
        """Whether the instance that `node` gives is what the target may hold, which is then there."""
        source = self.expr(node)
        if source.type is ERROR or target is None:
            return error_value(pos)
        if isinstance(source.type, StructType):
            source = AddressOf(place_of(source), PointerType(source.type), source.pos)
        cls = self.world.classes.class_of(source.type.target) if isinstance(source.type, PointerType) else None
        if cls is None or not isinstance(source.type, PointerType):
            message = f"{name} asks an instance, an interface or a pointer to a function block, not {source.type}"
            return self.error(node.pos, "type", message)
        assert isinstance(target.type, PointerType)
        function = self.world.classes.queries.function(cls, source.type, target.type, pos)
        return Call(function, [source, target], BOOL, pos)
