"""What diagrams need to know of units of the standard library before the program is checked.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from functools import cache

from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.syntax.library import standard_library, without_library

COMPARISONS = frozenset(("GT", "GE", "EQ", "LE", "LT", "NE"))
_OPERATORS = COMPARISONS | {
    "MOVE", "ABS", "NOT", "SHL", "SHR", "ROL", "ROR", "SQRT", "AND", "OR", "XOR", "ADD", "SUB", "MUL", "DIV", "MOD",
    "SEL", "MUX", "MAX", "MIN", "LIMIT",
}  # fmt: skip
_CONVERSION = re.compile(r"(?:\w+?_)?(?:TO|TRUNC|AS)_(\w+)")


def is_operator(name: str) -> bool:
    """True if a function is one whose types follow from its arguments."""
    return name.upper() in _OPERATORS or _CONVERSION.fullmatch(name.upper()) is not None


@cache
def is_declared(name: str) -> bool:
    """True if the standard library has a unit of this name."""
    units = standard_library().parse(without_library(name).casefold(), Diagnostics())
    return any(isinstance(unit, ast.PouDecl) for unit in units)


@cache
def parameters(name: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The names of inputs and outputs of a unit of the standard library, in order; () if it has none."""
    for unit in standard_library().parse(without_library(name).casefold(), Diagnostics()):
        if isinstance(unit, ast.PouDecl):
            return parameters_of(unit)
    return (), ()


def parameters_of(unit: ast.PouDecl) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The names of inputs and outputs of a unit, in order."""
    kinds = (ast.Section.VAR_INPUT, ast.Section.VAR_IN_OUT), (ast.Section.VAR_OUTPUT,)
    inputs, outputs = (
        tuple(n for b in unit.blocks if b.keyword in kind for d in b.decls for _, n in d.names) for kind in kinds
    )
    return inputs, outputs
