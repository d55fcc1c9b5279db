"""Functions the compiler knows itself.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.rules import intrinsics, operator_functions, variable_questions
from plctool.compiler.semantics.rules.applied import Applied, BuiltIn
from plctool.compiler.semantics.rules.conversion_calls import conversion, conversion_hint
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Const, Expr
from plctool.iec.types import (
    BOOL,
    StringType,
    Type,
)

_PLACES = ("__POUNAME", "__POSITION")
_FUNCTIONS = operator_functions.FUNCTIONS | intrinsics.FUNCTIONS | variable_questions.FUNCTIONS


def built_in_call(c: Checker, name: str, node: ast.Call, expected: Type | None) -> Expr | None:
    """The call of a built-in function; None when there is none of that name."""
    if name in variable_questions.OF_VARIABLES:
        return variable_questions.of_variable(c, name, node)
    if name in _PLACES:
        return _place(c, name, node)
    function = _FUNCTIONS.get(name)
    if function is None:
        return conversion(c, name, node, expected)
    args = _checked_arguments(c, name, function, node, expected)
    if args is None:
        return error_value(c.pos(node.pos))
    if not function.takes(len(args)):
        return c.error(node.pos, "arguments", f"{name} takes {function.needs}, not {len(args)}")
    return function.rule(c, Applied(name, args, node, expected))


def _place(c: Checker, name: str, node: ast.Call) -> Expr:
    """`__POUNAME()`: the name of the unit around; `__POSITION()`: line and column, as a text."""
    if node.args:
        return c.error(node.pos, "arguments", f"{name} takes no arguments")
    pos = c.pos(node.pos)
    pou = c.scope.source.stem if c.scope.pou is None else c.scope.pou.name
    text = pou if name == "__POUNAME" else f"Line {pos.line}, Column {pos.column}"
    return Const(text, StringType(max(len(text), 1)), pos)


def function_hint(c: Checker, name: str) -> str:
    """`; did you mean ADD?` for an unknown function, else nothing: what the program has comes first."""
    return (
        conversion_hint(c, name.upper())
        or did_you_mean(name, c.world.names.function_names())
        or did_you_mean(name, [*_FUNCTIONS, *variable_questions.OF_VARIABLES])
    )


def _checked_arguments(
    c: Checker, name: str, function: BuiltIn, node: ast.Call, expected: Type | None
) -> list[Expr] | None:
    """Checked arguments in order; formal ones by the names of the standard."""
    found: dict[int, Expr] = {}
    for i, argument in enumerate(node.args):
        at = _index_of(function, argument, i)
        if at is None or at in found or argument.value is None:
            c.error(argument.pos, "arguments", f"{name} has no parameter {argument.name or i + 1}")
            return None
        hint = None if name in operator_functions.COMPARING else expected
        found[at] = c.expr(argument.value, BOOL if name == "SEL" and at == 0 else hint)
    if sorted(found) != list(range(len(found))):
        c.error(node.pos, "arguments", f"an argument of {name} is missing")
        return None
    args = [found[i] for i in sorted(found)]
    return None if any(a.type is ERROR for a in args) else args


def _index_of(function: BuiltIn, argument: ast.Argument, i: int) -> int | None:
    """Which argument this is; None when the function has none of that name."""
    if argument.output:
        return None
    return i if argument.name is None else function.index_of(argument.name.upper())
