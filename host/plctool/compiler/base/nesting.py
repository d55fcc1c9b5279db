"""How deeply a program may be nested, and the room that the compiler needs for it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from plctool.compiler.typed.nodes import Pos

MAX_DEPTH = 400  # levels of nesting in one expression or of statements; the check and the lowering recurse over them
OPERATORS = 8  # operators that need no more room than one other level: a sum has a level for each of its terms
_RECURSION_LIMIT = 40_000  # calls of Python functions; enough for that


class NestingError(Exception):
    """Something at `pos` is nested too deeply."""

    def __init__(self, pos: Pos) -> None:
        super().__init__(pos)
        self.pos = pos


@contextmanager
def room_for_nesting() -> Iterator[None]:
    """Lets functions call each other as often as MAX_DEPTH needs."""
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, _RECURSION_LIMIT))
    try:
        yield
    finally:
        sys.setrecursionlimit(limit)
