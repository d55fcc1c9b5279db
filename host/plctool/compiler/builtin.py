"""Functions the compiler knows itself: operators as functions, intrinsics, conversions by name.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from itertools import pairwise
from typing import Any, ClassVar

from plctool.compiler import ast, constants, dates
from plctool.compiler.conversions import (
    NUMBERS,
    SIGNED,
    UNSIGNED,
    common_type,
    convert,
    elementary,
    error_value,
    literal_type,
    settle,
)  # fmt: skip
from plctool.compiler.expressions import Expressions, is_untyped, load
from plctool.compiler.symbols import ERROR, UNTYPED_INT, PouSymbol, TypeSymbol
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
    DINT,
    ELEMENTARY,
    LINT,
    LREAL,
    REAL,
    UDINT,
    WCHAR,
    Elementary,
    EnumType,
    Kind,
    ReferenceType,
    StringType,
    SubrangeType,
    Type,
    is_scalar,
)  # fmt: skip

_CONVERSION = re.compile(r"(?:(?P<source>\w+?)_)?(?P<how>TO|TRUNC)_(?P<target>\w+)")
_BITCAST = re.compile(r"(?P<source>[A-Z]+)_AS_(?P<target>[A-Z]+)")
_FOLDED = {
    "ADD": BinaryOp.ADD, "MUL": BinaryOp.MUL, "AND": BinaryOp.AND, "OR": BinaryOp.OR, "XOR": BinaryOp.XOR,
}  # fmt: skip
_PAIRS = {"SUB": BinaryOp.SUB, "DIV": BinaryOp.DIV, "MOD": BinaryOp.MOD, "NE": BinaryOp.NE}
_CHAINS = {"GT": BinaryOp.GT, "GE": BinaryOp.GE, "EQ": BinaryOp.EQ, "LE": BinaryOp.LE, "LT": BinaryOp.LT}
_SHIFTS = {"SHL": Intrinsic.SHL, "SHR": Intrinsic.SHR, "ROL": Intrinsic.ROL, "ROR": Intrinsic.ROR}
_FORMAL = {
    "SHL": ("IN", "N"), "SHR": ("IN", "N"), "ROL": ("IN", "N"), "ROR": ("IN", "N"), "SEL": ("G", "IN0", "IN1"),
}  # fmt: skip


class Builtins(Expressions):
    """Calls of built-in functions."""

    def built_in(self, name: str, node: ast.Call, expected: Type | None) -> Expr | None:
        """The call of a built-in function; None when there is none of that name."""
        if name in ("SIZEOF", "ADR", "REF", "__ISVALIDREF"):
            return self._of_variable(name, node)
        handler = self._functions.get(name)
        if handler is not None:
            args = self._arguments(name, node, expected)
            return error_value(self.pos(node.pos)) if args is None else handler(self, name, args, node, expected)
        match = _CONVERSION.fullmatch(name)
        if match is not None:
            return self._conversion(name, match, node, expected)
        match = _BITCAST.fullmatch(name)
        return None if match is None else self._bitcast(name, match, node)

    def _arguments(self, name: str, node: ast.Call, expected: Type | None) -> list[Expr] | None:
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
            value = fold(intrinsic, [a.value for a in args if isinstance(a, Const)], t)
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

    def _of_variable(self, name: str, node: ast.Call) -> Expr:
        if len(node.args) != 1 or node.args[0].value is None:
            return self.error(node.pos, "arguments", f"{name} takes 1 argument, not {len(node.args)}")
        argument = node.args[0].value
        if name == "__ISVALIDREF":
            return self._is_valid(argument)
        if name != "SIZEOF":
            return self.address_of(argument)
        if isinstance(argument, ast.Name):
            symbol = self.scope.lookup(argument.name)
            is_block = isinstance(symbol, PouSymbol) and symbol.keyword == "FUNCTION_BLOCK"
            if argument.name.upper() in ELEMENTARY or is_block or isinstance(symbol, TypeSymbol):
                t = self.world.declarations.named_type(argument.pos, argument.name, self.scope)
                return error_value(self.pos(node.pos)) if t is ERROR else self._size(t, node)
        e = settle(self.expr(argument))
        return e if e.type is ERROR else self._size(e.type, node)

    def _is_valid(self, node: ast.Expr) -> Expr:
        """Whether a reference refers to something."""
        e, pos = self.expr(node), self.pos(node.pos)
        pointer = e.place.pointer if isinstance(e, Load) and isinstance(e.place, DerefPlace) else None
        if pointer is None or not isinstance(pointer.type, ReferenceType):
            return e if e.type is ERROR else self.error(node.pos, "type", f"{e.type} is not a REFERENCE TO")
        return Binary(BinaryOp.NE, pointer, Const(0, pointer.type, pos), BOOL, pos)

    def _size(self, t: Type, node: ast.Call) -> Expr:
        return Const(t.size, UNTYPED_INT, self.pos(node.pos))

    def address_of(self, node: ast.Expr) -> Expr:
        """ADR(x), REF(x)"""
        raise NotImplementedError

    # ---- conversions by name ----

    def _conversion_type(self, name: str) -> Type | None:
        if name in ELEMENTARY:
            return ELEMENTARY[name]
        if name in ("STRING", "WSTRING"):
            return StringType(255, name == "WSTRING")
        symbol = self.world.unit(name.casefold(), library=self.scope.library)
        if isinstance(symbol, TypeSymbol):
            t = self.world.declarations.resolve_symbol(symbol)
            return t if isinstance(t, EnumType | SubrangeType) else None
        return None

    def _conversion(self, name: str, match: re.Match[str], node: ast.Call, expected: Type | None) -> Expr | None:
        """`INT_TO_REAL(x)`, `TO_REAL(x)`, `REAL_TRUNC_INT(x)`"""
        source = self._conversion_type(match["source"]) if match["source"] else None
        target = self._conversion_type(match["target"])
        if target is None or (match["source"] and source is None):
            return None
        args = self._arguments("", node, source)
        if args is None:
            return error_value(self.pos(node.pos))
        if not self._count(name, args, node, 1, 1):
            return error_value(self.pos(node.pos))
        e = settle(args[0]) if source is None else self.coerce(args[0], source)
        if e.type is ERROR:
            return e
        if isinstance(e.type, StringType) or isinstance(target, StringType):
            return self._text_conversion(e, source, target, node)
        result = self.convert_explicitly(e, target, node.pos, truncate=match["how"] == "TRUNC")
        return (
            result
            if result is not None
            else self.error(node.pos, "type", f"there is no conversion from {e.type} to {target}")
        )

    def _text_conversion(self, e: Expr, source: Type | None, target: Type, node: ast.Call) -> Expr:
        """Conversions from and to text are functions of the library."""
        if isinstance(e.type, StringType) and isinstance(target, StringType):
            if e.type.wide is target.wide:
                return e
            return self.call_by_name(f"{e.type.keyword}_TO_{target.keyword}", [e], node.pos, None)
        base = elementary(e.type if isinstance(target, StringType) else target)
        if base is None:
            return self.error(node.pos, "type", f"there is no conversion from {e.type} to {target}")
        text_type = e.type if isinstance(e.type, StringType) else target
        if base is WCHAR and isinstance(text_type, StringType) and text_type.wide:
            name = "WCHAR_TO_WSTRING" if isinstance(target, StringType) else "WSTRING_TO_WCHAR"
            return self.call_by_name(name, [e], node.pos, None)
        if isinstance(target, StringType):
            text = self.call_by_name(f"{base}_TO_STRING", [convert(e, base)], node.pos, None)
            return self.call_by_name("STRING_TO_WSTRING", [text], node.pos, None) if target.wide else text
        if isinstance(e.type, StringType) and e.type.wide:
            e = self.call_by_name("WSTRING_TO_STRING", [e], node.pos, None)
        return convert(self.call_by_name(f"STRING_TO_{base}", [e], node.pos, None), target)

    def convert_explicitly(self, e: Expr, target: Type, offset: int, *, truncate: bool = False) -> Expr | None:
        """Any scalar as any other; None where it makes no sense."""
        source, to = elementary(e.type), elementary(target)
        if source is None or to is None:
            return None
        if isinstance(target, SubrangeType):
            return self.coerce(self._scalar_conversion(e, source, to, truncate=truncate), target)
        result = self._scalar_conversion(e, source, to, truncate=truncate)
        return result if target is to else convert(result, target)

    def _scalar_conversion(self, e: Expr, source: Elementary, to: Elementary, *, truncate: bool) -> Expr:
        if e.type is not source:
            e = convert(e, source)
        if source is to:
            return e
        if source in dates.UNIT_NS and to in dates.UNIT_NS:
            return dates.convert_date(e, to)
        if to is BOOL:
            return convert(e, BOOL)
        if to.kind is Kind.REAL and source.kind is not Kind.REAL:
            if source.kind is not Kind.INT:
                e = convert(e, UNSIGNED[source.bits] if not source.signed else SIGNED[source.bits])
            return convert(e, to)
        if source.kind is Kind.REAL and to.kind not in (Kind.REAL, Kind.INT):
            number = SIGNED[to.bits] if to.signed else UNSIGNED[to.bits]
            return convert(convert(e, number, truncate=truncate), to)
        return convert(e, to, truncate=truncate and source.kind is Kind.REAL)

    def _trunc(self, name: str, args: list[Expr], node: ast.Call, expected: Type | None) -> Expr:
        if not self._count(name, args, node, 1, 1):
            return error_value(self.pos(node.pos))
        e = settle(args[0])
        source = elementary(e.type)
        if source is None or source.kind is not Kind.REAL:
            return self.error(node.pos, "type", f"{name} needs a REAL or LREAL, not {e.type}")
        wanted = elementary(expected) if expected is not None else None
        target = ELEMENTARY["INT"] if name == "TRUNC_INT" else DINT
        if name == "TRUNC" and wanted is not None and wanted.kind is Kind.INT:
            target = wanted
        return convert(e, target, truncate=True)

    def _bitcast(self, name: str, match: re.Match[str], node: ast.Call) -> Expr | None:
        """`REAL_AS_DWORD(x)`: the bits, not the value."""
        source, target = ELEMENTARY.get(match["source"]), ELEMENTARY.get(match["target"])
        if source is None or target is None or source.bits != target.bits or BOOL in (source, target):
            return None
        args = self._arguments("", node, source)
        if args is None or not self._count(name, args, node, 1, 1):
            return error_value(self.pos(node.pos))
        e = self.coerce(args[0], source)
        return e if e.type is ERROR else IntrinsicCall(Intrinsic.BITCAST, [e], target, self.pos(node.pos))

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
        "TRUNC": _trunc,
        "TRUNC_INT": _trunc,
    }


def fold(intrinsic: Intrinsic, values: list[int | float | str], t: Type) -> int | float | str | None:
    """The value of an intrinsic of constants; None when it is left to run time."""
    base = elementary(t)
    if intrinsic is Intrinsic.SELECT:
        return values[2] if values[0] else values[1]
    if intrinsic is Intrinsic.MUX:
        assert isinstance(values[0], int)
        return values[1 + min(max(values[0], 0), len(values) - 2)]
    numbers = [v for v in values if not isinstance(v, str)]
    if base is None or len(numbers) < len(values):
        return None
    if intrinsic is Intrinsic.ABS:
        value = abs(numbers[0])
        return value if isinstance(value, float) or base.type_class < 0 else constants.wrap(value, base)
    if intrinsic is Intrinsic.SQRT:
        return constants.rounded(math.sqrt(numbers[0]), base) if numbers[0] >= 0 else None
    if intrinsic in (Intrinsic.MIN, Intrinsic.MAX):
        return min(numbers) if intrinsic is Intrinsic.MIN else max(numbers)
    value, count = numbers
    assert isinstance(value, int) and isinstance(count, int)
    return _shifted(intrinsic, value, count, base)


def _shifted(intrinsic: Intrinsic, value: int, count: int, t: Elementary) -> int:
    bits, pattern = t.bits, value & ((1 << t.bits) - 1)
    if intrinsic in (Intrinsic.SHL, Intrinsic.SHR):
        if not 0 <= count < bits:
            return 0
        return constants.wrap(pattern << count if intrinsic is Intrinsic.SHL else pattern >> count, t)
    count = (count if intrinsic is Intrinsic.ROL else -count) % bits
    return constants.wrap(pattern << count | pattern >> (bits - count), t)
