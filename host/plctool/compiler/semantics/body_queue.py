"""The bodies of units that are declared: they are checked later, when everything they may refer to is known.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

from plctool.compiler.semantics.scope import Scope
from plctool.compiler.syntax import ast


class BodyQueue:
    """Those still to be checked, each with the scope of its unit: of the program first, then of the library."""

    def __init__(self) -> None:
        self._own: deque[tuple[Scope, ast.PouDecl]] = deque()
        self._library: deque[tuple[Scope, ast.PouDecl]] = deque()

    def add(self, scope: Scope, decl: ast.PouDecl) -> None:
        """Queues what is written in the unit of a scope."""
        if scope.edges:
            scope = replace(scope, names=scope.names | scope.edges)
        (self._library if scope.library else self._own).append((scope, decl))

    def __bool__(self) -> bool:
        return bool(self._own or self._library)

    @property
    def only_library(self) -> bool:
        """Whether all of the program itself is checked."""
        return not self._own

    def next(self) -> tuple[Scope, ast.PouDecl]:
        """Takes one out."""
        return (self._own or self._library).popleft()
