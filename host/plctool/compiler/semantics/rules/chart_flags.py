"""The flags of actions in charts: `action.Q` and `action.A`.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics import sfc
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.rules.members import bound_member
from plctool.compiler.semantics.rules.parts import member_of
from plctool.compiler.semantics.rules.qualified_names import variable_value
from plctool.compiler.semantics.symbols import ClassInfo, VarSymbol
from plctool.compiler.semantics.values import load
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Expr, MemberPlace, Place
from plctool.iec.types import StructType


def action_flag(c: Checker, node: ast.Member) -> Expr | None:
    """`action.Q` and `action.A` of a Sequential Function Chart, also from outside: whether the action is active,
    and whether it runs, which it does once more after that."""
    if node.name.upper() not in ("Q", "A"):
        return None
    bound = bound_member(c, node.base)
    member = None if bound is None else bound.callable
    if bound is None or member is None or member.decl.keyword != "ACTION":
        return None
    flag = _flag_symbol(bound.cls, bound.key)
    if flag is None or flag.variable is None:
        message = f"{member.name} has no {node.name}: no step of a chart has it as its action"
        return c.error(node.name_pos, "unknown", message)
    pos = c.pos(node.pos)
    e = variable_value(flag, pos)
    if isinstance(bound.place, Place) and not isinstance(node.base, ast.Name):
        e = load(MemberPlace(bound.place, flag.variable.offset, flag.type, pos))
    if isinstance(e.type, StructType):
        return member_of(c, e, node)
    if node.name.upper() == "A":
        return c.error(node.name_pos, "unknown", f"from outside only {member.name}.Q is known, not its A")
    return e


def _flag_symbol(cls: ClassInfo | None, action: str) -> VarSymbol | None:
    """The hidden variable of an action."""
    while cls is not None:
        for part in (p for p in (cls.symbol.decl, *cls.symbol.decl.members) if p.chart is not None):
            own = cls.names if part is cls.symbol.decl else cls.instance_variables.get(part.name.casefold(), {})
            symbol = own.get(sfc.hidden_name(part, action).casefold())
            if isinstance(symbol, VarSymbol):
                return symbol
        cls = cls.base
    return None
