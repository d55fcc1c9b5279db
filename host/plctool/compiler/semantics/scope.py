"""Where a piece of program stands: which names it sees, in which source it is written.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass, field

from plctool.compiler.base.source import Source
from plctool.compiler.semantics.names import Names
from plctool.compiler.semantics.symbols import (
    ClassInfo,
    GlobalSymbol,
    PouSymbol,
    Role,
    Symbol,
    TypeSymbol,
    Unit,
    VarSymbol,
)
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.compiler.typed.nodes import Pos, Pou, Statement
from plctool.iec.types import Type


def _internal_to(symbol: Symbol) -> str | None:
    """The namespace that alone may use a unit or global; None if all may."""
    if isinstance(symbol, GlobalSymbol):
        space, marked = symbol.namespace, ast.Modifier.INTERNAL in symbol.qualifiers
    elif isinstance(symbol, TypeSymbol | PouSymbol):
        decl = symbol.decl
        space, marked = decl.namespace, ast.Modifier.INTERNAL in decl.modifiers
    else:
        return None
    if space is None or not space.name or not (marked or space.internal is not None):
        return None
    return space.name if marked else space.internal or space.name


@dataclass(eq=False)
class Scope:
    """The surroundings of declarations and statements.

    `names` are the local ones by case-folded name; `bindings` the types generic parameters stand for in this instance;
    `prologue` what has to be done before the body: finding edges; `programs` the PROGRAMs that can be instantiated
    here, as function blocks: in unit tests; `outer` what a method sees of the unit `cls` around it; `sees_inside`: VAR
    of instances may be read, as tests and VAR_CONFIG do; `writes_inside`: and all of them written, as tests do; `edges`
    what the body sees in place of inputs with R_EDGE; `path` the namespaces to look into, case-folded, innermost first;
    `space` the one this is in; `imported`: that is of a library that is given as source.
    """

    globals: Names
    source: Source
    library: bool = False
    names: dict[str, Symbol] = field(default_factory=dict)
    bindings: dict[str, Type] = field(default_factory=dict)
    pou: Pou | None = None
    prologue: list[Statement] = field(default_factory=list)
    programs: dict[str, PouSymbol] = field(default_factory=dict)
    outer: dict[str, Symbol] = field(default_factory=dict)
    cls: ClassInfo | None = None
    sees_inside: bool = False
    writes_inside: bool = False
    edges: dict[str, Symbol] = field(default_factory=dict)
    path: tuple[str, ...] = ()
    space: str = ""
    imported: bool = False

    def enter(self, namespace: ast.Namespace | None) -> None:
        """Makes what is in a namespace, in those around it and in those it is USING known by bare names."""
        if namespace is None:
            return
        self.space = namespace.name.casefold()
        self.imported = namespace.imported
        parts = self.space.split(".") if self.space else []
        enclosing = [".".join(parts[:n]) for n in range(len(parts), 0, -1)]
        self.path = tuple(enclosing)
        self.use(namespace.using)

    def use(self, names: list[tuple[int, str]]) -> None:
        """USING: makes what is in namespaces known by bare names, after what is nearer."""
        self.path += tuple(found for offset, name in names if (found := self._namespace(offset, name)) is not None)

    def _namespace(self, offset: int, name: str) -> str | None:
        """The full name of a namespace, written in full or from here on."""
        spaces, key = self.globals.namespaces, name.casefold()
        parts = self.space.split(".") if self.space else []
        for full_name in (".".join([*parts[:n], key]) for n in range(len(parts), -1, -1)):
            if full_name in spaces:
                return full_name
        hint = did_you_mean(name, spaces.values())
        self.error(offset, "unknown", f"there is no NAMESPACE {name}{hint}")
        return None

    def is_within(self, namespace: str) -> bool:
        """Whether this is in a namespace, so that it may use what is INTERNAL there."""
        name = namespace.casefold()
        return self.space == name or self.space.startswith(name + ".")

    def may_use(self, symbol: Symbol, name: str, offset: int) -> bool:
        """Whether a unit or global may be used here; reports what is INTERNAL elsewhere."""
        owner = _internal_to(symbol)
        if owner is None or self.is_within(owner):
            return True
        self.error(offset, "access", f"{name} is INTERNAL: only the namespace {owner} may use it")
        return False

    def declare(self, symbol: VarSymbol, offset: int) -> bool:
        """Makes a local name known; False after an error when it is taken."""
        key = symbol.name.casefold()
        other = self.names.get(key)
        if not isinstance(other, VarSymbol):
            self.names[key] = symbol
            return True
        if other.role is Role.RESULT:
            message = f"{symbol.name} is the name of this function"
        else:
            message = f"{symbol.name} is declared already: {other.name} in line {other.pos.line}"
        self.error(offset, "duplicate", message)
        return False

    def lookup(self, name: str) -> Symbol | None:
        """What a name stands for here."""
        key = name.casefold()
        symbol = self.names.get(key) or self.outer.get(key)
        if symbol is not None:
            return symbol
        for space in self.path:
            symbol = self.globals.lookup(f"{space}.{key}", library=self.library)
            if symbol is not None:
                return symbol
        found = self.globals.lookup(key.removeprefix("."), library=self.library, imported=self.imported)
        bare = self._without_foreign(key) if found is None else ""
        if not bare:
            return found
        return self.globals.own_unit(bare) or self.globals.own_list(bare) or self._foreign_constant(key, bare)

    def unit(self, name: str) -> Unit | None:
        """A type, function, function block or program, whatever variables have its name."""
        key = name.casefold()
        if key in self.programs:
            return self.programs[key]
        spaces = (f"{space}.{key}" for space in self.path)
        found = (self.globals.unit(k, library=self.library, imported=self.imported) for k in (*spaces, key))
        symbol = next((symbol for symbol in found if symbol is not None), None)
        return symbol or self.globals.own_unit(self._without_foreign(key))

    def _foreign_constant(self, key: str, bare: str) -> GlobalSymbol | None:
        """The constant of the program in `tcunit.limit`. Not a variable, and not where `tcunit` is like another name:
        `motr.speed` is a mistake, whatever else is called `speed`."""
        symbol = self.globals.global_named(bare)
        if symbol is None or ast.Modifier.CONSTANT not in symbol.qualifiers:
            return None
        known = [*self.names, *self.outer, *self.globals.own_names()]
        return None if did_you_mean(key.partition(".")[0], known) else symbol

    def _without_foreign(self, key: str) -> str:
        """A name without the namespace of a library that is given as source: `tcunit.x` is `x` where nothing else is
        known as `tcunit`. "" when it has none."""
        first, _, rest = key.partition(".")
        known = not first or not rest or first in self.names or first in self.outer or self.imported
        known = known or first in self.globals.namespaces
        return "" if known or self.globals.lookup(first, library=self.library) is not None else rest

    def choices(self, name: str) -> str:
        """What to write for a name that several libraries have; "" for others."""
        found = self.globals.imported.choices(name)
        return f"; write {' or '.join(found)}" if found else ""

    def pos(self, offset: int) -> Pos:
        """Line and column of an offset in this source."""
        return self.source.pos(offset)

    def error(self, offset: int, code: str, message: str) -> None:
        """Reports an error at an offset."""
        self.globals.diagnostics.error(self.source.pos(offset), code, message)

    def missing(self, offset: int, name: str, message: str) -> None:
        """Reports that nothing is known by a name."""
        self.globals.diagnostics.missing(self.source.pos(offset), name, message)

    def is_incomplete(self, unit: str) -> bool:
        """Whether a unit lacks something because of an error that was reported, so that more would follow from it."""
        return unit.casefold() in self.globals.diagnostics.incomplete

    def inherits_unknown(self, cls: ClassInfo | None) -> bool:
        """Whether a class may have members that are not known, because a base of it is not."""
        return cls is not None and cls.inherits_unknown

    def lacks(self, unit: str) -> None:
        """Notes that a unit is incomplete: a variable has an unknown type, or its base is unknown."""
        self.globals.diagnostics.incomplete.add(unit.casefold())

    def warning(self, offset: int, code: str, message: str) -> None:
        """Reports a warning at an offset."""
        self.globals.diagnostics.warning(self.source.pos(offset), code, message)
