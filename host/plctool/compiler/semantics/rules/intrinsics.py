"""Functions that become an instruction or a few: ABS, SQRT, SHL, SEL, MUX, MIN, TIME and their kin.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re

from plctool.compiler.semantics import constants
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import NUMBERS, convert, elementary, error_value, settle
from plctool.compiler.semantics.rules.applied import Applied, BuiltIn, named
from plctool.compiler.semantics.rules.common_types import common_of, untyped_bits
from plctool.compiler.semantics.rules.library_calls import call_by_name
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.semantics.values import is_untyped, load
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Const, Expr, Intrinsic, IntrinsicCall, VarPlace
from plctool.iec.types import (
    BOOL,
    DINT,
    ELEMENTARY,
    LINT,
    LREAL,
    REAL,
    Kind,
    StringType,
    Type,
    is_scalar,
)

_SHIFTS = {"SHL": Intrinsic.SHL, "SHR": Intrinsic.SHR, "ROL": Intrinsic.ROL, "ROR": Intrinsic.ROR}


def _intrinsic(c: Checker, intrinsic: Intrinsic, args: list[Expr], t: Type, node: ast.Call) -> Expr:
    pos = c.pos(node.pos)
    if any(a.type is ERROR for a in args):
        return error_value(pos)
    if all(isinstance(a, Const) for a in args):
        value = constants.intrinsic(intrinsic, [a.value for a in args if isinstance(a, Const)], t)
        if value is not None:
            return Const(value, t, pos)
    return IntrinsicCall(intrinsic, args, t, pos)


def _abs(c: Checker, f: Applied) -> Expr:
    e = f.args[0] if is_untyped(f.args[0]) else settle(f.args[0])
    base = elementary(e.type)
    if base is None or base.kind not in (Kind.INT, Kind.REAL, Kind.TIME):
        return c.error(f.node.pos, "type", f"ABS needs a number, not {e.type}")
    return _intrinsic(c, Intrinsic.ABS, [convert(e, base)], base, f.node)


def _sqrt(c: Checker, f: Applied) -> Expr:
    e = f.args[0]
    base = elementary(e.type)
    if base is None or base.kind not in (Kind.INT, Kind.REAL):
        return c.error(f.node.pos, "type", f"SQRT needs a REAL or LREAL, not {e.type}")
    if base.kind is Kind.REAL and not is_untyped(e):
        target: Type = base
    elif f.expected is REAL or f.expected is LREAL:
        target = f.expected
    else:
        target = REAL if base.bits <= 16 else LREAL
    return _intrinsic(c, Intrinsic.SQRT, [c.coerce(e, target)], target, f.node)


def _shift(c: Checker, f: Applied) -> Expr:
    value = untyped_bits(c, f.args[0], f.expected) if is_untyped(f.args[0]) else f.args[0]
    if value.type is ERROR:
        return value
    base = elementary(value.type)
    if base is None or base.kind not in NUMBERS:
        return c.error(f.node.pos, "type", f"{f.name} needs a bit string, not {value.type}")
    count = settle(f.args[1])
    by = elementary(count.type)
    if by is None or by.kind not in NUMBERS:
        return c.error(f.node.pos, "type", f"{f.name} shifts by an integer, not by {count.type}")
    wide = LINT if by.bits == 64 or (by.bits == 32 and not by.signed) else DINT
    return _intrinsic(c, _SHIFTS[f.name], [convert(value, base), convert(count, wide)], base, f.node)


def _select(c: Checker, f: Applied) -> Expr:
    selector = c.coerce(f.args[0], BOOL)
    return _choose(c, Intrinsic.SELECT, selector, f)


def _mux(c: Checker, f: Applied) -> Expr:
    selector = settle(f.args[0])
    base = elementary(selector.type)
    if base is None or base.kind not in NUMBERS:
        return c.error(f.node.pos, "type", f"MUX chooses by an integer, not by {selector.type}")
    return _choose(c, Intrinsic.MUX, convert(selector, base), f)


def _mux_index(key: str) -> int | None:
    """K, IN0, IN1 ..."""
    return 0 if key == "K" else int(key[2:]) + 1 if re.fullmatch(r"IN\d{1,3}", key) else None


def _choose(c: Checker, intrinsic: Intrinsic, selector: Expr, f: Applied) -> Expr:
    """One of the arguments after the selector."""
    values = f.args[1:]
    t = common_of(c, values, f.name, f.node.pos, f.expected)
    if t is ERROR or selector.type is ERROR:
        return error_value(c.pos(f.node.pos))
    return _intrinsic(c, intrinsic, [selector, *(c.coerce(v, t) for v in values)], t, f.node)


def _extreme(c: Checker, f: Applied) -> Expr:
    t = common_of(c, f.args, f.name, f.node.pos, f.expected)
    if t is ERROR:
        return error_value(c.pos(f.node.pos))
    if isinstance(t, StringType):
        result = f.args[0]
        for argument in f.args[1:]:
            result = call_by_name(c, f.name, [result, argument], f.node.pos, None)
        return result
    if not is_scalar(t):
        return c.error(f.node.pos, "type", f"{f.name} cannot compare values of type {t}")
    result = c.coerce(f.args[0], t)
    for argument in f.args[1:]:
        result = _intrinsic(c, Intrinsic[f.name], [result, c.coerce(argument, t)], t, f.node)
    return result


def _time(c: Checker, f: Applied) -> Expr:
    if c.world.clock is not None:
        variable = c.world.clock[f.name]
        return load(VarPlace(variable, variable.type, c.pos(f.node.pos)))
    return IntrinsicCall(Intrinsic[f.name], [], ELEMENTARY[f.name], c.pos(f.node.pos))


FUNCTIONS: dict[str, BuiltIn] = {
    **dict.fromkeys(_SHIFTS, BuiltIn(_shift, 2, 2, named("IN", "N"))),
    "ABS": BuiltIn(_abs, 1, 1),
    "SQRT": BuiltIn(_sqrt, 1, 1),
    "SEL": BuiltIn(_select, 3, 3, named("G", "IN0", "IN1")),
    "MUX": BuiltIn(_mux, 3, None, _mux_index),
    "MIN": BuiltIn(_extreme, 2),
    "MAX": BuiltIn(_extreme, 2),
    "TIME": BuiltIn(_time, 0, 0),
    "LTIME": BuiltIn(_time, 0, 0),
}
