"""Who may use what: PUBLIC, PRIVATE, PROTECTED, INTERNAL.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.symbols import BlockInfo, ClassInfo, Member, Role, VarSymbol
from plctool.compiler.syntax import ast
from plctool.iec.types import Type


def may_see(c: Checker, symbol: VarSymbol, t: Type, node: ast.Member) -> bool:
    """Whether a variable of an instance may be used here; reports it when not. A VAR is for its own block, but
    existing programs read it from outside, so that is a warning only; writing it is an error anyway."""
    plain = not symbol.access
    if plain and (symbol.role is not Role.LOCAL or symbol.constant or c.scope.sees_inside):
        return True
    cls = c.world.class_of(t)
    cls = None if cls is None else declaring_class(symbol, cls)
    here = c.scope.cls
    if plain and cls is not None and (here is None or not here.derives(cls)):
        message = f"{symbol.name} is a VAR of {cls.name} for its own use; make it VAR_OUTPUT to read it outside"
        c.warning(node.name_pos, "access", message)
    return (
        cls is None
        or symbol.access is None
        or _permitted(c, {symbol.access}, cls, f"{cls.name}.{symbol.name}", node.name_pos)
    )


def declaring_class(symbol: VarSymbol, cls: ClassInfo) -> ClassInfo:
    """The class or base of it that declares a variable of its instances."""
    key = symbol.name.casefold()
    while cls.base is not None and cls.base.block is not None and cls.base.block.members.get(key) is symbol:
        cls = cls.base
    return cls


def is_inside(c: Checker, symbol: VarSymbol, block: BlockInfo) -> bool:
    """Whether this is part of the block that declares a variable, or of one derived from it: then the variables of
    other instances may be written as its own."""
    here = c.scope.cls
    return here is not None and block.cls is not None and here.derives(declaring_class(symbol, block.cls))


def accessible(c: Checker, member: Member, offset: int) -> bool:
    """Whether a method, action or property may be used here; reports it when not."""
    return _permitted(c, member.decl.modifiers, member.owner, member.name, offset)


def _permitted(c: Checker, modifiers: set[ast.Modifier], owner: ClassInfo, name: str, offset: int) -> bool:
    here = c.scope.cls
    if ast.Modifier.PRIVATE in modifiers and here is not owner:
        c.error(offset, "access", f"{name} is PRIVATE: only {owner.name} itself may use it")
        return False
    if ast.Modifier.PROTECTED in modifiers and (here is None or not here.derives(owner)):
        message = f"{name} is PROTECTED: only {owner.name} and what extends it may use it"
        c.error(offset, "access", message)
        return False
    space = owner.symbol.decl.namespace
    if ast.Modifier.INTERNAL in modifiers and space is not None and not c.scope.is_within(space.name):
        c.error(offset, "access", f"{name} is INTERNAL: only the namespace {space.name} may use it")
        return False
    return True
