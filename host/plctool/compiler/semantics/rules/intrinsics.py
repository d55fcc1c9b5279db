"""Functions that become an instruction or a few: ABS, SQRT, SHL, SEL, MUX, MIN and their kin; operators as functions,
`ADD(a, b, c)`; both also with a type, `ADD_INT(a, b)`.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

from plctool.compiler.semantics import arithmetic, constants
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import (
    convert,
    cut,
    elementary,
    error_value,
    is_narrow,
    is_untyped,
    load,
    settle,
    whole_value,
)
from plctool.compiler.semantics.once import calls, kept_value
from plctool.compiler.semantics.rules.library_calls import call_by_name
from plctool.compiler.semantics.rules.literals import common_of, untyped_bits, wholly
from plctool.compiler.semantics.rules.operators import fold_unary, operate
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.semantics.widths import negated_type
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import BinaryOp, Const, Expr, Intrinsic, IntrinsicCall, UnaryOp, VarPlace
from plctool.iec.common_types import NUMBERS
from plctool.iec.types import BOOL, DINT, ELEMENTARY, LINT, LREAL, REAL, Kind, StringType, Type, is_scalar

# ---- what every function that is built in is ----


@dataclass(frozen=True)
class Applied:
    """A function with its checked arguments, none of which is wrong."""

    name: str
    args: list[Expr]
    node: ast.Call
    expected: Type | None


def _numbered(key: str) -> int | None:
    """IN, or IN1, IN2 ..."""
    if key == "IN":
        return 0
    return int(key[2:]) - 1 if re.fullmatch(r"IN[1-9]\d{0,2}", key) else None


@dataclass(frozen=True)
class BuiltIn:
    """What a function becomes, how many arguments it takes (`most` is None when there is no limit), and which of them
    a name in capitals stands for."""

    rule: Callable[[Checker, Applied], Expr]
    least: int
    most: int | None = None
    index_of: Callable[[str], int | None] = _numbered

    def takes(self, count: int) -> bool:
        """Whether the number of arguments is right."""
        return self.least <= count and (self.most is None or count <= self.most)

    @property
    def needs(self) -> str:
        """The number of arguments in words."""
        if self.most is None:
            return f"at least {self.least} arguments"
        return "1 argument" if self.least == 1 else f"{self.least} arguments"


def named(*names: str) -> Callable[[str], int | None]:
    """The arguments have these names."""
    return lambda key: names.index(key) if key in names else None


# ---- `ADD_INT(a, b)` is ADD for arguments that are INT ----

_OF_ONE_TYPE = (
    "ABS", "SQRT", "LN", "LOG", "EXP", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "ATAN2", "ADD", "SUB", "MUL", "DIV",
    "MOD", "MOVE", "AND", "OR", "XOR", "NOT", "MIN", "MAX", "LIMIT", "GT", "GE", "EQ", "LE", "LT", "NE", "LEN",
    "CONCAT", "FIND",
)  # fmt: skip
_OTHER_ARGUMENTS: dict[str, tuple[int | str, ...]] = {
    **dict.fromkeys(_OF_ONE_TYPE, ()),
    **dict.fromkeys(("SHL", "SHR", "ROL", "ROR"), (1, "N")),
    "SEL": (0, "G"), "MUX": (0, "K"), "EXPT": (1, "IN2"),
    "LEFT": (1, "L"), "RIGHT": (1, "L"), "MID": (1, 2, "L", "P"), "DELETE": (1, 2, "L", "P"), "INSERT": (2, "P"),
    "REPLACE": (2, 3, "L", "P"),
}  # fmt: skip
"""The overloaded functions, and which of their arguments have a type of their own: by place and by name."""


def overloaded_form(node: ast.Call) -> ast.Call | None:
    """`ADD(INT_TO_INT(a), INT_TO_INT(b))` for `ADD_INT(a, b)`; None when the name is none of these."""
    if not isinstance(node.callee, ast.Name):
        return None
    name, _, type_name = node.callee.name.upper().partition("_")
    if name not in _OTHER_ARGUMENTS or type_name not in (*ELEMENTARY, "STRING", "WSTRING"):
        return None
    others = _OTHER_ARGUMENTS[name]
    args = [
        argument if i in others or (argument.name or "").upper() in others else _of_type(argument, type_name)
        for i, argument in enumerate(node.args)
    ]
    return replace(node, callee=replace(node.callee, name=name), args=args)


def _of_type(argument: ast.Argument, type_name: str) -> ast.Argument:
    """The argument, converted as an assignment to a variable of the type would."""
    value = argument.value
    if value is None or argument.output:
        return argument
    conversion = ast.Name(value.pos, f"{type_name}_TO_{type_name}")
    return replace(argument, value=ast.Call(value.pos, conversion, [ast.Argument(value.pos, None, value)]))


# ---- operators as functions ----

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
    inner = [kept_value(c, e, e.type) if calls(e) else (e, e) for e in f.args[1:-1]]
    rights, lefts = ([*(pair[n] for pair in inner), f.args[-1]] for n in (0, 1))
    result = operate(c, _CHAINS[f.name], f.args[0], rights[0], f.node.pos)
    for left, right in zip(lefts, rights[1:], strict=False):
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
    op, first, second = arithmetic.FUNCTIONS[f.name]
    right = f.args[1] if second is None else c.coerce(f.args[1], second)
    return operate(c, op, c.coerce(f.args[0], first), right, f.node.pos, f.expected)


_OPERATORS: dict[str, BuiltIn] = {
    **dict.fromkeys(_FOLDED, BuiltIn(_folded, 2)),
    **dict.fromkeys(_PAIRS, BuiltIn(_pair, 2, 2)),
    **dict.fromkeys(_CHAINS, BuiltIn(_chain, 2)),
    **dict.fromkeys(arithmetic.FUNCTIONS, BuiltIn(_dated, 2, 2)),
    "NOT": BuiltIn(_not, 1, 1),
    "MOVE": BuiltIn(_moved, 1, 1),
}
COMPARING = frozenset((*_CHAINS, "NE"))
"""Those whose result says nothing of the type of their arguments."""


# ---- a few instructions ----

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
    if c.dialect.computes_in_32_bits and is_narrow(base):
        e = whole_value(e)
        t = negated_type(e)
        return cut(_intrinsic(c, Intrinsic.ABS, [convert(e, t)], t, f.node), base)
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
    narrow, values = wholly(c, values, f.name, f.node.pos, f.expected)
    if narrow is not None:
        return cut(_choose(c, intrinsic, selector, replace(f, args=[selector, *values])), narrow)
    t = common_of(c, values, f.name, f.node.pos, f.expected)
    if t is ERROR or selector.type is ERROR:
        return error_value(c.pos(f.node.pos))
    return _intrinsic(c, intrinsic, [selector, *(c.coerce(v, t) for v in values)], t, f.node)


def _extreme(c: Checker, f: Applied) -> Expr:
    narrow, values = wholly(c, f.args, f.name, f.node.pos, f.expected)
    if narrow is not None:
        return cut(_extreme(c, replace(f, args=values)), narrow)
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
    if c.world.clock:
        variable = c.world.clock[f.name]
        return load(VarPlace(variable, variable.type, c.pos(f.node.pos)))
    return IntrinsicCall(Intrinsic[f.name], [], ELEMENTARY[f.name], c.pos(f.node.pos))


FUNCTIONS: dict[str, BuiltIn] = {
    **_OPERATORS,
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
