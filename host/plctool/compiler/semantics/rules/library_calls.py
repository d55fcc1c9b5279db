"""Calls of library functions: of those for strings, of generic ones, of overloaded ones.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from dataclasses import replace

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import common_type, cut, elementary, error_value, is_untyped, settle
from plctool.compiler.semantics.generics import (
    LIBRARY_STRING,
    WIDE_LIBRARY_STRING,
    accepts,
    describes_any,
    first_of,
    group_name,
    is_generic,
    is_group,
)
from plctool.compiler.semantics.rules.arguments import Actual, arguments_text, bind, parameter_lines, typed_call
from plctool.compiler.semantics.rules.literals import common_of, wholly
from plctool.compiler.semantics.symbols import ERROR, PouSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Direction, Expr
from plctool.iec.types import LREAL, REAL, WCHAR, StringType, Type

_TEXT_PARAMETERS = {"STR": "IN", "STR1": "IN1", "STR2": "IN2", "SIZE": "L", "LEN": "L", "POS": "P"}
"""Names that CODESYS gives the parameters of string functions, and those of the standard."""


def call_symbol(
    c: Checker,
    symbol: PouSymbol,
    args: list[ast.Argument],
    offset: int,
    expected: Type | None,
    *,
    formal: bool = False,
) -> Expr:
    """A call of a declared function. `formal`: arguments are given by name."""
    if "extensible" in symbol.decl.attributes and len(args) > 2 and all(a.name is None for a in args):
        result = call_symbol(c, symbol, args[:2], offset, expected)
        for argument in args[2:]:
            assert argument.value is not None
            result = _call_checked(c, symbol, [result, c.expr(argument.value, expected)], offset, expected)
        return result
    if is_generic(symbol.decl) and not describes_any(symbol.decl):
        return _call_generic(c, symbol, args, offset, expected, formal=formal)
    info = c.world.declared.function(symbol, {})
    if info is None:
        return c.error(offset, "recursion", f"{symbol.decl.name} is used in its own declaration")
    names = [(s.name, d) for s, d in info.parameters]
    if symbol.library:
        args = _standard_names(args, {name.casefold() for name, _ in names})
    bound = bind(c, args, names, info.pou.name, offset)
    if bound is None:
        return error_value(c.pos(offset))
    return typed_call(c, info, dict(bound), offset, formal=formal)


def _standard_names(args: list[ast.Argument], declared: set[str]) -> list[ast.Argument]:
    """The arguments with the names of the standard in place of those of CODESYS."""
    return [
        a if a.name is None or a.name.casefold() in declared else replace(a, name=_standard_name(a.name)) for a in args
    ]


def _standard_name(name: str) -> str:
    return _TEXT_PARAMETERS.get(name.upper(), name)


def _call_checked(c: Checker, symbol: PouSymbol, values: list[Expr], offset: int, expected: Type | None) -> Expr:
    """A call with arguments that are checked already."""
    if any(v.type is ERROR for v in values):
        return error_value(c.pos(offset))
    if is_generic(symbol.decl) and not describes_any(symbol.decl):
        return _instantiate(c, symbol, dict(enumerate(values)), offset, expected)
    info = c.world.declared.function(symbol, {})
    if info is None or len(info.parameters) != len(values):
        return c.error(offset, "arguments", f"{symbol.decl.name} does not take {arguments_text(len(values))}")
    return typed_call(c, info, dict(enumerate(values)), offset)


def call_by_name(c: Checker, name: str, args: list[Expr], offset: int, expected: Type | None) -> Expr:
    """A call of a library function with checked arguments."""
    symbol = c.world.names.unit(name.casefold(), library=True)
    if not isinstance(symbol, PouSymbol):
        symbol = _best_overload(c, name, args, expected)
    if symbol is None:
        return c.error(offset, "unknown", f"the library has no function {name}")
    return _call_checked(c, symbol, args, offset, expected)


def call_text_function(c: Checker, symbol: PouSymbol, node: ast.Call) -> Expr:
    """A string function of the library, which exists for STRING and for WSTRING."""
    values = _argument_values(c, node, None)
    if values is None:
        return error_value(c.pos(node.pos))
    wide = any((isinstance(v.type, StringType) and v.type.wide) or v.type is WCHAR for v in values)
    if wide:
        other = c.world.names.unit(f"{symbol.decl.name}__wstring".casefold(), library=True)
        assert isinstance(other, PouSymbol)
        symbol = other
    name = symbol.decl.name.split("__")[0]
    if "extensible" in symbol.decl.attributes and len(values) > 2:
        return _joined(c, symbol, name, node, values)
    info = c.world.declared.function(symbol, {})
    assert info is not None
    args = _standard_names(node.args, {s.name.casefold() for s, _ in info.parameters})
    bound = bind(c, args, [(s.name, d) for s, d in info.parameters], name, node.pos)
    if bound is None:
        return error_value(c.pos(node.pos))
    value_of = {id(a): v for a, v in zip(args, values, strict=True)}
    return typed_call(c, info, {i: value_of[id(a)] for i, a in bound.items()}, node.pos)


def _argument_values(c: Checker, node: ast.Call, expected: Type | None) -> list[Expr] | None:
    """The arguments as values, in the order they are written in; None after an error."""
    values: list[Expr] = []
    for argument in node.args:
        if argument.value is None:
            c.error(argument.pos, "arguments", f"the argument {argument.name} is missing")
            return None
        values.append(c.expr(argument.value, expected))
    return None if any(v.type is ERROR for v in values) else values


def _joined(c: Checker, symbol: PouSymbol, name: str, node: ast.Call, values: list[Expr]) -> Expr:
    """`CONCAT(a, b, c)`, `CONCAT(IN1 := a, IN2 := b, IN3 := c)`"""
    ordered: dict[int, Expr] = {}
    for i, (argument, value) in enumerate(zip(node.args, values, strict=True), 1):
        match = re.fullmatch(r"(?:IN|STR)([1-9]\d{0,2})", (argument.name or f"IN{i}").upper())
        place = int(match[1]) if match else 0
        if argument.output or not 1 <= place <= len(values) or place in ordered:
            return c.error(argument.pos, "arguments", f"{name} has no parameter {argument.name or i} here")
        ordered[place] = value
    result = ordered[1]
    for place in range(2, len(values) + 1):
        result = _call_checked(c, symbol, [result, ordered[place]], node.pos, None)
    return result


def _call_generic(
    c: Checker,
    symbol: PouSymbol,
    args: list[ast.Argument],
    offset: int,
    expected: Type | None,
    *,
    formal: bool,
) -> Expr:
    lines = parameter_lines(symbol.decl)
    bound = bind(c, args, [(name, d) for name, d, _ in lines], symbol.decl.name, offset)
    if bound is None:
        return error_value(c.pos(offset))
    values: dict[int, Actual] = {}
    for i, argument in bound.items():
        if lines[i][1] is Direction.INPUT and argument.value is not None:
            values[i] = c.expr(argument.value, expected if lines[i][2] else None)
        else:
            values[i] = argument
    return _instantiate(c, symbol, values, offset, expected, formal=formal)


def _instantiate(
    c: Checker,
    symbol: PouSymbol,
    values: dict[int, Actual],
    offset: int,
    expected: Type | None,
    *,
    formal: bool = False,
) -> Expr:
    """Finds the types the ANY_... parameters stand for, and calls that instance."""
    name = symbol.decl.name
    if symbol.library and name == "LIMIT":
        given = {i: value for i, value in values.items() if value is not None and not isinstance(value, ast.Argument)}
        narrow, whole = wholly(c, list(given.values()), name, offset, expected)
        if narrow is not None:
            values = values | dict(zip(given, whole, strict=True))
            return cut(_instantiate(c, symbol, values, offset, None, formal=formal), narrow)
    groups: dict[str, list[Expr]] = {}
    bindings: dict[str, Type] = {}
    for i, (parameter, direction, group) in enumerate(parameter_lines(symbol.decl)):
        actual = values.get(i)
        if group is None:
            continue
        if actual is None and direction is Direction.OUTPUT:
            bindings.setdefault(group, first_of(group))
            continue
        if actual is None:
            return c.error(offset, "arguments", f"the argument {parameter} of {name} is missing")
        if isinstance(actual, ast.Argument):
            assert actual.value is not None
            actual = c.expr(actual.value)
        if actual.type is ERROR:
            return error_value(c.pos(offset))
        groups.setdefault(group, []).append(actual)
    for group, members in groups.items():
        t = _group_type(c, members, group, name, offset, expected)
        if t is None:
            return error_value(c.pos(offset))
        bindings[group] = t
    result = symbol.decl.result
    if isinstance(result, ast.NamedType) and is_group(result.name) and result.name.upper() not in bindings:
        everything = [e for members in groups.values() for e in members]
        t = _group_type(c, everything, result.name.upper(), name, offset, expected)
        if t is None:
            return error_value(c.pos(offset))
        bindings[result.name.upper()] = t
    info = c.world.declared.function(symbol, bindings)
    if info is None:
        return c.error(offset, "recursion", f"{name} calls itself, which is not possible on a controller")
    return typed_call(c, info, values, offset, formal=formal)


def _group_type(
    c: Checker, members: list[Expr], group: str, name: str, offset: int, expected: Type | None
) -> Type | None:
    """The common type of arguments, which has to belong to the group; None after an error."""
    wanted = expected if expected is not None and accepts(group, expected) else None
    result = common_of(c, members, name, offset, wanted)
    if result is ERROR:
        return None
    if isinstance(result, StringType):
        result = WIDE_LIBRARY_STRING if result.wide else LIBRARY_STRING
    if group == "ANY_REAL" and not accepts(group, result) and elementary(result) is not None:
        result = LREAL if _is_large(result) else REAL
    if not accepts(group, result):
        c.error(offset, "type", f"{name} takes {group_name(group)}, not {result}")
        return None
    return result


def overload_call(c: Checker, name: str, node: ast.Call, expected: Type | None) -> Expr:
    """`SIN` stands for SIN__REAL or SIN__LREAL, as the arguments need it."""
    values = _argument_values(c, node, expected)
    if values is None:
        return error_value(c.pos(node.pos))
    symbol = _best_overload(c, name, values, expected)
    if symbol is None:
        types = ", ".join(str(settle(v).type) for v in values) or "no arguments"
        return c.error(node.pos, "type", f"there is no {name} for {types}")
    info = c.world.declared.function(symbol, {})
    assert info is not None
    bound = bind(c, node.args, [(s.name, d) for s, d in info.parameters], name.upper(), node.pos)
    if bound is None:
        return error_value(c.pos(node.pos))
    checked = {i: v for (i, _), v in zip(bound.items(), values, strict=True)}
    return typed_call(c, info, dict(checked), node.pos)


def _best_overload(c: Checker, name: str, values: list[Expr], expected: Type | None) -> PouSymbol | None:
    """By the common type of the arguments: an exact suffix, else REAL or LREAL."""
    suffixes = {o.rpartition("__")[2].upper(): o for o in c.world.names.library.overloads(name.casefold())}
    typed = [v.type for v in values if not is_untyped(v)]
    wanted: Type | None = typed[0] if typed else settle(values[0], expected).type if values else None
    for t in typed[1:]:
        wanted = None if wanted is None else common_type(wanted, t)
    if wanted is None:
        return None
    candidates = [wanted.keyword if isinstance(wanted, StringType) else str(elementary(wanted) or wanted)]
    if elementary(wanted) is not None:
        prefer_real = not _is_large(wanted) if typed else expected is REAL
        candidates += ["REAL", "LREAL"] if prefer_real else ["LREAL", "REAL"]
    for candidate in candidates:
        if candidate in suffixes:
            symbol = c.world.names.unit(suffixes[candidate].casefold(), library=True)
            return symbol if isinstance(symbol, PouSymbol) else None
    return None


def _is_large(t: Type) -> bool:
    """Whether a number needs LREAL."""
    base = elementary(t)
    return base is not None and base is not REAL and base.bits > 16
