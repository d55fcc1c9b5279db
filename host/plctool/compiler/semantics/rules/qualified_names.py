"""Names with dots: what is in a namespace, in a list of globals, in an instance of a program.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.symbols import (
    GlobalSymbol,
    MemberSymbol,
    Namespace,
    PouSymbol,
    ProgramInfo,
    TypeSymbol,
    VarSymbol,
)
from plctool.compiler.semantics.values import load, whole
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Const, Expr, Pos, VarPlace

_LONGEST = 16  # parts of a name after its first; more are members of members


def variable_value(symbol: VarSymbol, pos: Pos) -> Expr:
    """A variable as a value: of constants their value."""
    symbol.used = True
    if symbol.value is not None:
        return Const(symbol.value.value, symbol.type, pos)
    variable = symbol.variable
    if variable is None:
        return error_value(pos)
    return load(whole(variable, pos) if variable.bit is not None else VarPlace(variable, symbol.type, pos))


def namespace_member(c: Checker, namespace: Namespace, node: ast.Member) -> Expr:
    """`list.name`, `program.name`"""
    symbol = namespace.members.get(node.name.casefold())
    if symbol is None:
        hint = did_you_mean(node.name, (m.name for m in namespace.members.values()))
        return c.error(node.name_pos, "unknown", f"{namespace.what} {namespace.name} has no {node.name}{hint}")
    if isinstance(symbol, GlobalSymbol):
        symbol = c.world.declared.variable(symbol)
    return variable_value(symbol, c.pos(node.pos))


def qualified(c: Checker, node: ast.Member) -> Expr | None:
    """A global, or the value of an enumeration, in a namespace; None when `node` names none."""
    name = dotted_name(c, node)
    if name is None:
        return None
    program = space_of(c, node.base)
    if program is not None:
        return namespace_member(c, program, node)
    symbol = c.scope.lookup(name)
    if isinstance(symbol, GlobalSymbol):
        if not c.scope.may_use(symbol, name, node.name_pos):
            return error_value(c.pos(node.pos))
        return variable_value(c.world.declared.variable(symbol), c.pos(node.pos))
    if symbol is not None:
        return c.error(node.pos, "name", f"{name} is {describe(symbol)}, not a value")
    space, _, value = name.rpartition(".")
    owner = c.scope.lookup(space)
    if isinstance(owner, TypeSymbol):
        return c.expr(ast.EnumValue(node.pos, space, value))
    if (
        owner is None
        and space.casefold() in c.world.names.namespaces
        and name.casefold() not in c.world.names.namespaces
    ):
        hint = did_you_mean(value, c.world.names.names_in(space))
        return c.error(node.name_pos, "unknown", f"the namespace {space} has no {value}{hint}")
    return None


def space_of(c: Checker, node: ast.Expr) -> Namespace | None:
    """The list of globals or the program instance an expression names, perhaps in a namespace."""
    name = node.name if isinstance(node, ast.Name) else dotted_name(c, node)
    symbol = None if name is None else c.scope.lookup(name)
    return symbol if isinstance(symbol, Namespace) else None


def called_program(c: Checker, callee: ast.Expr) -> ProgramInfo | None:
    """The instance of a PROGRAM that a call is about."""
    space = space_of(c, callee)
    return None if space is None else space.program


def is_namespace(c: Checker, name: str) -> bool:
    """Whether a name stands for a namespace here."""
    return name.casefold() in c.world.names.namespaces and c.scope.lookup(name) is None


def dotted_name(c: Checker, node: ast.Expr) -> str | None:
    """`a.b.c` as a name when `a` may be a namespace or a library."""
    parts = list[str]()
    while isinstance(node, ast.Member) and len(parts) < _LONGEST:
        parts.append(node.name)
        node = node.base
    if not isinstance(node, ast.Name) or not parts or isinstance(c.scope.lookup(node.name), VarSymbol):
        return None
    return ".".join([node.name, *reversed(parts)])


def describe(symbol: object) -> str:
    """What a name that is not a variable stands for."""
    if isinstance(symbol, PouSymbol):
        article = {"FUNCTION": "a function", "FUNCTION_BLOCK": "a function block type", "INTERFACE": "an interface"}
        return article.get(symbol.keyword, "a program")
    if isinstance(symbol, MemberSymbol):
        return "a method"
    if isinstance(symbol, Namespace):
        return f"a {symbol.what}"
    return "a type"
