"""Everything the check of one program shares: names, types, units, diagnoses.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from plctool.compiler.diagnostics import Diagnostics
from plctool.compiler.library import Library, without_library
from plctool.compiler.nesting import NestingError
from plctool.compiler.semantics import sfc
from plctool.compiler.semantics.call_graph import CallGraph
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.class_rules import INITIALISERS
from plctool.compiler.semantics.classes import Classes
from plctool.compiler.semantics.construction import construct
from plctool.compiler.semantics.conversions import Coercion
from plctool.compiler.semantics.declarations import Allocation, Declarations
from plctool.compiler.semantics.generics import GROUPS
from plctool.compiler.semantics.instance_config import InstanceConfig
from plctool.compiler.semantics.programs import Programs
from plctool.compiler.semantics.rules.bodies import check_body
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.sfc_statements import statements_of
from plctool.compiler.semantics.symbols import (
    BlockInfo,
    GlobalSymbol,
    Namespace,
    PouSymbol,
    Role,
    Symbol,
    TypeSymbol,
    Unit,
    VarSymbol,
)  # fmt: skip
from plctool.compiler.semantics.units import Units
from plctool.compiler.source import Source
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Call, Const, Expr, Pos, Pou, StructInit, Variable
from plctool.compiler.types import ELEMENTARY, WCHAR, EnumType, StructType, Type

_RESERVED = {*ELEMENTARY, "STRING", "WSTRING", *GROUPS}


def _enum_names(symbol: TypeSymbol) -> list[str]:
    spec = symbol.decl.spec
    return [name for _, name, _ in spec.values] if isinstance(spec, ast.EnumSpec) else []


def _is_in_namespace(decl: ast.GlobalBlock) -> bool:
    return decl.namespace is not None and decl.namespace.name != ""


def enclosing(full_name: str) -> list[str]:
    """The namespaces a dotted name lies in: `a.b` and `a` for `a.b.c`."""
    parts = full_name.split(".")
    return [".".join(parts[:n]) for n in range(len(parts) - 1, 0, -1)]


class World:
    """The names of the program in front of those of the library; each is declared when it is first needed."""

    def __init__(self, library: Library) -> None:
        self.library = library
        self.diagnostics = Diagnostics(s.path for s in library.sources)
        self.coerce = Coercion(self.diagnostics, self._text_of)
        self.declarations = Declarations(self)
        self.units = Units(self)
        self.classes = Classes(self)
        self.programs = Programs(self)
        self.calls = CallGraph(self.diagnostics)
        self.instance_config = InstanceConfig(self)
        self.namespaces: dict[str, str] = {}  # as written, by case-folded name
        self.rewritten: Callable[[list[ast.Declaration]], list[ast.Declaration]] = list  # what unit tests replace
        self.startup: Pou | None = None  # calls FB_Init
        self.shutdown: Pou | None = None  # calls FB_Exit
        self.allocation = Allocation()
        self.blocks: dict[StructType, BlockInfo] = {}
        self.defaults: dict[str, StructInit] = {}
        self.shared: dict[tuple[str, int], Variable] = {}
        self.constants: dict[str, Const] = {}  # that have no memory, by full name
        self.configurations: list[ast.ConfigurationDecl] = []
        self.tests: list[ast.TestDecl] = []
        self.clock: dict[str, Variable] | None = None  # what TIME and LTIME read in unit tests
        self.pous: list[Pou] = []
        self._units: dict[str, Unit] = {}
        self._globals: dict[str, GlobalSymbol] = {}
        self._lists: dict[str, Namespace] = {}
        self._library_names: dict[str, Unit | GlobalSymbol | None] = {}
        self._ambiguous: dict[str, list[GlobalSymbol]] = {}
        self._enum_values: dict[str, list[TypeSymbol]] = {}
        self._bodies: deque[tuple[Scope, ast.PouDecl, Pou]] = deque()
        self._library_bodies: deque[tuple[Scope, ast.PouDecl, Pou]] = deque()

    def scope(self, source: Source, *, library: bool = False) -> Scope:
        """An empty scope in a source."""
        return Scope(self, source, library)

    # ---- names ----

    def register(self, declarations: Iterable[ast.Declaration], *, library: bool = False) -> None:
        """Makes the names of declarations known."""
        for decl in declarations:
            if isinstance(decl, ast.PouDecl):
                self.classes.used = self.classes.used or bool(decl.members) or decl.keyword == "INTERFACE"
                sfc.declare(decl, self.diagnostics)
                self._add(PouSymbol(decl, library), library=library, full_name=decl.full_name)
            elif isinstance(decl, ast.TypeDecl):
                symbol = TypeSymbol(decl, library)
                self._add(symbol, library=library, full_name=symbol.full_name)
                for name in _enum_names(symbol) if not decl.qualified else ():
                    self._enum_values.setdefault(name.casefold(), []).append(symbol)
            elif isinstance(decl, ast.TestDecl):
                self.tests.append(decl)
            elif isinstance(decl, ast.GlobalBlock) and library:
                self._add_globals(decl.block, decl.source, prefix="", library=True)
            elif isinstance(decl, ast.InstanceBlock):
                self.instance_config.add(decl)
            elif isinstance(decl, ast.ConfigurationDecl):
                self.configurations.append(decl)
                self.instance_config.add(decl)
                for block in decl.globals:
                    self._add_globals(block, decl.source, prefix="", library=library)

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
        alone = all(isinstance(d, ast.GlobalBlock | ast.InstanceBlock | ast.TestDecl) for d in declarations)
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
                symbol = GlobalSymbol(name, prefix + name, offset, line, block.qualifiers, source)
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

    def names_in(self, namespace: str) -> list[str]:
        """The bare names of what a namespace holds, for suggestions."""
        prefix = namespace.casefold() + "."
        keys = [key for key in (*self._units, *self._globals, *self.namespaces) if key.startswith(prefix)]
        return [key.removeprefix(prefix) for key in keys if "." not in key.removeprefix(prefix)]

    def _duplicate(self, name: str, pos: Pos, first: Pos) -> None:
        where = f"in line {first.line}" if first.file == pos.file else f"in {first.file}"
        self.diagnostics.error(pos, "duplicate", f"{name} is declared already {where}")

    def lookup(self, key: str, *, library: bool) -> Symbol | None:
        """A global name: the program's own before the library's; inside the library the other way round. Variables come
        before types, so that `motor : Motor` hides nothing that is needed (see `unit`)."""
        if library and (symbol := self._library_symbol(key)) is not None:
            return symbol
        return (
            self._globals.get(key)
            or self.programs.find(key, self._units.get(key))
            or self._units.get(key)
            or self._lists.get(key)
            or self._library_symbol(key)
        )

    def unit(self, key: str, *, library: bool) -> Unit | None:
        """A type, function, function block or program by its name."""
        own = self._units.get(key)
        if own is not None and not library:
            return own
        other = self._library_symbol(key)
        return own if other is None or isinstance(other, GlobalSymbol) else other

    def _text_of(self, character: Expr) -> Expr:
        """A CHAR or WCHAR as a text, by a function of the library."""
        symbol = self._library_symbol("wchar_to_wstring" if character.type is WCHAR else "char_to_string")
        assert isinstance(symbol, PouSymbol)
        info = self.units.function(symbol)
        assert info is not None and info.result is not None
        return Call(info.pou, [character], info.result, character.pos)

    def _library_symbol(self, key: str) -> Unit | GlobalSymbol | None:
        key = without_library(key)
        if key not in self._library_names:
            self._library_names[key] = None
            self.register(self.rewritten(self.library.parse(key, self.diagnostics)), library=True)
        return self._library_names[key]

    def same_named(self, name: str) -> list[GlobalSymbol]:
        """The globals of that name when there are several."""
        return self._ambiguous.get(name.casefold(), [])

    def is_user_name(self, name: str) -> bool:
        """Whether the program itself declares a global name."""
        return name.casefold() in self._units

    def enum_value(self, name: str, scope: Scope, offset: int, expected: Type | None) -> Expr | None:
        """The value of an enumeration by its bare name; None when there is none of that name."""
        symbols = self._enum_values.get(name.casefold())
        if not symbols:
            return None
        types = [t for s in symbols if isinstance(t := self.declarations.resolve_symbol(s), EnumType)]
        if len(types) > 1 and expected in types:
            types = [t for t in types if t is expected]
        if len(types) > 1:
            listed = " or ".join(f"{t}#{name}" for t in types)
            scope.error(offset, "ambiguous", f"{name} is a value of several enumerations; write {listed}")
        for t in types:
            for value_name, value in t.values.items():
                if value_name.casefold() == name.casefold():
                    return Const(value, t, scope.pos(offset))
        return None

    def qualified_names(self, name: str) -> list[str]:
        """What a name could mean that needs that of its list or enumeration in front."""
        key = name.casefold()
        found = [f"{s.name}.{m.name}" for s in self._lists.values() if (m := s.members.get(key)) is not None]
        types = [s for s in self._units.values() if isinstance(s, TypeSymbol) and s.decl.qualified]
        return found + [f"{t.decl.name}.{v}" for t in types for v in _enum_names(t) if v.casefold() == key]

    def visible_names(self) -> list[str]:
        """Names of globals, functions and enumeration values, for suggestions."""
        values = [name for s in self._units.values() if isinstance(s, TypeSymbol) for name in _enum_names(s)]
        units = [s.decl.name for s in self._units.values()]
        named = [s.name for s in self._globals.values()]
        named += [s.name for s in self._lists.values()] + self.programs.names()
        return units + named + values + self.library.names()

    def type_names(self) -> list[str]:
        """Names of types and function blocks, for suggestions."""
        return [s.decl.name for s in self._units.values()] + self.library.names()

    def function_names(self) -> list[str]:
        """Names of functions, for suggestions."""
        own = [s.decl.name for s in self._units.values() if isinstance(s, PouSymbol) and s.keyword == "FUNCTION"]
        return own + self.library.names()

    # ---- units ----

    def add_body(self, scope: Scope, decl: ast.PouDecl, pou: Pou, library: bool) -> None:
        """Queues a body for checking."""
        if scope.edges:
            scope = replace(scope, names=scope.names | scope.edges)
        (self._library_bodies if library else self._bodies).append((scope, decl, pou))

    def declare_all(self) -> None:
        """Declares what the program itself has, used or not, so that all of it is checked."""
        for symbol in list(self._units.values()):
            if isinstance(symbol, TypeSymbol):
                self.declarations.resolve_symbol(symbol)
            elif symbol.keyword == "FUNCTION_BLOCK":
                self.units.block(symbol)
            elif symbol.keyword == "FUNCTION" and not self.units.is_generic(symbol):
                self.units.function(symbol)
        for variable in (*self._globals.values(), *(v for same in self._ambiguous.values() for v in same)):
            self.declarations.global_variable(variable)

    def pou_symbols(self) -> list[PouSymbol]:
        """All POUs and interfaces the program itself declares."""
        return [s for s in self._units.values() if isinstance(s, PouSymbol)]

    def external_functions(self) -> list[Pou]:
        """The functions the program declares that are implemented in C, in order."""
        functions = [s for s in self._units.values() if isinstance(s, PouSymbol) and s.keyword == "FUNCTION"]
        declared = [self.units.function(s) for s in functions if not self.units.is_generic(s)]
        return [info.pou for info in declared if info is not None and info.pou.external is not None]

    def program_symbols(self) -> list[PouSymbol]:
        """The PROGRAM declarations in order."""
        return [s for s in self._units.values() if isinstance(s, PouSymbol) and s.keyword == "PROGRAM"]

    def lookup_program(self, name: str) -> PouSymbol | None:
        """The PROGRAM of that name, perhaps with its namespace in front."""
        key = name.casefold()
        named = (p for p in self.program_symbols() if key in (p.decl.name.casefold(), p.decl.full_name.casefold()))
        return next(named, None)

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

    def check_bodies(self) -> None:
        """Checks all bodies, and those of the library and of the programs they need; what is left over at the end."""
        checked = self._check_queue()
        while self.programs.declare_others():
            checked += self._check_queue()
        for scope in checked:
            self.report_unused(scope)
        construct(self)
        self.pous += self.classes.queries.pous()
        self.classes.finish(v for vs in (self.allocation.variables, *(p.locals for p in self.pous)) for v in vs)
        self.calls.report_recursion()

    def _check_queue(self) -> list[Scope]:
        """Checks what is queued and what that needs; the scopes to look into for what is not used."""
        checked: list[Scope] = []
        self.classes.declare_members()
        while self._bodies or self._library_bodies:
            scope, decl, pou = (self._bodies or self._library_bodies).popleft()
            try:
                body = check_body(Checker(scope), statements_of(decl, scope))
                pou.body = [*scope.prologue, *body]
            except NestingError as error:
                self.nested_too_deeply(error)
            self.pous.append(pou)
            if not scope.library:
                checked.append(scope)
            if not self._bodies:
                self.classes.declare_members()
        return checked

    def nested_too_deeply(self, error: NestingError) -> None:
        """Reports what goes beyond MAX_DEPTH."""
        self.diagnostics.error(error.pos, "nesting", "this is nested too deeply; split it")

    def report_unused(self, scope: Scope) -> None:
        """Warns of variables nobody uses, and of results nobody assigns."""
        for symbol in scope.names.values():
            if not isinstance(symbol, VarSymbol) or symbol.used:
                continue
            if symbol.role in (Role.LOCAL, Role.TEMP):
                self.diagnostics.warning(symbol.pos, "unused", f"{symbol.name} is never used")
            elif symbol.role is Role.RESULT and symbol.name.casefold() not in INITIALISERS:
                message = f"{symbol.name} never assigns its result; write {symbol.name} := ..."
                self.diagnostics.warning(symbol.pos, "result", message)
