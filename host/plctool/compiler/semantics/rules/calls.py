"""Calls that have a value: of functions, of methods, and of what is built in.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.library import without_library
from plctool.compiler.semantics.checker import Checker, checks
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.rules.arguments import parameter_lines, plain_arguments
from plctool.compiler.semantics.rules.builtin import built_in_call, function_hint
from plctool.compiler.semantics.rules.instance_queries import QUERIES, query
from plctool.compiler.semantics.rules.library_calls import call_symbol, call_text_function, overload_call
from plctool.compiler.semantics.rules.members import bound_member
from plctool.compiler.semantics.rules.methods import followed, method_call
from plctool.compiler.semantics.rules.qualified_names import dotted_name
from plctool.compiler.semantics.symbols import ERROR, GlobalSymbol, Namespace, PouSymbol, VarSymbol
from plctool.compiler.semantics.typed_functions import overloaded_form
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.slips import FUNCTIONS, REFUSED_CALLS
from plctool.compiler.typed import Expr, Load, MemberPlace
from plctool.iec.types import ELEMENTARY, ArrayType, StructType, Type


@checks(ast.Call)
def called_value(c: Checker, node: ast.Call, expected: Type | None) -> Expr:
    """The value of a call, or what it refers to."""
    return followed(call(c, node, expected))


def call(c: Checker, node: ast.Call, expected: Type | None) -> Expr:
    """A call as a value, or as a statement when it is not one of a function block."""
    callee = node.callee
    if isinstance(callee, ast.Name) and callee.name.upper() in QUERIES:
        return query(c, node)
    bound = bound_member(c, callee, called=True)
    if bound is not None:
        return method_call(c, bound, node)
    dotted = dotted_name(c, callee)
    if dotted is not None and (bare := _of_library(c, dotted)) is not None:
        return _call_by_bare_name(c, replace(node, callee=ast.Name(callee.pos, bare)), expected)
    symbol = c.scope.unit(dotted) if dotted is not None else None
    if isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION":
        return _call_function(c, symbol, node, expected)
    if isinstance(symbol, PouSymbol):
        return c.error(node.pos, "call", _not_callable(c, symbol, symbol.decl.full_name))
    return _call_by_bare_name(c, node, expected)


def _of_library(c: Checker, dotted: str) -> str | None:
    """`LEN` of `Standard.LEN`; None when the program has a LEN of its own, or the name has no library in front."""
    bare = without_library(dotted)
    known = bare == dotted or c.world.names.is_user_name(bare) or c.world.names.is_user_name(dotted)
    return None if known else bare


def _call_by_bare_name(c: Checker, node: ast.Call, expected: Type | None) -> Expr:
    """A call of a function of the program, of one that is built in, or of one of the library."""
    callee = node.callee
    if not isinstance(callee, ast.Name):
        return _call_of_place(c, node)
    name = callee.name
    symbol = c.scope.lookup(name)
    shadow: VarSymbol | None = None  # a variable of this name, which cannot be called
    if isinstance(symbol, GlobalSymbol):
        symbol = c.world.declared.variable(symbol)
    if isinstance(symbol, VarSymbol):
        if symbol.type in c.world.blocks or symbol.type is ERROR:
            return _call_of_place(c, node)
        shadow, symbol = symbol, c.world.names.unit(name.casefold(), library=c.scope.library)
    is_function = isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION"
    if isinstance(symbol, PouSymbol) and is_function and (not symbol.library or c.scope.library):
        return _call_function(c, symbol, node, expected)
    args = plain_arguments(c, node)
    if args is None:
        return error_value(c.pos(node.pos))
    node = replace(node, args=args)
    if symbol is None or isinstance(symbol, PouSymbol):
        built_in = built_in_call(c, name.upper(), node, expected)
        if built_in is not None:
            return built_in
    if isinstance(symbol, PouSymbol) and is_function:
        if c.world.names.library.overloads(name.casefold()):
            return call_text_function(c, symbol, node)
        return _call_function(c, symbol, node, expected)
    overload = overload_call(c, name, node, expected)
    if overload is not None:
        return overload
    if symbol is not None or shadow is not None:
        return c.error(callee.pos, "call", _not_callable(c, symbol or shadow, name))
    if name.upper() in REFUSED_CALLS:
        return c.error(callee.pos, "unsupported", REFUSED_CALLS[name.upper()])
    overloaded = overloaded_form(node)
    if overloaded is not None:
        return call(c, overloaded, expected)
    if name.upper() in ELEMENTARY:
        shown = _written(node)
        message = f"{name} is a type; a conversion is written TO_{name.upper()}({shown})"
        return c.error(callee.pos, "unknown", message)
    if c.scope.inherits_unknown(c.scope.cls):
        return error_value(c.pos(node.pos))  # it may be an inherited method
    hint = f"; {FUNCTIONS[name.upper()]}" if name.upper() in FUNCTIONS else function_hint(c, name)
    if hint:
        return c.error(callee.pos, "unknown", f"unknown function {name}{hint}")
    return c.missing(callee.pos, name, f"unknown function {name}")


def _written(node: ast.Call) -> str:
    """The argument of a call when it is a name, else dots."""
    value = node.args[0].value if node.args else None
    return value.name if isinstance(value, ast.Name) else "..."


def _not_callable(c: Checker, symbol: object, name: str) -> str:
    if isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION_BLOCK":
        return f"{name} is a function block type; declare an instance of it and call that"
    if isinstance(symbol, Namespace) and symbol.program is not None:
        return f"a call of the program {name} is a statement and has no value"
    if isinstance(symbol, PouSymbol) and symbol.keyword == "PROGRAM":
        listed = " or ".join(f"{instance}()" for instance in c.world.names.instances_of(symbol))
        return f"the program {name} has several instances; call {listed}"
    if isinstance(symbol, VarSymbol) and isinstance(symbol.type, ArrayType):
        return f"{name} is an array; an element is written {name}[1]"
    return f"{name} is not a function"


def _call_of_place(c: Checker, node: ast.Call) -> Expr:
    e = c.expr(node.callee)
    if e.type is ERROR:
        return e
    if isinstance(e.type, StructType) and e.type in c.world.blocks:
        return c.error(node.pos, "call", f"a call of the function block {e.type} is a statement and has no value")
    if isinstance(node.callee, ast.Member) and isinstance(e, Load) and not node.args:
        owner = e.place.base.type if isinstance(e.place, MemberPlace) else None
        of = f" of {owner}" if owner is not None else ""
        return c.error(node.pos, "call", f"{node.callee.name} is a variable{of}, not a method; leave out ()")
    return c.error(node.pos, "call", f"{e.type} cannot be called")


def _call_function(c: Checker, symbol: PouSymbol, node: ast.Call, expected: Type | None) -> Expr:
    if not c.scope.may_use(symbol, symbol.decl.name, node.callee.pos):
        return error_value(c.pos(node.pos))
    args = plain_arguments(c, node, {name.casefold() for name, _, _ in parameter_lines(symbol.decl)})
    if args is None:
        return error_value(c.pos(node.pos))
    return call_symbol(c, symbol, args, node.pos, expected, formal=node.formal)
