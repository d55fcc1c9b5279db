"""Instances of PROGRAMs: those that a CONFIGURATION names, and one by its own name of every other PROGRAM.

The instance is declared when a task or a name needs it first, as everything else is. A PROGRAM that nobody needs is
checked with variables that go nowhere.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from plctool.compiler.semantics.declarations import Allocation
from plctool.compiler.semantics.symbols import Namespace, PouSymbol, Role, VarSymbol
from plctool.compiler.typed import Pou

if TYPE_CHECKING:
    from plctool.compiler.semantics.world import World


class Programs:
    """The instances by name."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._declared: dict[str, Namespace] = {}
        self._checked: set[PouSymbol] = set()

    @cached_property
    def _planned(self) -> dict[str, tuple[str, PouSymbol, set[str]]]:
        """Name, PROGRAM and qualifiers of every instance; the sources are known before anybody asks."""
        planned: dict[str, tuple[str, PouSymbol, set[str]]] = {}
        for instance in (i for decl in self._world.configurations for i in decl.programs):
            symbol = self._world.lookup_program(instance.type_name)
            if symbol is not None:
                planned.setdefault(instance.name.casefold(), (instance.name, symbol, instance.qualifiers))
        configured = {symbol for _, symbol, _ in planned.values()}
        for symbol in self._world.program_symbols():
            if symbol not in configured:
                name = symbol.decl.full_name
                planned.setdefault(name.casefold(), (name, symbol, set()))
        return planned

    def instances(self, symbol: PouSymbol) -> list[str]:
        """The names of the instances of a PROGRAM."""
        return [name for name, other, _ in self._planned.values() if other is symbol]

    def find(self, key: str, symbol: object = None) -> Namespace | None:
        """The instance of that name, or the only one of the PROGRAM `symbol`; None when there is none, or several."""
        if key not in self._planned:
            if not isinstance(symbol, PouSymbol) or symbol.keyword != "PROGRAM":
                return None
            names = self.instances(symbol)
            if len(names) != 1:
                return None
            key = names[0].casefold()
        known = self._declared.get(key)
        if known is None:
            known = self._declare(key)
        return known

    def _declare(self, key: str) -> Namespace:
        name, symbol, qualifiers = self._planned[key]
        instance = self._declared[key] = Namespace(name, "program", {})
        info, scope = self._world.units.program(symbol, name, self._world.allocation, qualifiers)
        instance.program, instance.cls = info, scope.cls
        for member, variable in scope.names.items():
            if isinstance(variable, VarSymbol) and variable.role is not Role.TEMP:
                instance.members[member] = variable
        self._checked.add(symbol)
        return instance

    def names(self) -> list[str]:
        """The names of all instances, for suggestions."""
        return [name for name, _, _ in self._planned.values()]

    def declared(self) -> dict[str, Pou]:
        """The instances that something needs."""
        return {space.name: space.program.pou for space in self._declared.values() if space.program is not None}

    def declare_others(self) -> bool:
        """Queues the PROGRAMs nobody needs for checking; whether there are any."""
        others = [s for s in self._world.program_symbols() if s not in self._checked]
        for symbol in others:
            self._world.units.program(symbol, symbol.decl.full_name, Allocation(), set())
        self._checked.update(others)
        return bool(others)

    def report_unused(self) -> None:
        """Warns of the programs that nobody runs."""
        for symbol in self._world.program_symbols():
            if not any(name.casefold() in self._declared for name in self.instances(symbol)):
                message = f"the program {symbol.decl.name} is never run: no task does, and nothing calls it"
                self._world.diagnostics.warning(symbol.decl.source.pos(symbol.decl.pos), "unused", message)
