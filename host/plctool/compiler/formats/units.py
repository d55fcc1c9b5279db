"""What kind of unit a text begins.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator

from plctool.compiler.syntax.lexer import Lexer, Token

UNITS = frozenset(("FUNCTION", "FUNCTION_BLOCK", "PROGRAM", "INTERFACE"))


def tokens_of(text: str) -> Iterator[Token]:
    """The tokens of a text, whatever is wrong with it; that is said later."""
    return iter(Lexer(text, lambda offset, code, message: None))


def unit_keyword(declaration: str) -> str:
    """Which unit a declaration begins; "" for none."""
    return next((token.type for token in tokens_of(declaration) if token.type in UNITS), "")
