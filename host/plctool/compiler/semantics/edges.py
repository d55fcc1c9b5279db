"""Inputs with R_EDGE and F_EDGE: where the program reads one, it gets whether the input has just risen or fallen.

Beside such an input are two more variables: its value at the previous call, and the edge. The body begins by computing
the edge, and sees it under the name of the input; all others see the input itself.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import VarSymbol
from plctool.compiler.typed import Assign, Binary, BinaryOp, Load, Unary, UnaryOp, Variable, VarPlace
from plctool.iec.types import BOOL

RISING = "R_EDGE"


def edge_variables(raw: Variable) -> tuple[Variable, Variable]:
    """What an input was at the previous call, and its edge; they have no name in the program."""
    owner, dot, name = raw.name.rpartition(".")
    last, edge = (Variable(f"{owner}{dot}%{name}.{e}", BOOL, raw.storage, raw.pos) for e in ("before", "edge"))
    return last, edge


def see_edge(symbol: VarSymbol, kind: str, last: Variable, edge: Variable, scope: Scope) -> None:
    """Lets the body in `scope` see the edge (`kind`: R_EDGE or F_EDGE) in place of the input."""
    assert symbol.variable is not None
    pos = symbol.pos
    now, before = (Load(VarPlace(v, BOOL, pos), BOOL, pos) for v in (symbol.variable, last))
    high, low = (now, before) if kind == RISING else (before, now)
    found = Binary(BinaryOp.AND, high, Unary(UnaryOp.NOT, low, BOOL, pos), BOOL, pos)
    scope.prologue += [Assign(VarPlace(edge, BOOL, pos), found, pos), Assign(VarPlace(last, BOOL, pos), now, pos)]
    scope.edges[symbol.name.casefold()] = replace(symbol, variable=edge)
