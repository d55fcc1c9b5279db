"""The names of enumeration values as strings: what TO_STRING gives of an enumeration with {attribute 'to_string'}.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import convert
from plctool.compiler.semantics.symbols import PouSymbol
from plctool.compiler.source import Source
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.parser import parse
from plctool.compiler.typed import Call, Expr
from plctool.iec.types import EnumType


def value_name(c: Checker, e: Expr, offset: int) -> Expr:
    """The name of a value, by a function made for its enumeration; the number of one without a name."""
    t = e.type
    assert isinstance(t, EnumType)
    made = c.world.enumeration_texts
    symbol = made.get(t)
    if symbol is None:
        symbol = made[t] = _function(t, len(made) + 1)
    info = c.world.declared.function(symbol, {})
    assert info is not None and info.result is not None
    return Call(info.pou, [convert(e, t.base)], info.result, c.pos(offset))


def _function(t: EnumType, number: int) -> PouSymbol:
    """`CASE value OF 1: NAME := 'Run'; ...`"""
    name, wide = f"VALUE_NAME_{number}__", "LINT" if t.base.signed else "ULINT"
    first: dict[int, str] = {}
    for value_name_, value in t.values.items():
        first.setdefault(value, value_name_)
    branches = "\n".join(f"{value}: {name} := '{written}';" for value, written in first.items())
    text = f"""FUNCTION {name} : STRING
VAR_INPUT value : {t.base}; END_VAR
CASE value OF
{branches}
ELSE {name} := {wide}_TO_STRING({t.base}_TO_{wide}(value));
END_CASE
END_FUNCTION
"""
    (decl,) = parse(Source("stdlib/enumerations.st", text), _no_error)
    assert isinstance(decl, ast.PouDecl)
    return PouSymbol(decl, library=True)


def _no_error(offset: int, code: str, message: str) -> None:
    raise AssertionError(message)
