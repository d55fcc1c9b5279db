"""The bodies of units that are declared: they are checked later, when everything they may refer to is known.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

from plctool.compiler.semantics.scope import Scope
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Pou


@dataclass(frozen=True)
class Body:
    """What is written in a unit, and the unit it becomes part of."""

    scope: Scope
    decl: ast.PouDecl
    pou: Pou


class Bodies:
    """Those still to be checked: of the program first, then of the library."""

    def __init__(self) -> None:
        self._own: deque[Body] = deque()
        self._library: deque[Body] = deque()

    def add(self, scope: Scope, decl: ast.PouDecl, pou: Pou) -> None:
        """Queues a body."""
        if scope.edges:
            scope = replace(scope, names=scope.names | scope.edges)
        (self._library if scope.library else self._own).append(Body(scope, decl, pou))

    def __bool__(self) -> bool:
        return bool(self._own or self._library)

    @property
    def only_library(self) -> bool:
        """Whether all of the program itself is checked."""
        return not self._own

    def next(self) -> Body:
        """Takes one out."""
        return (self._own or self._library).popleft()
