"""The names of a program, before those of the library: which declaration each stands for.

Nothing is declared here; a declaration of the library is parsed when its name is first asked for.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from plctool.compiler.base.source import Source
from plctool.compiler.semantics import sfc
from plctool.compiler.semantics.generics import GROUPS
from plctool.compiler.semantics.imported_names import ImportedNames, enum_names, put_into
from plctool.compiler.semantics.symbols import GlobalSymbol, Namespace, PouSymbol, Symbol, TypeSymbol, Unit
from plctool.compiler.sources.imports import ImportedLibrary
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.syntax.library import PARAMETERS, Library, without_library
from plctool.compiler.typed.nodes import Pos
from plctool.iec.types import ELEMENTARY

_RESERVED = {*ELEMENTARY, "STRING", "WSTRING", *GROUPS}


def _is_in_namespace(decl: ast.GlobalBlock) -> bool:
    return decl.namespace is not None and decl.namespace.name != ""


def enclosing(full_name: str) -> list[str]:
    """The namespaces a dotted name is in: `a.b` and `a` for `a.b.c`."""
    parts = full_name.split(".")
    return [".".join(parts[:n]) for n in range(len(parts) - 1, 0, -1)]


@dataclass(frozen=True)
class PlannedInstance:
    """An instance of a PROGRAM that a CONFIGURATION names, or the one by its own name of any other PROGRAM."""

    name: str
    symbol: PouSymbol
    qualifiers: frozenset[ast.Modifier] = frozenset()


class Names:
    """What is declared under which name. Keys are case-folded."""

    def __init__(
        self, library: Library, diagnostics: Diagnostics, declared_instance: Callable[[PlannedInstance], Namespace]
    ) -> None:
        """`declared_instance` declares an instance of a PROGRAM."""
        self.library = library
        self.diagnostics = diagnostics
        self._declared_instance = declared_instance
        self.namespaces: dict[str, str] = {}  # as written, by case-folded name
        self.configurations: list[ast.ConfigurationDecl] = []
        self.instance_blocks: list[ast.InstanceBlock] = []  # VAR_CONFIG and VAR_ACCESS
        self.tests: list[ast.TestDecl] = []
        self.has_members = False  # whether anything has methods, actions or properties
        self._rewriters: list[Callable[[Sequence[ast.Declaration]], list[ast.Declaration]]] = []
        self.imported = ImportedNames((), self._duplicate)
        self._units: dict[str, Unit] = {}
        self._globals: dict[str, GlobalSymbol] = {}
        self._lists: dict[str, Namespace] = {}
        self._library_names: dict[str, Unit | GlobalSymbol | None] = {}
        self._ambiguous: dict[str, list[GlobalSymbol]] = {}
        self._enum_values: dict[str, list[TypeSymbol]] = {}

    # ---- making names known ----

    def rewrite(self, rewriter: Callable[[Sequence[ast.Declaration]], list[ast.Declaration]]) -> None:
        """Has the declarations of libraries changed before their names are known."""
        self._rewriters.append(rewriter)

    def _rewritten(self, declarations: list[ast.Declaration]) -> list[ast.Declaration]:
        for rewriter in self._rewriters:
            declarations = rewriter(declarations)
        return declarations

    def register(self, declarations: Iterable[ast.Declaration], *, library: bool = False) -> None:
        """Makes the names of declarations known."""
        for decl in declarations:
            if isinstance(decl, ast.PouDecl):
                self.has_members = self.has_members or bool(decl.members) or decl.keyword is ast.Unit.INTERFACE
                sfc.declare(decl, self.diagnostics)
                self._add(PouSymbol(decl, library), library=library, full_name=decl.full_name)
            elif isinstance(decl, ast.TypeDecl):
                symbol = TypeSymbol(decl, library)
                self._add(symbol, library=library, full_name=symbol.full_name)
                for name in enum_names(symbol) if not decl.qualified else ():
                    self._enum_values.setdefault(name.casefold(), []).append(symbol)
            elif isinstance(decl, ast.TestDecl):
                self.tests.append(decl)
            elif isinstance(decl, ast.GlobalBlock) and library:
                self._add_globals(decl.block, decl.source, prefix="", library=True)
            elif isinstance(decl, ast.InstanceBlock):
                self.instance_blocks.append(decl)
            elif isinstance(decl, ast.ConfigurationDecl):
                self.configurations.append(decl)
                self.instance_blocks += decl.instance_blocks
                for block in decl.globals:
                    self._add_globals(block, decl.source, prefix="", library=library)

    def begin_imports(self, libraries: Sequence[ImportedLibrary]) -> None:
        """Makes the namespaces of libraries known."""
        self.imported = ImportedNames(libraries, self._duplicate)
        self.namespaces.update(self.imported.namespaces)

    def add_import(self, library: ImportedLibrary, source: Source, declarations: Sequence[ast.Declaration]) -> None:
        """Makes known what a part of a library declares."""
        put_into(library, declarations)
        declarations = self._rewritten(list(declarations))
        for decl in declarations:
            if isinstance(decl, ast.PouDecl):
                self.has_members = self.has_members or bool(decl.members) or decl.keyword is ast.Unit.INTERFACE
                sfc.declare(decl, self.diagnostics)
        self.imported.add(library, source, declarations)
        self.namespaces.update(self.imported.namespaces)

    def register_globals(self, declarations: Sequence[ast.Declaration], source: Source) -> None:
        """The VAR_GLOBAL of a file are known as `x` and as `<file>.x`. A file with nothing else is a named list: there
        `<file>.x` is the full name, and with {attribute 'qualified_only'} the only one."""
        for decl in declarations:
            if isinstance(decl, ast.GlobalBlock) and decl.namespace is not None and decl.namespace.name:
                self._add_globals(decl.block, source, prefix=f"{decl.namespace.name}.", namespace=decl.namespace)
        blocks = [d for d in declarations if isinstance(d, ast.GlobalBlock) and not _is_in_namespace(d)]
        if not blocks:
            return
        qualified = any(d.qualified for d in blocks)
        listed = ast.GlobalBlock | ast.InstanceBlock | ast.TestDecl
        alone = not source.shared and all(isinstance(d, listed) for d in declarations)
        namespace = Namespace(source.stem, "list of globals", {})
        for block in blocks:
            prefix = f"{source.stem}." if alone or qualified else ""
            for symbol in self._add_globals(block.block, source, prefix=prefix, qualified=qualified):
                namespace.members.setdefault(symbol.name.casefold(), symbol)
        self._lists.setdefault(source.stem.casefold(), namespace)

    def _add_globals(
        self,
        block: ast.VarBlock,
        source: Source,
        *,
        prefix: str,
        library: bool = False,
        namespace: ast.Namespace | None = None,
        qualified: bool = False,
    ) -> list[GlobalSymbol]:
        added = []
        for line in block.decls:
            for offset, name in line.names:
                hidden = library and self._own(name.casefold()) is not None  # gives way, as in unique_name()
                full_name = f"Standard.{name}" if hidden else prefix + name
                symbol = GlobalSymbol(name, full_name, offset, line, block.qualifiers, source)
                key = (symbol.full_name if qualified or namespace is not None else name).casefold()
                if namespace is not None:
                    symbol.namespace = namespace
                    self._add_namespaces(symbol.full_name)
                other = self._globals.get(key)
                if library:
                    self._library_names[key] = symbol
                elif other is None:
                    self._globals[key] = symbol
                elif other.full_name.casefold() != symbol.full_name.casefold():
                    self._ambiguous.setdefault(key, [other]).append(symbol)
                else:
                    self._duplicate(name, source.pos(offset), other.source.pos(other.pos))
                added.append(symbol)
        return added

    def _add(self, symbol: Unit, *, library: bool, full_name: str) -> None:
        decl = symbol.decl
        key = full_name.casefold()
        if decl.namespace is not None:
            self._add_namespaces(full_name)
        if library:
            self._library_names[key] = symbol
            return
        pos = decl.source.pos(decl.pos)
        if decl.name.upper() in _RESERVED:
            self.diagnostics.error(pos, "duplicate", f"{decl.name} is the name of an elementary type")
            return
        other = self._units.setdefault(key, symbol)
        if other is not symbol:
            self._duplicate(decl.name, pos, other.decl.source.pos(other.decl.pos))

    def _add_namespaces(self, full_name: str) -> None:
        for space in enclosing(full_name):
            self.namespaces.setdefault(space.casefold(), space)

    def _duplicate(self, name: str, pos: Pos, first: Pos) -> None:
        where = f"in line {first.line}" if first.file == pos.file else f"in {first.file}"
        self.diagnostics.error(pos, "duplicate", f"{name} is declared already {where}")

    # ---- finding them ----

    def lookup(self, key: str, *, library: bool, imported: bool = False) -> Symbol | None:
        """A global name: the program's own before those of its libraries and of the standard library; inside the
        standard library the other way round, inside one that is `imported` without those of the program. Variables come
        before types, so that `motor : Motor` hides nothing that is needed (see `unit`)."""
        if library and key in PARAMETERS and key in self._globals:
            return self._globals[key]
        if library and (symbol := self._library_symbol(key)) is not None:
            return symbol
        own = None if imported else self._own(key)
        return own or self.imported.lookup(key) or self._library_symbol(key)

    def _own(self, key: str) -> Symbol | None:
        return (
            self._globals.get(key)
            or self.instance(key, self._units.get(key))
            or self._units.get(key)
            or self._lists.get(key)
        )

    def unit(self, key: str, *, library: bool, imported: bool = False) -> Unit | None:
        """A type, function, function block or program by its name."""
        own = None if imported else self._units.get(key)
        own = own or self.imported.unit(key)
        if own is not None and not library:
            return own
        other = self._library_symbol(key)
        return own if other is None or isinstance(other, GlobalSymbol) else other

    def own_unit(self, key: str) -> Unit | None:
        """What the program itself declares under that name."""
        return self._units.get(key)

    def global_named(self, key: str) -> GlobalSymbol | None:
        """The global variable of the program with that bare name, if it is the only one."""
        return None if key in self._ambiguous else self._globals.get(key)

    def own_list(self, key: str) -> Namespace | None:
        """The list of globals of that name."""
        return self._lists.get(key)

    def own_names(self) -> list[str]:
        """Of units, global variables and lists of them that the program itself declares, case-folded."""
        return [*self._units, *self._globals, *self._lists]

    def _library_symbol(self, key: str) -> Unit | GlobalSymbol | None:
        if key.partition(".")[0] in self._globals and "." in key:
            return None  # a member of a variable that has the name of a library
        key = without_library(key)
        if key not in self._library_names:
            self._library_names[key] = None
            self.register(self._rewritten(self.library.parse(key, self.diagnostics)), library=True)
        return self._library_names[key]

    def same_named(self, name: str) -> list[GlobalSymbol]:
        """The globals of that name when there are several."""
        return self._ambiguous.get(name.casefold(), [])

    def is_user_name(self, name: str) -> bool:
        """Whether the program declares a global name, or a library that has its namespace in front."""
        return name.casefold() in self._units or self.imported.has(name)

    def unique_name(self, symbol: Unit) -> str:
        """The full name of a unit, by which nothing else is known: what is in the standard library gives way to what
        the program declares."""
        hidden = symbol.library and self.is_user_name(symbol.decl.name)
        return f"Standard.{symbol.decl.name}" if hidden else symbol.full_name

    def enumerations_with(self, name: str, *, imported: bool = False) -> list[TypeSymbol]:
        """The enumerations that have a value of that name: those of the program before those of libraries."""
        own = [] if imported else self._enum_values.get(name.casefold(), [])
        return own or self.imported.enumerations_with(name.casefold())

    # ---- all of a kind ----

    def units(self) -> list[Unit]:
        """All types, POUs and interfaces the program itself declares."""
        return list(self._units.values())

    def pou_symbols(self) -> list[PouSymbol]:
        """All POUs and interfaces the program itself declares."""
        return [s for s in self._units.values() if isinstance(s, PouSymbol)]

    def functions(self) -> list[PouSymbol]:
        """The FUNCTION declarations in order."""
        return [s for s in self.pou_symbols() if s.keyword is ast.Unit.FUNCTION]

    def program_symbols(self) -> list[PouSymbol]:
        """The PROGRAM declarations in order."""
        return [s for s in self.pou_symbols() if s.keyword is ast.Unit.PROGRAM]

    def types_of_tests(self) -> set[str]:
        """The names of the types that tests have variables of, case-folded, without namespaces."""
        lines = [line for test in self.tests for block in test.blocks for line in block.decls]
        named = [line.type.name for line in lines if isinstance(line.type, ast.NamedType)]
        return {name.rpartition(".")[2].casefold() for name in named}

    def members_in_tests(self) -> set[str]:
        """The names of the members that tests read or write, case-folded, of whatever they may be."""
        return {member.name.casefold() for member in ast.every(ast.Member, [test.body for test in self.tests])}

    def globals(self) -> list[GlobalSymbol]:
        """All global variables the program itself declares; those with a name that others have too, twice."""
        return [*self._globals.values(), *(symbol for same in self._ambiguous.values() for symbol in same)]

    def aliases(self) -> dict[str, str]:
        """Other names of globals: `x` for `GVL.x` and the other way round, where they are unambiguous."""
        found: dict[str, str] = {}
        for namespace in self._lists.values():
            for symbol in namespace.members.values():
                assert isinstance(symbol, GlobalSymbol)
                key = symbol.name.casefold()
                bare = self._globals.get(key) is symbol and key not in self._ambiguous
                for other in (*((symbol.name,) if bare else ()), f"{namespace.name}.{symbol.name}"):
                    if other != symbol.full_name:
                        found[other] = symbol.full_name
        return found

    # ---- instances of programs ----

    def lookup_program(self, name: str) -> PouSymbol | None:
        """The PROGRAM of that name, perhaps with its namespace in front."""
        key = name.casefold()
        named = (p for p in self.program_symbols() if key in (p.decl.name.casefold(), p.decl.full_name.casefold()))
        return next(named, None)

    @cached_property
    def planned(self) -> dict[str, PlannedInstance]:
        """Every instance by its name; the sources are known before the first use."""
        planned: dict[str, PlannedInstance] = {}
        for instance in (i for decl in self.configurations for i in decl.programs):
            symbol = self.lookup_program(instance.type_name)
            if symbol is not None:
                made = PlannedInstance(instance.name, symbol, frozenset(instance.qualifiers))
                planned.setdefault(instance.name.casefold(), made)
        configured = {instance.symbol for instance in planned.values()}
        for symbol in self.program_symbols():
            if symbol not in configured:
                name = symbol.decl.full_name
                planned.setdefault(name.casefold(), PlannedInstance(name, symbol))
        return planned

    def instances_of(self, symbol: PouSymbol) -> list[str]:
        """The names of the instances of a PROGRAM."""
        return [instance.name for instance in self.planned.values() if instance.symbol is symbol]

    def instance(self, key: str, symbol: Unit | None = None) -> Namespace | None:
        """The instance of that name, or the only one of the PROGRAM `symbol`; None when there is none, or several."""
        if key not in self.planned:
            if not isinstance(symbol, PouSymbol) or symbol.keyword is not ast.Unit.PROGRAM:
                return None
            names = self.instances_of(symbol)
            if len(names) != 1:
                return None
            key = names[0].casefold()
        return self._declared_instance(self.planned[key])

    # ---- suggestions ----

    def names_in(self, namespace: str) -> list[str]:
        """The bare names of what a namespace holds, for suggestions."""
        prefix = namespace.casefold() + "."
        keys = [key for key in (*self._units, *self._globals, *self.namespaces) if key.startswith(prefix)]
        keys += self.imported.names_in(prefix)
        return [key[len(prefix) :] for key in keys if "." not in key[len(prefix) :]]

    def qualified_names(self, name: str) -> list[str]:
        """What a name could mean that needs that of its list or enumeration in front."""
        key = name.casefold()
        found = [f"{s.name}.{m.name}" for s in self._lists.values() if (m := s.members.get(key)) is not None]
        found += self.imported.choices(name)
        types = [s for s in self._units.values() if isinstance(s, TypeSymbol) and s.decl.qualified]
        return found + [f"{t.decl.name}.{v}" for t in types for v in enum_names(t) if v.casefold() == key]

    def list_names(self) -> list[str]:
        """Names of the lists of global variables."""
        return [s.name for s in self._lists.values()]

    def program_variables(self, name: str) -> list[str]:
        """What a name is in the PROGRAMs that have a variable of it, with the instance in front."""
        found = []
        for instance in self.planned.values():
            blocks = (b for b in instance.symbol.decl.blocks if b.keyword is not ast.Section.VAR_TEMP)
            written = [n for b in blocks for line in b.decls for _, n in line.names if n.casefold() == name.casefold()]
            found += [f"{instance.name}.{n}" for n in written]
        return found

    def value_names(self) -> list[str]:
        """Names of variables and enumeration values, for suggestions."""
        values = [name for s in self._units.values() if isinstance(s, TypeSymbol) for name in enum_names(s)]
        named = [s.name for s in self._globals.values()]
        return named + values + self.imported.known + self.library.names("VAR_GLOBAL")

    def owner_names(self) -> list[str]:
        """Names that others may follow after a dot, for suggestions: variables, lists, programs, types, namespaces."""
        named = [s.name for s in self._globals.values()] + self.list_names()
        return named + self.program_names() + self.type_names() + list(self.namespaces.values())

    def program_names(self) -> list[str]:
        """Names of the instances of programs, for suggestions."""
        return [instance.name for instance in self.planned.values()]

    def type_names(self) -> list[str]:
        """Names of types, function blocks and interfaces, for suggestions."""
        types = [s.decl.name for s in self._units.values() if isinstance(s, TypeSymbol)]
        return types + self.interface_names() + self.block_names() + self.library.names("TYPE")

    def block_names(self) -> list[str]:
        """Names of function blocks, for suggestions."""
        return self._own_pous(ast.Unit.FUNCTION_BLOCK) + self.imported.known + self.library.names("FUNCTION_BLOCK")

    def interface_names(self) -> list[str]:
        """Names of interfaces, for suggestions."""
        return self._own_pous(ast.Unit.INTERFACE) + self.imported.known

    def function_names(self) -> list[str]:
        """Names of functions, for suggestions."""
        return self._own_pous(ast.Unit.FUNCTION) + self.imported.known + self.library.names("FUNCTION")

    def _own_pous(self, keyword: ast.Unit) -> list[str]:
        return [s.decl.name for s in self.pou_symbols() if s.keyword is keyword]
