"""Where a piece of program stands: which names it sees, in which source it is written.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from plctool.compiler import ast
from plctool.compiler.source import Source
from plctool.compiler.symbols import ClassInfo, PouSymbol, Symbol, Unit
from plctool.compiler.typed import Pos, Pou, Statement
from plctool.compiler.types import Type

if TYPE_CHECKING:
    from plctool.compiler.world import World


@dataclass(eq=False)
class Scope:
    """The surroundings of declarations and statements.

    `names` are the local ones by case-folded name; `bindings` the types generic parameters stand for in this instance;
    `prologue` what has to be done before the body: initial values that are not constant; `programs` the PROGRAMs that
    can be instantiated here, as function blocks: in unit tests; `outer` what a method sees of the unit `cls` around it;
    `path` the namespaces to look into, case-folded, innermost first; `space` the one this is in.
    """

    world: World
    source: Source
    library: bool = False
    names: dict[str, Symbol] = field(default_factory=dict)
    bindings: dict[str, Type] = field(default_factory=dict)
    pou: Pou | None = None
    prologue: list[Statement] = field(default_factory=list)
    programs: dict[str, PouSymbol] = field(default_factory=dict)
    outer: dict[str, Symbol] = field(default_factory=dict)
    cls: ClassInfo | None = None
    path: tuple[str, ...] = ()
    space: str = ""

    def enter(self, namespace: ast.Namespace | None) -> None:
        """Makes what is in a namespace, in those around it and in those it is USING known by bare names."""
        if namespace is None:
            return
        self.space = namespace.name.casefold()
        parts = self.space.split(".") if self.space else []
        enclosing = [".".join(parts[:n]) for n in range(len(parts), 0, -1)]
        self.path = (*enclosing, *(name.casefold() for _, name in namespace.using))

    def is_within(self, namespace: ast.Namespace | None) -> bool:
        """Whether this is in a namespace, so that it may use what is INTERNAL there."""
        name = namespace.name.casefold() if namespace is not None else ""
        return not name or self.space == name or self.space.startswith(name + ".")

    def lookup(self, name: str) -> Symbol | None:
        """What a name stands for here."""
        key = name.casefold()
        symbol = self.names.get(key) or self.outer.get(key)
        if symbol is not None:
            return symbol
        for space in self.path:
            symbol = self.world.lookup(f"{space}.{key}", library=self.library)
            if symbol is not None:
                return symbol
        return self.world.lookup(key, library=self.library)

    def unit(self, name: str) -> Unit | None:
        """A type, function, function block or program, whatever variables have its name."""
        key = name.casefold()
        if key in self.programs:
            return self.programs[key]
        spaces = (f"{space}.{key}" for space in self.path)
        found = (self.world.unit(k, library=self.library) for k in (*spaces, key))
        return next((symbol for symbol in found if symbol is not None), None)

    def pos(self, offset: int) -> Pos:
        """Line and column of an offset in this source."""
        return self.source.pos(offset)

    def error(self, offset: int, code: str, message: str) -> None:
        """Reports an error at an offset."""
        self.world.diagnostics.error(self.source.pos(offset), code, message)

    def warning(self, offset: int, code: str, message: str) -> None:
        """Reports a warning at an offset."""
        self.world.diagnostics.warning(self.source.pos(offset), code, message)
