"""Enumerations and subranges: types whose values are some of an integer type.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics import constants
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import ERROR, Role, VarSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Const, Initial, Pos, ScalarInit
from plctool.iec.types import INT, Elementary, EnumType, Kind, SubrangeType, Type


def enumeration(
    world: World, spec: ast.EnumSpec, base: Type, scope: Scope, name: str | None
) -> tuple[Type, Initial | None]:
    """`(First, Second := 5) base`; `base` is ERROR after an error."""
    if base is ERROR:
        return ERROR, None
    if not isinstance(base, Elementary) or base.kind not in (Kind.INT, Kind.BIT):
        scope.error(spec.pos, "type", f"an enumeration is based on an integer type, not on {base}")
        return ERROR, None
    t = EnumType(name or "", base, {})
    inner = Scope(scope.globals, scope.source, scope.library, dict(scope.names), scope.bindings)
    checker, value, seen = Checker(world, inner), -1, set[str]()
    for offset, value_name, node in spec.values:
        key = value_name.casefold()
        if key in seen:
            scope.error(offset, "duplicate", f"{value_name} is in this enumeration already")
            continue
        if not value_name:
            scope.error(offset, "syntax", f"the values of an enumeration have names; {base} has no arguments")
            return ERROR, None
        seen.add(key)
        given = None if node is None or isinstance(node, ast.ArrayInit | ast.StructInit) else checker.integer(node)
        value = value + 1 if given is None else given
        if not constants.fits(value, base):
            scope.error(offset, "range", f"{value} does not fit {base}")
            value = 0
        t.values[value_name] = value
        inner.names[key] = _value_symbol(t, value_name, scope.pos(offset))
        if name is None:
            scope.names.setdefault(key, inner.names[key])
    t.name = name or _inline_name(t)
    first = next(iter(t.values.values()), 0)
    return t, ScalarInit(first) if first else None


def _inline_name(t: EnumType) -> str:
    """`(First, Second := 5) DINT`: all that the type is, as there may be others with such names."""
    values, following = list[str](), 0
    for name, value in t.values.items():
        values.append(name if value == following else f"{name} := {value}")
        following = value + 1
    return f"({', '.join(values)})" + (f" {t.base}" if t.base is not INT else "")


def subrange(
    world: World, spec: ast.SubrangeSpec, base: Type, scope: Scope, name: str | None
) -> tuple[Type, Initial | None]:
    """`base(low..high)`; `base` is ERROR after an error."""
    checker = Checker(world, scope)
    low, high = checker.integer(spec.low), checker.integer(spec.high)
    if base is ERROR or low is None or high is None:
        return ERROR, None
    limits: tuple[int, int] | None = None
    if isinstance(base, SubrangeType):
        limits, number = (base.low, base.high), base.base
    elif isinstance(base, Elementary) and base.kind in (Kind.INT, Kind.BIT):
        limits, number = constants.limits(base), base
    if limits is None:
        scope.error(spec.pos, "type", f"a subrange needs an integer base type, not {base}")
        return ERROR, None
    if not limits[0] <= low <= high <= limits[1]:
        scope.error(spec.low.pos, "range", f"{low}..{high} is not a range of {base}")
        return ERROR, None
    t = SubrangeType(name or f"{base}({low}..{high})", number, low, high)
    return t, ScalarInit(low) if low else None


def _value_symbol(t: EnumType, name: str, pos: Pos) -> VarSymbol:
    constant = Const(t.values[name], t, pos)
    return VarSymbol(name, pos, t, Role.LOCAL, value=constant, constant=True, used=True)


def values_of(t: EnumType, pos: Pos) -> dict[str, VarSymbol]:
    """The values of an enumeration as names, case-folded."""
    return {name.casefold(): _value_symbol(t, name, pos) for name in t.values}
