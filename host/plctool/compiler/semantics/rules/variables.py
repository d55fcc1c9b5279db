"""Names as values: variables, constants, enumerations, THIS and SUPER, the flags of actions in charts.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re

from plctool.compiler.base.missing_names import known_name_like
from plctool.compiler.semantics import sfc
from plctool.compiler.semantics.checker import Checker, checks
from plctool.compiler.semantics.conversions import error_value, load
from plctool.compiler.semantics.rules.calls import property_value
from plctool.compiler.semantics.rules.members import (
    bound_member,
    describe,
    instance_hint,
    is_namespace,
    namespace_member,
    own_member,
    qualified,
    space_of,
    variable_value,
)
from plctool.compiler.semantics.rules.parts import member_of
from plctool.compiler.semantics.symbols import (
    ERROR,
    ClassInfo,
    GlobalSymbol,
    MemberSymbol,
    Namespace,
    PouSymbol,
    Role,
    TypeSymbol,
    VarSymbol,
)
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.compiler.syntax.slips import NAMES
from plctool.compiler.typed.nodes import AddressOf, Const, Expr, MemberPlace, Place, SelfPlace
from plctool.iec.types import EnumType, PointerType, StructType, Type

# ---- the flags of actions in charts: `action.Q` and `action.A` ----


def action_flag(c: Checker, node: ast.Member) -> Expr | None:
    """`action.Q` and `action.A` of a Sequential Function Chart, also from outside: whether the action is active,
    and whether it runs, which it does once more after that."""
    if node.name.upper() not in ("Q", "A"):
        return None
    bound = bound_member(c, node.base)
    member = None if bound is None else bound.callable
    if bound is None or member is None or member.decl.keyword is not ast.Unit.ACTION:
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


# ---- variables, constants, enumerations, THIS and SUPER ----

_OWN = ("THIS", "SUPER")
_ADDRESS = re.compile(r"([IQMEA])([XBWDL]?\d+)", re.IGNORECASE)
_GLOBAL_LIST = re.compile(r"G_?VL\w*|GLOBALS?|\w*_GVL", re.IGNORECASE)
_FEW = 3  # lists that are named
_DATA_BLOCK = re.compile(r"DB\d+", re.IGNORECASE)
_DURATION = re.compile(r"T_?(\d+(?:ms|us|ns|s|m|h|d))", re.IGNORECASE)


@checks(ast.Name)
def name_value(c: Checker, node: ast.Name, expected: Type | None) -> Expr:
    """A variable or constant, a value of an enumeration, a property of the unit around, THIS, SUPER."""
    symbol = c.scope.lookup(node.name)
    if isinstance(symbol, GlobalSymbol):
        choices = c.world.names.same_named(node.name)
        if choices:
            listed = " or ".join(s.full_name for s in choices)
            return c.error(node.pos, "ambiguous", f"{node.name} is in several lists; write {listed}")
        if not c.scope.may_use(symbol, node.name, node.pos):
            return error_value(c.pos(node.pos))
        symbol = c.world.declared.variable(symbol)
    if isinstance(expected, EnumType) and _yields(c, symbol, node.name, expected):
        return _value_of(c, expected, node.name, node.pos, node.pos)
    if isinstance(symbol, VarSymbol):
        return variable_value(symbol, c.pos(node.pos))
    own = _own_name(c, node, symbol)
    if own is not None:
        return own
    if symbol is None or (isinstance(symbol, PouSymbol) and symbol.library):
        value = _enumerated(c, node, expected)
        if value is not None or symbol is None:
            return value or _unknown(c, node)
    return c.error(node.pos, "name", f"{node.name} is {describe(symbol)}, not a value{instance_hint(symbol)}")


def _yields(c: Checker, symbol: object, name: str, wanted: EnumType) -> bool:
    """Whether a name is that of a method and of a value of the enumeration that is wanted here."""
    if not wanted.has(name):
        return False
    if isinstance(symbol, VarSymbol):
        return symbol.role is Role.RESULT and symbol.type is not wanted
    bound = own_member(c, name) if isinstance(symbol, MemberSymbol) else None
    return bound is not None and bound.callable is not None


def _enumerated(c: Checker, node: ast.Name, expected: Type | None) -> Expr | None:
    """The value of an enumeration by its bare name; None when there is none of that name."""
    if isinstance(expected, EnumType) and expected.inline and expected.has(node.name):
        return _value_of(c, expected, node.name, node.pos, node.pos)
    symbols = c.world.names.enumerations_with(node.name, imported=c.scope.imported)
    types = [t for s in symbols if isinstance(t := c.world.declared.type_of(s), EnumType)]
    if len(types) > 1 and expected in types:
        types = [t for t in types if t is expected]
    if len(types) > 1:
        listed = " or ".join(f"{t}#{node.name}" for t in types)
        c.error(node.pos, "ambiguous", f"{node.name} is a value of several enumerations; write {listed}")
    return _value_of(c, types[0], node.name, node.pos, node.pos) if types else None


def _own_name(c: Checker, node: ast.Name, symbol: object) -> Expr | None:
    """THIS, SUPER, or a property of the unit around; None when the name is nothing of the kind."""
    if isinstance(symbol, MemberSymbol):
        bound = own_member(c, node.name)
        return None if bound is None else property_value(c, bound, node.pos, node.pos)
    if symbol is None and is_namespace(c, node.name):
        return c.error(node.pos, "name", f"{node.name} is a namespace, not a value")
    if symbol is None and node.name.upper() in _OWN:
        place = _own_instance(c, node)
        if place is None:
            return error_value(c.pos(node.pos))
        return AddressOf(place, PointerType(place.type), place.pos)
    return None


def _own_instance(c: Checker, node: ast.Name) -> SelfPlace | None:
    """The instance THIS or SUPER stands for; None after an error."""
    cls, name = c.scope.cls, node.name.upper()
    if cls is None or cls.type is None:
        c.error(node.pos, "name", f"{name} stands for the instance, which only a function block has")
        return None
    if name == "THIS":
        return SelfPlace(cls.type, c.pos(node.pos))
    if cls.base is None and c.scope.inherits_unknown(cls):
        return None
    if cls.base is None or cls.base.type is None:
        c.error(node.pos, "name", f"SUPER stands for the base, but {cls.name} extends nothing")
        return None
    return SelfPlace(cls.base.type, c.pos(node.pos), exact=True)


def _unknown(c: Checker, node: ast.Name) -> Expr:
    if c.scope.inherits_unknown(c.scope.cls):
        return error_value(c.pos(node.pos))  # it may be inherited
    longer = c.world.names.qualified_names(node.name)
    if longer:
        return c.error(node.pos, "unknown", f"unknown name {node.name}; write {' or '.join(longer)}")
    if node.name.upper() in NAMES:
        return c.error(node.pos, "unknown", f"unknown name {node.name}; {NAMES[node.name.upper()]}")
    duration = _DURATION.fullmatch(node.name)
    if duration is not None:
        return c.error(node.pos, "unknown", f"unknown name {node.name}; a duration is written T#{duration[1].lower()}")
    inside = c.world.names.program_variables(node.name)
    if _is_declared_below(c, node, inside):
        return c.error(node.pos, "unknown", f"{node.name} is declared below; move that line up")
    if inside:
        return c.error(node.pos, "unknown", f"unknown name {node.name}; write {' or '.join(inside)}")
    if c.world.io.is_device_without_name(node.name):
        message = f'unknown name {node.name}; write name = "{node.name}" into the table of the device'
        return c.error(node.pos, "unknown", f"{message}, which makes it a variable")
    names = c.world.names
    others = names.owner_names() if c.owner is node else names.value_names()
    local = {_written(key, symbol) for key, symbol in (c.scope.outer | c.scope.names).items()}
    hint = known_name_like(node.name, (local | set(others)) - {""})
    if not hint and (address := _ADDRESS.fullmatch(node.name)):
        area = {"E": "I", "A": "Q"}.get(address[1].upper(), address[1])
        message = f"unknown name {node.name}; an address begins with %: %{area}{address[2]}"
        return c.error(node.pos, "unknown", message)
    if not hint and _GLOBAL_LIST.fullmatch(node.name) and (lists := c.world.names.list_names()[:_FEW]):
        message = f"unknown name {node.name}; a list of VAR_GLOBAL has the name of its file: {' or '.join(lists)}"
        return c.missing(node.pos, node.name, message)
    if not hint and _DATA_BLOCK.fullmatch(node.name):
        message = f"unknown name {node.name}; there are no data blocks: declare a variable in VAR_GLOBAL"
        return c.error(node.pos, "unknown", message)
    if node.name and not hint:
        return c.missing(node.pos, node.name, f"unknown name {node.name}")
    return c.error(node.pos, "unknown", f"unknown name {node.name}{hint}" if node.name else "a name is missing")


def _is_declared_below(c: Checker, node: ast.Name, of_programs: list[str]) -> bool:
    """Whether the unit around declares the name after its use. `of_programs`: those of programs, with the instance."""
    if c.scope.pou is None:
        return False
    unit = c.scope.lookup(c.scope.pou.name)
    if not isinstance(unit, PouSymbol):
        return f"{c.scope.pou.name}.{node.name}".casefold() in map(str.casefold, of_programs)
    names = [entry for block in unit.decl.blocks for line in block.decls for entry in line.names]
    return any(pos > node.pos and name.casefold() == node.name.casefold() for pos, name in names)


def _written(key: str, symbol: object) -> str:
    return symbol.name if isinstance(symbol, VarSymbol | GlobalSymbol | MemberSymbol) else key


def constant_of_block(c: Checker, symbol: object, name: str) -> VarSymbol | None:
    """`Block.LIMIT`: a constant, which is the same in all instances."""
    if not isinstance(symbol, PouSymbol) or symbol.keyword is not ast.Unit.FUNCTION_BLOCK:
        return None
    block = c.world.declared.block(symbol)
    member = block.members.get(name.casefold()) if block is not None else None
    return member if member is not None and member.constant and member.value is not None else None


@checks(ast.EnumValue)
def enum_value(c: Checker, node: ast.EnumValue, expected: Type | None) -> Expr:
    """`Color#Red`"""
    t = c.world.declared.type_named(node.pos, node.type_name, c.scope)
    if t is ERROR:
        return error_value(c.pos(node.pos))
    if not isinstance(t, EnumType):
        return c.error(node.pos, "type", f"{node.type_name} is not an enumeration")
    return _value_of(c, t, node.name, node.pos, node.pos)


def _value_of(c: Checker, t: EnumType, name: str, offset: int, name_offset: int) -> Expr:
    key = name.casefold()
    for value_name, value in t.values.items():
        if value_name.casefold() == key:
            return Const(value, t, c.pos(offset))
    return c.error(name_offset, "unknown", f"{t} has no value {name}{did_you_mean(name, t.values)}")


@checks(ast.DirectAddress)
def direct_address(c: Checker, node: ast.DirectAddress, expected: Type | None) -> Expr:
    """`%IW2`"""
    symbol = c.scope.lookup(node.text.upper())  # `AT %IW2 : INT` without a name
    if isinstance(symbol, GlobalSymbol):
        symbol = c.world.declared.variable(symbol)
    if not isinstance(symbol, VarSymbol):
        symbol = c.world.at_address(node, c.scope)
    return error_value(c.pos(node.pos)) if symbol is None else variable_value(symbol, c.pos(node.pos))


@checks(ast.Member)
def member_value(c: Checker, node: ast.Member, expected: Type | None) -> Expr:
    """`a.b`: a name with a namespace, list, program or type in front, or a part of what `a` is."""
    space = space_of(c, node.base)
    if space is not None and space.cls is not None:
        bound = bound_member(c, node)
        if bound is not None and bound.callable is None:
            return property_value(c, bound, node.pos, node.name_pos)
    if isinstance(node.base, ast.Name):
        symbol = c.scope.lookup(node.base.name)
        if isinstance(symbol, Namespace):
            return namespace_member(c, symbol, node)
        constant = constant_of_block(c, symbol, node.name)
        if constant is not None:
            return variable_value(constant, c.pos(node.pos))
        if isinstance(symbol, TypeSymbol):
            t = c.world.declared.type_of(symbol)
            if isinstance(t, EnumType):
                return _value_of(c, t, node.name, node.pos, node.name_pos)
            return c.error(node.base.pos, "name", f"{node.base.name} is a type, not a variable")
    named = action_flag(c, node) or qualified(c, node)
    if named is not None:
        return named
    c.owner = node.base
    base = c.expr(node.base)
    if base.type is ERROR:
        return base
    if isinstance(base.type, EnumType) and isinstance(node.base, ast.Name):
        return _value_of(c, base.type, node.name, node.pos, node.name_pos)  # color : Color; Color.Red
    return member_of(c, base, node)
