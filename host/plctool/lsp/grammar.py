"""Which words the grammar has room for at a position."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import lru_cache

from plctool.compiler.syntax.lexer import KEYWORDS, Lexer, Token
from plctool.compiler.syntax.tables import END, load_tables

_NAME = re.compile(r"[^\W\d]\w*\Z")
_OPERAND = re.compile(r"(?::=|=>)\s*\Z")  # one is still to be written


def _ignore(offset: int, code: str, message: str) -> None:
    """Takes mistakes in what is inserted, which has none."""


class Grammar:
    """What may follow some tokens, from the beginning of a unit on. All of it, if they have a mistake already."""

    def __init__(self, tokens: Sequence[Token]) -> None:
        self._tables = load_tables()
        kinds = [token.type for token in tokens]
        if tokens and KEYWORDS.get(tokens[-1].text.upper()) == "MODIFIER":
            kinds[-1] = "MODIFIER"  # FUNCTION_BLOCK ABSTRACT: a name, as long as none follows
        self._states = self._tables.after([self._tables.start], *kinds)
        self._known: dict[tuple[str, ...], bool] = {}

    def takes(self, text: str) -> bool:
        """True if a text may stand there, whatever comes then."""
        if self._states is None:
            return True
        kinds = _kinds(text)
        if kinds not in self._known:
            self._known[kinds] = self._tables.after(self._states, *kinds) is not None
        return self._known[kinds]

    def keywords(self) -> Iterator[str]:
        """The keywords that may stand there; none where there is a mistake before."""
        if self._states is not None:
            yield from (word for word in KEYWORDS if self.takes(word))


@lru_cache(4096)
def _kinds(text: str) -> tuple[str, ...]:
    """The types of the tokens of a text."""
    if _NAME.match(text) and text.upper() not in KEYWORDS:
        return ("IDENT",)
    kinds = tuple(token.type for token in Lexer(_OPERAND.sub("", text), _ignore))
    return tuple(kind for kind in kinds if kind != END)
