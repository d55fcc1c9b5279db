"""Names of other systems' libraries that the standard library has: where a program uses them.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

from plctool.compiler.base.missing_names import Use
from plctool.compiler.base.source import Source
from plctool.compiler.sources.imports import parts_of
from plctool.compiler.syntax.lexer import Lexer, Token
from plctool.compiler.syntax.library import OTHER_BLOCKS, standard_library, without_library

_FUNCTIONS = {
    "Tc2_System": ("MEMCPY", "MEMMOVE", "MEMSET", "MEMCMP"),
    "SysMem of CODESYS": ("SysMemCpy", "SysMemMove", "SysMemSet", "SysMemCmp"),
}
_BLOCKS = {"Util of CODESYS": ("BLINK", *OTHER_BLOCKS)}
_FILES = {
    "stdlib/util.st": "Util of CODESYS",
    "stdlib/caa_memory.st": "CAA Memory of CODESYS",
    "stdlib/tc2_system.st": "Tc2_System",
    "stdlib/tc2_utilities.st": "Tc2_Utilities",
}
_BEFORE_TYPES = frozenset((":", "OF", "EXTENDS", "TO"))


@dataclass(frozen=True)
class StandIn:
    """A name of another system's `library`."""

    name: str
    library: str
    is_function: bool


@cache
def stand_ins() -> dict[str, StandIn]:
    """All of them by name, case-folded."""
    found = [StandIn(name, library, True) for library, names in _FUNCTIONS.items() for name in names]
    found += [StandIn(name, library, False) for library, names in _BLOCKS.items() for name in names]
    for file, library in _FILES.items():
        found += [StandIn(e.name, library, e.is_function) for e in standard_library().defined_in(file)]
    return {stand_in.name.casefold(): stand_in for stand_in in found}


def library_of_stand_in(name: str) -> str:
    """The library of the other system that has the name."""
    found = stand_ins().get(name.casefold())
    return found.library if found else ""


def uses_of_stand_ins(sources: Sequence[Source]) -> list[Use]:
    """Where a program calls such a function or has such a block, unless it declares the name itself."""
    own = {name.casefold() for source in sources for part in parts_of(source) for name in part.names}
    return [use for source in sources for use in _uses(source) if use.name.casefold() not in own]


def _uses(source: Source) -> Iterator[Use]:
    tokens = list(Lexer(source.text, lambda offset, code, message: None))
    for at, token in enumerate(tokens):
        found = stand_ins().get(token.text.casefold())
        begin = _begin(tokens, at) if found else None
        if found is None or begin is None:
            continue
        if _text(tokens, at + 1) == "(" if found.is_function else _text(tokens, begin - 1) in _BEFORE_TYPES:
            yield Use(token.text, source.path, source.pos(token.pos).line)


def _begin(tokens: Sequence[Token], at: int) -> int | None:
    """Where a name begins, with the library that may be in front of it; None if it is a part of something else."""
    if _text(tokens, at - 1) != ".":
        return at
    dotted = f"{_text(tokens, at - 2)}.{tokens[at].text}"
    return at - 2 if without_library(dotted) != dotted else None


def _text(tokens: Sequence[Token], at: int) -> str:
    return tokens[at].text.upper() if 0 <= at < len(tokens) else ""
