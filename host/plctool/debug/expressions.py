"""Expressions that a debugger evaluates: variables, literals and operators of ST, without calls."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from plctool.errors import UsageError
from plctool.iec.types import ELEMENTARY
from plctool.iec.value_texts import parse_value

_TOKEN = re.compile(
    r"\s*(?:(?P<name>%?[A-Za-z_]\w*(?:\.\w+|\[[^\]]*\]|\^)*(?!\w*#))|(?P<typed>\w+#[-\w.:+]+)"
    r"|(?P<number>\d[\w.]*(?:[eE][-+]?\d+)?)|(?P<text>'[^']*'|\"[^\"]*\")|(?P<sign><=|>=|<>|[-+*/=<>()&]))"
)
NAME = re.compile(r"%?[A-Za-z_]\w*(?:\.\w+|\[[^\]]*\]|\^)*")

_COMPARISONS: dict[str, Callable[[Any, Any], Any]] = {
    "=": operator.eq, "<>": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_SUMS: dict[str, Callable[[Any, Any], Any]] = {"+": operator.add, "-": operator.sub}


def _divided(a: Any, b: Any) -> Any:
    """As in ST: integers are cut towards zero."""
    if isinstance(a, int) and isinstance(b, int):
        return abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
    return a / b


_PRODUCTS: dict[str, Callable[[Any, Any], Any]] = {
    "*": operator.mul,
    "/": _divided,
    "MOD": lambda a, b: a - b * _divided(a, b),
}
_LEVELS: list[dict[str, Callable[[Any, Any], Any]]] = [
    {"OR": operator.or_},
    {"XOR": operator.xor},
    {"AND": operator.and_, "&": operator.and_},
    _COMPARISONS,
    _SUMS,
    _PRODUCTS,
]
_WORDS = {"OR", "XOR", "AND", "MOD", "NOT", "TRUE", "FALSE"}


def evaluate(text: str, read: Callable[[str], Any]) -> Any:
    """The value of an expression; `read` gives that of a variable. Raises UsageError for what cannot be read."""
    return _Expression(text, read).whole()


def check_expression(text: str) -> None:
    """Raises UsageError if it is none, whatever its variables are."""
    try:
        evaluate(text, lambda name: 1)
    except UsageError as error:
        if error.code == "syntax":
            raise


class _Expression:
    def __init__(self, text: str, read: Callable[[str], Any]) -> None:
        self._text = text
        self._read = read
        self._at = 0
        self._kind, self._token = "", ""
        self._advance()

    def whole(self) -> Any:
        try:
            value = self._binary(0)
        except (TypeError, ZeroDivisionError, OverflowError) as error:
            raise UsageError(f"'{self._text}' cannot be computed: {error}.", "expression") from None
        except RecursionError:
            raise self._bad() from None
        if self._kind:
            raise self._bad()
        return value

    def _advance(self) -> None:
        if not self._text[self._at :].strip():
            self._kind = self._token = ""
            return
        match = _TOKEN.match(self._text, self._at)
        if match is None or match.lastgroup is None:
            raise self._bad()
        self._kind, self._token, self._at = match.lastgroup, match[match.lastgroup], match.end()
        if self._kind == "name" and self._token.upper() in _WORDS:
            self._kind, self._token = "word", self._token.upper()

    def _bad(self) -> UsageError:
        return UsageError(f"'{self._text}' is not an expression; write for example Main.x > 5 AND Main.on.", "syntax")

    def _binary(self, level: int) -> Any:
        if level == len(_LEVELS):
            return self._unary()
        left = self._binary(level + 1)
        while self._kind in ("sign", "word") and self._token in _LEVELS[level]:
            apply = _LEVELS[level][self._token]
            self._advance()
            left = apply(left, self._binary(level + 1))
        return left

    def _unary(self) -> Any:
        if self._kind == "word" and self._token == "NOT":
            self._advance()
            value = self._unary()
            return not value if isinstance(value, bool) else ~value
        if self._kind == "sign" and self._token in "+-":
            sign = self._token
            self._advance()
            value = self._unary()
            return -value if sign == "-" else value
        return self._primary()

    def _primary(self) -> Any:
        kind, token = self._kind, self._token
        self._advance_past(kind)
        if kind == "sign" and token == "(":
            value = self._binary(0)
            if self._token != ")":
                raise self._bad()
            self._advance()
            return value
        if kind == "word" and token in ("TRUE", "FALSE"):
            return token == "TRUE"
        if kind == "name":
            return self._read(token)
        if kind == "text":
            return token[1:-1]
        if kind == "number":
            return self._number(token)
        if kind == "typed":
            return self._typed(token)
        raise self._bad()

    def _advance_past(self, kind: str) -> None:
        if not kind:
            raise self._bad()
        self._advance()

    def _number(self, token: str) -> Any:
        plain = token.replace("_", "")
        with suppress(ValueError):
            return int(plain)
        with suppress(ValueError):
            return float(plain)
        raise self._bad()

    def _typed(self, token: str) -> Any:
        """16#FF, T#5s as the text that a TIME is shown as, INT#5."""
        prefix, _, rest = token.partition("#")
        if prefix.isdigit():
            with suppress(ValueError):
                return int(rest.replace("_", ""), int(prefix))
            raise self._bad()
        long = {"T": "TIME", "D": "DATE", "LT": "LTIME"}.get(prefix.upper(), prefix.upper())
        if long in ELEMENTARY:
            return parse_value(ELEMENTARY[long], token if "TIME" in long or "DATE" in long else rest)
        raise self._bad()
