"""Functions the compiler knows itself: operators as functions, intrinsics.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Callable
from itertools import pairwise
from typing import Any, ClassVar

from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.semantics import constants, dates
from plctool.compiler.semantics.checker import is_untyped, load, place_of
from plctool.compiler.semantics.conversion_calls import ConversionCalls
from plctool.compiler.semantics.conversions import (
    NUMBERS,
    character,
    common_type,
    convert,
    elementary,
    error_value,
    literal_type,
    settle,
)  # fmt: skip
from plctool.compiler.semantics.open_arrays import bounds_of
from plctool.compiler.semantics.symbols import ERROR, UNTYPED_INT, PouSymbol, TypeSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    Binary,
    BinaryOp,
    Const,
    DerefPlace,
    Expr,
    Intrinsic,
    IntrinsicCall,
    Load,
    UnaryOp,
    ValuePlace,
    VarPlace,
)
from plctool.compiler.types import (
    BOOL,
    CHAR,
    DINT,
    ELEMENTARY,
    LINT,
    LREAL,
    REAL,
    UDINT,
    WCHAR,
    ArrayType,
    Kind,
    OpenArrayType,
    PointerType,
    RawPointerType,
    ReferenceType,
    StringType,
    SubrangeType,
    Type,
    is_scalar,
)  # fmt: skip

_FOLDED = {
    "ADD": BinaryOp.ADD, "MUL": BinaryOp.MUL, "AND": BinaryOp.AND, "OR": BinaryOp.OR, "XOR": BinaryOp.XOR,
}  # fmt: skip
_PAIRS = {"SUB": BinaryOp.SUB, "DIV": BinaryOp.DIV, "MOD": BinaryOp.MOD, "NE": BinaryOp.NE}
_CHAINS = {"GT": BinaryOp.GT, "GE": BinaryOp.GE, "EQ": BinaryOp.EQ, "LE": BinaryOp.LE, "LT": BinaryOp.LT}
_SHIFTS = {"SHL": Intrinsic.SHL, "SHR": Intrinsic.SHR, "ROL": Intrinsic.ROL, "ROR": Intrinsic.ROR}
_FORMAL = {
    "LOWER_BOUND": ("ARR", "DIM"), "UPPER_BOUND": ("ARR", "DIM"),
    "SHL": ("IN", "N"), "SHR": ("IN", "N"), "ROL": ("IN", "N"), "ROR": ("IN", "N"), "SEL": ("G", "IN0", "IN1"),
}  # fmt: skip
_OF_VARIABLES = ("SIZEOF", "XSIZEOF", "ADR", "REF", "__ISVALIDREF")


class Builtins(ConversionCalls):
    """Calls of built-in functions."""

    def built_in(self, name: str, node: ast.Call, expected: Type | None) -> Expr | None:
        """The call of a built-in function; None when there is none of that name."""
        if name in _OF_VARIABLES:
            return self._of_variable(name, node)
        handler = self._functions.get(name)
        if handler is not None:
            args = self._checked_arguments(name, node, expected)
            return error_value(self.pos(node.pos)) if args is None else handler(self, name, args, node, expected)
        return self.conversion(name, node, expected)

    def function_hint(self, name: str) -> str:
        """`; did you mean ADD?` for an unknown function, else nothing: what the program has comes first."""
        return (
            self.conversion_hint(name.upper())
            or did_you_mean(name, self.world.function_names())
            or did_you_mean(name, [*self._functions, *_OF_VARIABLES])
        )

    def _checked_arguments(self, name: str, node: ast.Call, expected: Type | None) -> list[Expr] | None:
        """Checked arguments in order; formal ones by the names of the standard."""
        passes_expected = name not in _CHAINS and name != "NE"
        found: dict[int, Expr] = {}
        for i, argument in enumerate(node.args):
            at = self._index_of(name, argument, i)
            if at is None or at in found or argument.value is None:
                self.error(argument.pos, "arguments", f"{name} has no parameter {argument.name or i + 1}")
                return None
            hint = expected if passes_expected else None
            found[at] = self.expr(argument.value, BOOL if name == "SEL" and at == 0 else hint)
        if sorted(found) != list(range(len(found))):
            self.error(node.pos, "arguments", f"an argument of {name} is missing")
            return None
        args = [found[i] for i in sorted(found)]
        return None if any(a.type is ERROR for a in args) else args

    @staticmethod
    def _index_of(name: str, argument: ast.Argument, i: int) -> int | None:
        if argument.output:
            return None
        if argument.name is None:
            return i
        key = argument.name.upper()
        if name in _FORMAL:
            return _FORMAL[name].index(key) if key in _FORMAL[name] else None
        if name == "MUX":
            return 0 if key == "K" else int(key[2:]) + 1 if re.fullmatch(r"IN\d{1,3}", key) else None
        if key == "IN":
            return 0
        return int(key[2:]) - 1 if re.fullmatch(r"IN[1-9]\d{0,2}", key) else None

    def _count(self, name: str, args: list[Expr], node: ast.Call, least: int, most: int | None = None) -> bool:
        if least <= len(args) and (most is None or len(args) <= most):
            return True
        needs = f"{least}" if most == least else f"at least {least}" if most is None else f"{least} or {most}"
        self.error(
            node.pos, "arguments", f"{name} takes {needs} argument{'' if needs == '1' else 's'}, not {len(args)}"
        )
        return False

    # ---- operators as functions ----

    def _folded(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 2):
            return error_value(self.pos(node.pos))
        result = args[0]
        for argument in args[1:]:
            result = self.operate(_FOLDED[name], result, argument, node.pos, expected)
        return result

    def _pair(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 2, 2):
            return error_value(self.pos(node.pos))
        return self.operate(_PAIRS[name], args[0], args[1], node.pos, expected)

    def _chain(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        """`GT(a, b, c)` is `a > b AND b > c`."""
        if not self._count(name, args, node, 2):
            return error_value(self.pos(node.pos))
        result = self.operate(_CHAINS[name], args[0], args[1], node.pos)
        for left, right in pairwise(args[1:]):
            more = self.operate(_CHAINS[name], left, right, node.pos)
            result = self.operate(BinaryOp.AND, result, more, node.pos)
        return result

    def _not(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 1, 1):
            return error_value(self.pos(node.pos))
        e = settle(args[0], expected)
        base = elementary(e.type)
        if base is None or not (base is BOOL or base.kind in NUMBERS):
            return self.error(node.pos, "type", f"NOT needs a BOOL or a bit string, not {e.type}")
        return self._fold_unary(UnaryOp.NOT, convert(e, base), node.pos)

    def _move(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        return args[0] if self._count(name, args, node, 1, 1) else error_value(self.pos(node.pos))

    def _dated(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        """`ADD_DT_TIME(a, b)` and its kin."""
        if not self._count(name, args, node, 2, 2):
            return error_value(self.pos(node.pos))
        op, first, second = dates.FUNCTIONS[name]
        right = args[1] if second is None else self.coerce(args[1], second)
        return self.operate(op, self.coerce(args[0], first), right, node.pos, expected)

    # ---- intrinsics ----

    def _intrinsic(self, intrinsic: Intrinsic, args: list[Expr], t: Type, node: ast.Call) -> Expr:
        pos = self.pos(node.pos)
        if any(a.type is ERROR for a in args):
            return error_value(pos)
        if all(isinstance(a, Const) for a in args):
            value = constants.intrinsic(intrinsic, [a.value for a in args if isinstance(a, Const)], t)
            if value is not None:
                return Const(value, t, pos)
        return IntrinsicCall(intrinsic, args, t, pos)

    def _abs(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 1, 1):
            return error_value(self.pos(node.pos))
        e = args[0] if is_untyped(args[0]) else settle(args[0])
        base = elementary(e.type)
        if base is None or base.kind not in (Kind.INT, Kind.REAL, Kind.TIME):
            return self.error(node.pos, "type", f"ABS needs a number, not {e.type}")
        return self._intrinsic(Intrinsic.ABS, [convert(e, base)], base, node)

    def _sqrt(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 1, 1):
            return error_value(self.pos(node.pos))
        e = args[0]
        base = elementary(e.type)
        if base is None or base.kind not in (Kind.INT, Kind.REAL):
            return self.error(node.pos, "type", f"SQRT needs a REAL or LREAL, not {e.type}")
        if base.kind is Kind.REAL and not is_untyped(e):
            target: Type = base
        elif expected is REAL or expected is LREAL:
            target = expected
        else:
            target = REAL if base.bits <= 16 else LREAL
        return self._intrinsic(Intrinsic.SQRT, [self.coerce(e, target)], target, node)

    def _shift(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 2, 2):
            return error_value(self.pos(node.pos))
        value = self._untyped_bits(args[0], expected) if is_untyped(args[0]) else args[0]
        if value.type is ERROR:
            return value
        base = elementary(value.type)
        if base is None or base.kind not in NUMBERS:
            return self.error(node.pos, "type", f"{name} needs a bit string, not {value.type}")
        count = settle(args[1])
        by = elementary(count.type)
        if by is None or by.kind not in NUMBERS:
            return self.error(node.pos, "type", f"{name} shifts by an integer, not by {count.type}")
        wide = LINT if by.bits == 64 or (by.bits == 32 and not by.signed) else DINT
        return self._intrinsic(_SHIFTS[name], [convert(value, base), convert(count, wide)], base, node)

    def _select(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 3, 3):
            return error_value(self.pos(node.pos))
        selector = self.coerce(args[0], BOOL)
        return self._choose(Intrinsic.SELECT, name, selector, args[1:], node, expected)

    def _mux(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 3):
            return error_value(self.pos(node.pos))
        selector = settle(args[0])
        base = elementary(selector.type)
        if base is None or base.kind not in NUMBERS:
            return self.error(node.pos, "type", f"MUX chooses by an integer, not by {selector.type}")
        return self._choose(Intrinsic.MUX, name, convert(selector, base), args[1:], node, expected)

    def _choose(
        self, intrinsic: Intrinsic, name: str, selector: Expr, values: list[Expr], node: ast.Call, expected: Type | None
    ) -> Expr:
        t = self.common_of(values, name, node.pos, expected)
        if t is ERROR or selector.type is ERROR:
            return error_value(self.pos(node.pos))
        return self._intrinsic(intrinsic, [selector, *(self.coerce(v, t) for v in values)], t, node)

    def _extreme(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 2):
            return error_value(self.pos(node.pos))
        t = self.common_of(args, name, node.pos, expected)
        if t is ERROR:
            return error_value(self.pos(node.pos))
        if isinstance(t, StringType):
            result = args[0]
            for argument in args[1:]:
                result = self.call_by_name(name, [result, argument], node.pos, None)
            return result
        if not is_scalar(t):
            return self.error(node.pos, "type", f"{name} cannot compare values of type {t}")
        result = self.coerce(args[0], t)
        for argument in args[1:]:
            result = self._intrinsic(Intrinsic[name], [result, self.coerce(argument, t)], t, node)
        return result

    def common_of(self, values: list[Expr], name: str, offset: int, expected: Type | None) -> Type:
        """The type all arguments of `name` are brought to; ERROR after a diagnosis."""
        characters = [v.type for v in values if v.type in (CHAR, WCHAR)]
        if characters:  # beside them, a text constant of one character is one
            values = [character(v, characters[0]) or v for v in values]
        typed = [v.type for v in values if not is_untyped(v)]
        if not typed:
            base = elementary(expected) if expected is not None else None
            is_number = base is not None and base.kind in (Kind.INT, Kind.BIT, Kind.REAL)
            typed = [base] if base is not None and is_number else [settle(v, expected).type for v in values]
        result: Type | None = typed[0]
        for t in typed[1:]:
            result = None if result is None else common_type(result, t)
        for v in values:
            if result is not None and is_untyped(v):
                result = self.literal_common(v, result, expected)
        if result is None:
            listed = " and ".join(dict.fromkeys(str(t) for t in typed))
            self.error(offset, "type", f"{name} cannot combine {listed}")
            return ERROR
        return result.base if isinstance(result, SubrangeType) else result

    def literal_common(self, literal: Expr, t: Type, expected: Type | None) -> Type | None:
        """The common type of an untyped constant and a type: the type itself when the constant fits."""
        assert isinstance(literal, Const)
        base = elementary(t)
        if base is None:
            return t
        if isinstance(literal.value, float):
            if base.kind is Kind.INT:
                return expected if expected is REAL or expected is LREAL else LREAL if base.bits > 16 else REAL
            return t
        assert isinstance(literal.value, int)
        if base.kind not in NUMBERS or constants.fits(literal.value, base):
            return t
        return common_type(base, literal_type(literal.value) or base)

    def _time(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 0, 0):
            return error_value(self.pos(node.pos))
        if self.world.clock is not None:
            variable = self.world.clock[name]
            return load(VarPlace(variable, variable.type, self.pos(node.pos)))
        return IntrinsicCall(Intrinsic[name], [], ELEMENTARY[name], self.pos(node.pos))

    def _string_size(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 1, 1):
            return error_value(self.pos(node.pos))
        if not isinstance(args[0].type, StringType):
            return self.error(node.pos, "type", f"{name} needs a STRING, not {args[0].type}")
        e = (
            args[0]
            if isinstance(args[0], Load)
            else Load(ValuePlace(args[0], args[0].type, args[0].pos), args[0].type, args[0].pos)
        )
        return IntrinsicCall(Intrinsic.STRING_SIZE, [e], UDINT, self.pos(node.pos))

    def _bound(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        """`LOWER_BOUND(array, dimension)`"""
        if not self._count(name, args, node, 2, 2):
            return error_value(self.pos(node.pos))
        array, dimension = args
        if not isinstance(array.type, ArrayType):
            return self.error(node.pos, "type", f"{name} needs an array, not {array.type}")
        count = len(array.type.bounds)
        number = dimension.value if isinstance(dimension, Const) else None
        if not isinstance(number, int) or not 1 <= number <= count:
            which = "the constant 1" if count == 1 else f"a constant from 1 to {count}"
            return self.error(node.args[1].pos, "range", f"the dimension of {array.type} is {which}")
        return bounds_of(place_of(array))[number - 1][name == "UPPER_BOUND"]

    def _of_variable(self, name: str, node: ast.Call) -> Expr:
        if len(node.args) != 1 or node.args[0].value is None:
            return self.error(node.pos, "arguments", f"{name} takes 1 argument, not {len(node.args)}")
        argument = node.args[0].value
        if name == "__ISVALIDREF":
            return self._is_valid(argument)
        if name not in ("SIZEOF", "XSIZEOF"):
            return self.address_of(argument, RawPointerType if name == "ADR" else PointerType)
        if isinstance(argument, ast.Name):
            symbol = self.scope.lookup(argument.name)
            is_block = isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION_BLOCK"
            if argument.name.upper() in ELEMENTARY or is_block or isinstance(symbol, TypeSymbol):
                t = self.world.declarations.named_type(argument.pos, argument.name, self.scope)
                return error_value(self.pos(node.pos)) if t is ERROR else self._size(t, node)
        e = settle(self.expr(argument))
        if isinstance(e.type, OpenArrayType):
            return self._open_size(e, e.type, node.pos)
        return e if e.type is ERROR else self._size(e.type, node)

    def _open_size(self, e: Expr, t: OpenArrayType, offset: int) -> Expr:
        """The bytes of an ARRAY[*], which are known when it runs."""
        size: Expr = Const(t.element.size, DINT, e.pos)
        for low, high in bounds_of(place_of(e)):
            last = self.operate(BinaryOp.SUB, high, low, offset)
            count = self.operate(BinaryOp.ADD, last, Const(1, DINT, e.pos), offset)
            size = self.operate(BinaryOp.MUL, size, count, offset)
        return size

    def _is_valid(self, node: ast.Expr) -> Expr:
        """Whether a reference refers to something."""
        e, pos = self.expr(node), self.pos(node.pos)
        pointer = e.place.pointer if isinstance(e, Load) and isinstance(e.place, DerefPlace) else None
        if pointer is None or not isinstance(pointer.type, ReferenceType):
            return e if e.type is ERROR else self.error(node.pos, "type", f"{e.type} is not a REFERENCE TO")
        return Binary(BinaryOp.NE, pointer, Const(0, pointer.type, pos), BOOL, pos)

    def _size(self, t: Type, node: ast.Call) -> Expr:
        return Const(t.size, UNTYPED_INT, self.pos(node.pos))

    @abstractmethod
    def address_of(self, node: ast.Expr, kind: type[PointerType]) -> Expr:
        """ADR(x), REF(x)"""

    _functions: ClassVar[dict[str, Callable[[Any, str, list[Expr], ast.Call, Type | None], Expr]]] = {
        **dict.fromkeys(_FOLDED, _folded),
        **dict.fromkeys(_PAIRS, _pair),
        **dict.fromkeys(_CHAINS, _chain),
        **dict.fromkeys(_SHIFTS, _shift),
        **dict.fromkeys(dates.FUNCTIONS, _dated),
        "NOT": _not,
        "MOVE": _move,
        "ABS": _abs,
        "SQRT": _sqrt,
        "SEL": _select,
        "MUX": _mux,
        "MIN": _extreme,
        "MAX": _extreme,
        "TIME": _time,
        "LTIME": _time,
        "STRING_SIZE": _string_size,
        "LOWER_BOUND": _bound,
        "UPPER_BOUND": _bound,
    }
