"""Operators as functions: `ADD(a, b, c)`, `GT(a, b)`, `NOT(a)`, `ADD_DT_TIME(a, b)`.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from itertools import pairwise

from plctool.compiler.semantics import dates
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import NUMBERS, convert, elementary, settle
from plctool.compiler.semantics.rules.applied import Applied, BuiltIn
from plctool.compiler.semantics.rules.operators import fold_unary, operate
from plctool.compiler.typed import BinaryOp, Expr, UnaryOp
from plctool.iec.types import (
    BOOL,
)

_FOLDED = {
    "ADD": BinaryOp.ADD, "MUL": BinaryOp.MUL, "AND": BinaryOp.AND, "OR": BinaryOp.OR, "XOR": BinaryOp.XOR,
}  # fmt: skip
_PAIRS = {"SUB": BinaryOp.SUB, "DIV": BinaryOp.DIV, "MOD": BinaryOp.MOD, "NE": BinaryOp.NE}
_CHAINS = {"GT": BinaryOp.GT, "GE": BinaryOp.GE, "EQ": BinaryOp.EQ, "LE": BinaryOp.LE, "LT": BinaryOp.LT}


def _folded(c: Checker, f: Applied) -> Expr:
    result = f.args[0]
    for argument in f.args[1:]:
        result = operate(c, _FOLDED[f.name], result, argument, f.node.pos, f.expected)
    return result


def _pair(c: Checker, f: Applied) -> Expr:
    return operate(c, _PAIRS[f.name], f.args[0], f.args[1], f.node.pos, f.expected)


def _chain(c: Checker, f: Applied) -> Expr:
    """`GT(a, b, c)` is `a > b AND b > c`."""
    result = operate(c, _CHAINS[f.name], f.args[0], f.args[1], f.node.pos)
    for left, right in pairwise(f.args[1:]):
        more = operate(c, _CHAINS[f.name], left, right, f.node.pos)
        result = operate(c, BinaryOp.AND, result, more, f.node.pos)
    return result


def _not(c: Checker, f: Applied) -> Expr:
    e = settle(f.args[0], f.expected)
    base = elementary(e.type)
    if base is None or not (base is BOOL or base.kind in NUMBERS):
        return c.error(f.node.pos, "type", f"NOT needs a BOOL or a bit string, not {e.type}")
    return fold_unary(c, UnaryOp.NOT, convert(e, base), f.node.pos)


def _moved(c: Checker, f: Applied) -> Expr:
    return f.args[0]


def _dated(c: Checker, f: Applied) -> Expr:
    """`ADD_DT_TIME(a, b)` and its kin."""
    op, first, second = dates.FUNCTIONS[f.name]
    right = f.args[1] if second is None else c.coerce(f.args[1], second)
    return operate(c, op, c.coerce(f.args[0], first), right, f.node.pos, f.expected)


FUNCTIONS: dict[str, BuiltIn] = {
    **dict.fromkeys(_FOLDED, BuiltIn(_folded, 2)),
    **dict.fromkeys(_PAIRS, BuiltIn(_pair, 2, 2)),
    **dict.fromkeys(_CHAINS, BuiltIn(_chain, 2)),
    **dict.fromkeys(dates.FUNCTIONS, BuiltIn(_dated, 2, 2)),
    "NOT": BuiltIn(_not, 1, 1),
    "MOVE": BuiltIn(_moved, 1, 1),
}
COMPARING = frozenset((*_CHAINS, "NE"))
"""Those whose result says nothing of the type of their arguments."""
