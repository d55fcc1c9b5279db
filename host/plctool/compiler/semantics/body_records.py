"""What the check of each body has done to the program, so that a changed body can be checked again alone.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import VarSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostic
from plctool.compiler.typed.nodes import Variable
from plctool.records import dataclass


@dataclass
class BodyRecord:
    """The check of one body. `declared`: the local variables before it; `found`: what it has reported; `used`: the
    variables of the unit and of the one around it that it was the first to use."""

    scope: Scope
    decl: ast.PouDecl
    declared: list[Variable]
    found: list[Diagnostic]
    used: set[int]


class BodyRecords:
    """The checks of the bodies of a program."""

    def __init__(self) -> None:
        self._records: list[BodyRecord] = []

    @contextmanager
    def noted(self, world: World, scope: Scope, decl: ast.PouDecl) -> Iterator[None]:
        """Notes what the check inside the context does."""
        assert scope.pou is not None
        declared, count, unused = list(scope.pou.locals), world.diagnostics.count, unused_variables(scope)
        yield
        used = {id(symbol) for symbol in unused if symbol.used}
        self._records.append(BodyRecord(scope, decl, declared, world.diagnostics.since(count), used))

    def of(self, decl: ast.PouDecl) -> BodyRecord | None:
        """Returns the check of what a declaration says; None if it was checked never, or more than once."""
        found = [record for record in self._records if record.decl is decl]
        return found[0] if len(found) == 1 else None


def unused_variables(scope: Scope) -> list[VarSymbol]:
    """The variables that a body may name without a unit in front and that nothing has used yet."""
    known = (*scope.names.values(), *scope.outer.values())
    return [symbol for symbol in known if isinstance(symbol, VarSymbol) and not symbol.used]
