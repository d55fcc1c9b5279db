"""Builds the actions and priorities of a Sequential Function Chart.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.compiler.syntax.lexer import Report, Token

TIMED = frozenset(("L", "D", "SD", "DS", "SL"))
QUALIFIERS = TIMED | {"N", "R", "S", "P", "P0", "P1"}


def read_action(node: ast.Expr, report: Report) -> ast.StepAction | None:
    """`name(qualifier, time, indicators)`, of which all but the name may be left out; None after an error."""
    args: list[ast.Expr] = []
    target = node
    if isinstance(node, ast.Call):
        target = node.callee
        for argument in node.args:
            if argument.name is not None or argument.value is None:
                report(argument.pos, "syntax", "what a step does is written action(qualifier, time, indicator)")
                return None
            args.append(argument.value)
    name = _dotted(target)
    if name is None:
        report(node.pos, "syntax", "a step names actions and BOOL variables; put statements into an ACTION")
        return None
    qualifier, rest = ("N", args) if not args else (_qualifier(args[0], report), args[1:])
    if qualifier not in TIMED:
        return ast.StepAction(node.pos, name, target, qualifier, None, rest)
    if not rest:
        report(args[0].pos, "syntax", f"{qualifier} needs a time: write {qualifier}, T#1s")
        return None
    return ast.StepAction(node.pos, name, target, qualifier, rest[0], rest[1:])


def _dotted(node: ast.Expr) -> str | None:
    """`a` or `a.b`; None for anything else."""
    if isinstance(node, ast.Member):
        base = _dotted(node.base)
        return None if base is None else f"{base}.{node.name}"
    return node.name if isinstance(node, ast.Name) else None


def _qualifier(node: ast.Expr, report: Report) -> str:
    name = node.name.upper() if isinstance(node, ast.Name) else ""
    if name in QUALIFIERS:
        return name
    listed = "N, R, S, P, P0, P1, L, D, SD, DS or SL"
    found = f", not {name}{did_you_mean(name, QUALIFIERS)}" if name else ""
    report(node.pos, "syntax", f"the qualifier of an action is {listed}{found}")
    return "N"


def read_priority(word: Token, number: Token, report: Report) -> int | None:
    """The number in `(PRIORITY := number)`; the lowest goes first."""
    if word.text.upper() != "PRIORITY":
        report(word.pos, "syntax", f"expected PRIORITY, found {word.text}")
    elif not number.text.isdigit():
        report(number.pos, "syntax", f"a priority is a whole number, not {number.text}")
    else:
        return int(number.text)
    return None
