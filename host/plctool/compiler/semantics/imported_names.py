"""What is declared in libraries that are given as sources. Names are known with the namespace of the library in front,
and without it where no other library has them.

Nothing here is declared or checked before it is used.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from plctool.compiler.base.source import Source
from plctool.compiler.semantics.symbols import GlobalSymbol, Namespace, PouSymbol, TypeSymbol, Unit
from plctool.compiler.sources.imports import ImportedLibrary
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Pos

Report = Callable[[str, Pos, Pos], None]
"""Says that a name is declared twice: the name, where, and where the first time."""

_NAMED = (ast.PouDecl, ast.TypeDecl, ast.GlobalBlock)

Found = Unit | GlobalSymbol | Namespace


def enum_names(symbol: TypeSymbol) -> list[str]:
    """The values of an enumeration as they are written; of other types none."""
    spec = symbol.decl.spec
    return [name for _, name, _ in spec.values] if isinstance(spec, ast.EnumSpec) else []


class ImportedNames:
    """Keys are full names, case-folded. `namespaces`: as written; `known`: all that there may be, as written."""

    def __init__(self, libraries: Sequence[ImportedLibrary], report: Report) -> None:
        self.namespaces = {library.namespace.casefold(): library.namespace for library in libraries}
        self.known = [n for lib in libraries for name in sorted(lib.names) for n in (name, f"{lib.namespace}.{name}")]
        self._report = report
        self._units: dict[str, Unit] = {}
        self._globals: dict[str, GlobalSymbol] = {}
        self._lists: dict[str, Namespace] = {}
        self._bare: dict[str, dict[str, None]] = {}  # full names by the last part
        self._values: dict[str, list[TypeSymbol]] = {}

    # ---- making names known ----

    def add(self, library: ImportedLibrary, source: Source, declarations: Sequence[ast.Declaration]) -> None:
        """Makes known what a part of a library declares. Its programs, tests and configurations are its own."""
        put_into(library, declarations)
        for decl in declarations:
            if isinstance(decl, _NAMED) and decl.namespace is not None:
                self.namespaces.setdefault(decl.namespace.name.casefold(), decl.namespace.name)
            if isinstance(decl, ast.PouDecl) and decl.keyword is not ast.Unit.PROGRAM:
                self._add_unit(PouSymbol(decl, False), decl.full_name)
            elif isinstance(decl, ast.TypeDecl):
                self._add_type(TypeSymbol(decl, False))
        self._add_globals(source, declarations)

    def _add_unit(self, symbol: Unit, full_name: str) -> None:
        other = self._units.setdefault(full_name.casefold(), symbol)
        if other is not symbol:
            own, first = symbol.decl, other.decl
            self._report(full_name, own.source.pos(own.pos), first.source.pos(first.pos))
        self._known_as(full_name)

    def _add_type(self, symbol: TypeSymbol) -> None:
        self._add_unit(symbol, symbol.full_name)
        for name in enum_names(symbol) if not symbol.decl.qualified else ():
            self._values.setdefault(name.casefold(), []).append(symbol)

    def _add_globals(self, source: Source, declarations: Sequence[ast.Declaration]) -> None:
        """As `Names.register_globals`, in the namespace of the library."""
        blocks = [decl for decl in declarations if isinstance(decl, ast.GlobalBlock)]
        qualified = any(block.qualified for block in blocks)
        for block in blocks:
            assert block.namespace is not None
            space = block.namespace
            listed = self._lists.setdefault(
                f"{space.name}.{source.stem}".casefold(),
                Namespace(f"{space.name}.{source.stem}", "list of globals", {}),
            )
            self._known_as(listed.name)
            for line in block.block.decls:
                for offset, name in line.names:
                    full_name = f"{listed.name}.{name}"
                    symbol = GlobalSymbol(
                        name, full_name, offset, line, block.block.qualifiers, source, namespace=space
                    )
                    listed.members[name.casefold()] = symbol
                    if not qualified:
                        self._globals.setdefault(f"{space.name}.{name}".casefold(), symbol)
                        self._known_as(f"{space.name}.{name}")

    def _known_as(self, full_name: str) -> None:
        self._bare.setdefault(full_name.rpartition(".")[2].casefold(), {})[full_name] = None

    # ---- finding them ----

    def lookup(self, key: str) -> Found | None:
        """A name: variables come before types."""
        key = self._full(key)
        return self._globals.get(key) or self._units.get(key) or self._lists.get(key)

    def unit(self, key: str) -> Unit | None:
        """A type, function or function block."""
        return self._units.get(self._full(key))

    def has(self, full_name: str) -> bool:
        """Whether a library declares a name, which has its namespace in front."""
        return full_name.casefold() in self._units

    def choices(self, name: str) -> list[str]:
        """The full names of a bare name that several libraries have."""
        found = list(self._bare.get(name.casefold(), ()))
        return found if len(found) > 1 else []

    def enumerations_with(self, key: str) -> list[TypeSymbol]:
        """The enumerations that have a value of that name."""
        return self._values.get(key, [])

    def names_in(self, prefix: str) -> list[str]:
        """Full names that begin like this, whatever their case."""
        return [name for name in self.known if name.casefold().startswith(prefix)]

    def _full(self, key: str) -> str:
        found = self._bare.get(key, ())
        return next(iter(found)).casefold() if len(found) == 1 else key


def put_into(library: ImportedLibrary, declarations: Sequence[ast.Declaration]) -> None:
    """Puts declarations into the namespace of their library, unless they are in it already."""
    for decl in declarations:
        if isinstance(decl, _NAMED) and not (decl.namespace is not None and decl.namespace.imported):
            decl.namespace = _within(library, decl.namespace)


def _within(library: ImportedLibrary, space: ast.Namespace | None) -> ast.Namespace:
    """The namespace of a declaration, in that of its library."""
    inner = space or ast.Namespace()
    name = f"{library.namespace}.{inner.name}" if inner.name else library.namespace
    internal = inner.internal
    if internal is not None:
        internal = f"{library.namespace}.{internal}" if internal else library.namespace
    return ast.Namespace(name, [*((0, used) for used in library.using), *inner.using], internal, imported=True)
