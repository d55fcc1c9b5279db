"""Which function block extends which, known before any of them is declared, and the numbers of classes.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from functools import cached_property

from plctool.compiler.semantics.symbols import PouSymbol
from plctool.compiler.semantics.world import World


class Hierarchy:
    """All function blocks of a program, and those of the library they extend."""

    def __init__(self, world: World) -> None:
        self._world = world

    @cached_property
    def _derived(self) -> dict[PouSymbol, list[PouSymbol]]:
        """The blocks derived directly from a block; roots are among the keys."""
        derived: dict[PouSymbol, list[PouSymbol]] = {}
        todo = [s for s in self._world.names.pou_symbols() if s.keyword == "FUNCTION_BLOCK"]
        seen = set(todo)
        while todo:
            symbol = todo.pop(0)
            base = self.base_of(symbol)
            if base is None:
                derived.setdefault(symbol, [])
                continue
            derived.setdefault(base, []).append(symbol)
            if base not in seen:
                seen.add(base)
                todo.append(base)
        return derived

    def base_of(self, symbol: PouSymbol) -> PouSymbol | None:
        """The block it is derived from directly."""
        for _, name in symbol.decl.bases[:1]:
            base = self._world.scope_of(symbol).unit(name)
            if isinstance(base, PouSymbol) and base.keyword == "FUNCTION_BLOCK":
                return base
        return None

    @cached_property
    def numbers(self) -> dict[PouSymbol, int]:
        """Of the classes that may stand for others: derived, extended or with interfaces. What is derived from itself
        has none."""
        numbers: dict[PouSymbol, int] = {}
        for root in [s for s in self._derived if self.base_of(s) is None]:
            family, todo = list[PouSymbol](), [root]
            while todo:
                symbol = todo.pop()
                family.append(symbol)
                todo += reversed(self._derived.get(symbol, []))
            if len(family) > 1 or any(s.decl.interfaces for s in family):
                numbers.update(zip(family, range(len(numbers) + 1, len(numbers) + 1 + len(family)), strict=True))
        return numbers

    def circle(self, symbol: PouSymbol) -> str:
        """`A extends B extends A`"""
        names, at = [symbol.decl.name], self.base_of(symbol)
        while at is not None and at.decl.name not in names:
            names.append(at.decl.name)
            at = self.base_of(at)
        return " extends ".join([*names, at.decl.name if at is not None else "?"])
