"""Names of other systems' libraries that the standard library has: where a program uses them.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from plctool.compiler.imports import parts_of
from plctool.compiler.library import without_library
from plctool.compiler.missing_names import Use
from plctool.compiler.source import Source
from plctool.compiler.syntax.lexer import Lexer, Token

FUNCTIONS = {
    "Tc2_System": ("MEMCPY", "MEMMOVE", "MEMSET", "MEMCMP"),
    "SysMem of CODESYS": ("SysMemCpy", "SysMemMove", "SysMemSet", "SysMemCmp"),
}
BLOCKS = {
    "Util of CODESYS": ("BLINK", "PID", "INTEGRAL", "DERIVATIVE", "HYSTERESIS"),
}
"""By the library of the other system."""

_BEFORE_TYPES = frozenset((":", "OF", "EXTENDS", "TO"))
_FUNCTIONS = {name.casefold(): library for library, names in FUNCTIONS.items() for name in names}
_BLOCKS = {name.casefold(): library for library, names in BLOCKS.items() for name in names}


def library_of_stand_in(name: str) -> str:
    """The library of the other system that has the name."""
    key = name.casefold()
    return _FUNCTIONS.get(key) or _BLOCKS.get(key) or ""


def uses_of_stand_ins(sources: Sequence[Source]) -> list[Use]:
    """Where a program calls such a function or has such a block, unless it declares the name itself."""
    own = {name.casefold() for source in sources for part in parts_of(source) for name in part.names}
    return [use for source in sources for use in _uses(source) if use.name.casefold() not in own]


def _uses(source: Source) -> Iterator[Use]:
    tokens = list(Lexer(source.text, lambda offset, code, message: None))
    for at, token in enumerate(tokens):
        key = token.text.casefold()
        if key in _FUNCTIONS:
            used = _text(tokens, at + 1) == "(" and _begin(tokens, at) is not None
        elif key in _BLOCKS:
            begin = _begin(tokens, at)
            used = begin is not None and _text(tokens, begin - 1) in _BEFORE_TYPES
        else:
            continue
        if used:
            yield Use(token.text, source.path, source.pos(token.pos).line)


def _begin(tokens: Sequence[Token], at: int) -> int | None:
    """Where a name begins, with the library that may be in front of it; None if it is a part of something else."""
    if _text(tokens, at - 1) != ".":
        return at
    dotted = f"{_text(tokens, at - 2)}.{tokens[at].text}"
    return at - 2 if without_library(dotted) != dotted else None


def _text(tokens: Sequence[Token], at: int) -> str:
    return tokens[at].text.upper() if 0 <= at < len(tokens) else ""
