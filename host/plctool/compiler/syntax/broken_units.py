"""Units with syntax errors: the others of a program are checked without them.

What follows from the absence of a broken unit must not be reported: whatever names it, or something that it may
declare, waits until its syntax is right.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from plctool.compiler.base.missing_names import declared_names
from plctool.compiler.base.source import Source
from plctool.compiler.syntax.ast import AccessLine, ConfigLine, Declaration, GlobalBlock, InstanceBlock
from plctool.compiler.syntax.diagnostics import Diagnostic
from plctool.compiler.syntax.lexer import KEYWORDS
from plctool.iec.types import ELEMENTARY

_WORD = re.compile(r"[A-Za-z_]\w*")
_OF_THE_LANGUAGE = {word.casefold() for word in (*KEYWORDS, *ELEMENTARY)}


@dataclass(frozen=True)
class Remaining:
    """What can be checked of a file: the declarations without syntax errors. `hidden`: names, case-folded, that the
    others may declare."""

    declarations: list[Declaration]
    hidden: set[str]


def remaining(source: Source, declarations: Sequence[Declaration], error_lines: Iterable[int]) -> Remaining:
    """Takes the units out in which errors are. One at the beginning of a unit may be of the unit before it."""
    placed = sorted(((source.pos(_offset(d)).line, i) for i, d in enumerate(declarations)))
    starts = [line for line, _ in placed]
    broken: set[int] = set()  # first lines
    hidden: set[str] = set()
    for error in error_lines:
        before = starts[: bisect_right(starts, error)]
        own = before[-1:]
        if own == [error]:
            own = sorted(set(before))[-2:]
        after = next((line for line in starts if line > error), None)
        broken.update(own)
        hidden |= _names(source, own[0] if own else 1, after, error)
    kept = [declarations[i] for i in sorted(i for line, i in placed if line not in broken)]
    return Remaining(kept, hidden)


def _offset(declaration: Declaration) -> int:
    """Where it begins, nearly: blocks of instances have the place of their first one."""
    if isinstance(declaration, GlobalBlock):
        return declaration.block.pos
    if isinstance(declaration, InstanceBlock):
        return _first(declaration.lines)
    return declaration.pos


def _first(lines: Sequence[ConfigLine | AccessLine | None]) -> int:
    return next((line.pos for line in lines if line is not None), 0)


def _names(source: Source, begin: int, end: int | None, error: int) -> set[str]:
    """What the lines from `begin` to before `end` may declare; in the line of an error that may be every word."""
    lines = (source.original or source.text).split("\n")[begin - 1 : None if end is None else end - 1]
    return declared_names("\n".join(lines)) | _words(source.line_text(error))


def is_independent(diagnostic: Diagnostic, sources: Iterable[Source], hidden: set[str]) -> bool:
    """Whether an error can have nothing to do with names that broken units may declare."""
    source = next((s for s in sources if s.path == diagnostic.file), None)
    words = _words(diagnostic.message) | (_words(source.line_text(diagnostic.line)) if source else set())
    return not words & hidden


def _words(text: str) -> set[str]:
    """The names in a text, case-folded."""
    return {word.casefold() for word in _WORD.findall(text)} - _OF_THE_LANGUAGE
