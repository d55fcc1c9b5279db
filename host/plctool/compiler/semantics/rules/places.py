"""What may be read and what may be changed: the variables that expressions name.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import is_exact, is_temporary, place_of
from plctool.compiler.semantics.rules.members import Bound, bound_member, dotted_name, is_inside, space_of
from plctool.compiler.semantics.symbols import ERROR, GlobalSymbol, Role, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import AddressOf, Call, DerefPlace, Expr, Load, Place, SelfPlace
from plctool.iec.types import RawPointerType, StructType


def named_place(c: Checker, node: ast.Expr, use: str) -> Place | None:
    """The variable an expression names; a property is none."""
    if isinstance(node, ast.Name | ast.Member):
        bound = bound_member(c, node)
        if bound is not None and bound.callable is None and bound.getter is not None:
            return _referred_place(c, node, bound, use)
    e = c.expr(node)
    if e.type is ERROR:
        return None
    if isinstance(e, Load) and not is_temporary(e.place):
        return e.place
    c.error(node.pos, "place", f"{use} needs a variable")
    return None


def _referred_place(c: Checker, node: ast.Expr, bound: Bound, use: str) -> Place | None:
    """What a property that is a REFERENCE TO refers to."""
    e = c.expr(node)
    if isinstance(e, Load) and isinstance(e.place, DerefPlace):
        return e.place
    c.error(node.pos, "place", f"{use} needs a variable; {bound.cls.name}.{bound.key} is a property")
    return None


def changeable_place(c: Checker, node: ast.Expr, what: str, use: str) -> Place | None:
    """The variable an expression names when it may be changed. Else reports: `what` needs one, it cannot `use`."""
    reason = _read_only(c, node)
    if reason is not None:
        c.error(node.pos, "read-only", f"{reason} and cannot {use}")
        return None
    return named_place(c, node, what)


def copied(c: Checker, value: Expr, offset: int, target: Place | None = None) -> Expr:
    """A value that is copied to a place, or into a new variable. Of an instance that may be of a derived block, only
    the part of its base is copied; it may not be written over one, whose number would be lost: that is an error."""
    block = c.world.blocks.get(value.type) if isinstance(value.type, StructType) else None
    if block is None or block.cls is None or not block.cls.number:
        return value
    if target is not None and not is_exact(target):
        what = "what is reached through a pointer, reference or VAR_IN_OUT may be of a block derived from"
        return c.error(offset, "type", f"{what} {block.type}, so it cannot be overwritten as a whole")
    place = place_of(value)
    if is_exact(place):
        return value
    copier, pos = c.world.copier_of(block.type, block.cls.number), c.pos(offset)
    c.world.calls.add(c.scope.pou, copier, pos)
    return Call(copier, [AddressOf(place, RawPointerType(block.type), pos)], block.type, pos)


def _read_only(c: Checker, node: ast.Expr) -> str | None:
    if isinstance(node, ast.Name):
        return _symbol_read_only(c, c.scope.lookup(node.name))
    if isinstance(node, ast.Index | ast.BitAccess):
        return _read_only(c, node.base)
    if isinstance(node, ast.Member):
        return _member_read_only(c, node)
    return None


def _symbol_read_only(c: Checker, symbol: object) -> str | None:
    if isinstance(symbol, GlobalSymbol):
        symbol = c.world.declared.variable(symbol)
    if not isinstance(symbol, VarSymbol):
        return None
    if symbol.constant:
        return f"{symbol.name} is a {'VAR_IN_OUT CONSTANT' if symbol.role is Role.IN_OUT else 'constant'}"
    if symbol.by_reference and symbol.role is Role.INPUT:
        return f"{symbol.name} is an input passed by reference"
    if symbol.role is Role.STEP and c.scope.names.get(symbol.name.casefold()) is not symbol:
        return f"{symbol.name} is a step"  # only the chart itself changes it
    return None


def _takes_locals(c: Checker) -> bool:
    """True where the VAR of a block may be written from outside, as matiec has it."""
    return c.dialect.writes_locals or c.scope.source.is_of_openplc


def _member_read_only(c: Checker, node: ast.Member) -> str | None:
    if c.scope.writes_inside:
        return _read_only(c, node.base)
    space = space_of(c, node.base)
    if space is not None:
        variable = space.members.get(node.name.casefold())
        if isinstance(variable, VarSymbol) and variable.role is Role.OUTPUT:
            return f"{node.name} is an output of {space.name}"
        return _symbol_read_only(c, variable)
    name = dotted_name(c, node)
    symbol = None if name is None else c.scope.lookup(name)
    if isinstance(symbol, GlobalSymbol):  # in a namespace
        return _symbol_read_only(c, symbol)
    base = c.expr(node.base)
    own = base.place if isinstance(base, AddressOf | Load) and isinstance(base.place, SelfPlace) else None
    t = base.type if own is None else own.type
    block = c.world.blocks.get(t) if isinstance(t, StructType) else None
    if own is not None:
        return None if block is None else _symbol_read_only(c, block.members.get(node.name.casefold()))
    if block is not None:
        member = block.members.get(node.name.casefold())
        if member is not None and member.role is Role.LOCAL and not member.constant and is_inside(c, member, block):
            return _read_only(c, node.base)
        if member is not None and member.role is Role.LOCAL and not member.access and _takes_locals(c):
            return _read_only(c, node.base)  # a warning when it is looked at (may_see)
        if member is not None and member.role is not Role.INPUT and member.access is not ast.Modifier.PUBLIC:
            article = "an" if member.role in (Role.OUTPUT, Role.IN_OUT) else "a"
            return f"{node.name} is {article} {member.role.value} of {base.type}"
    return _read_only(c, node.base)
