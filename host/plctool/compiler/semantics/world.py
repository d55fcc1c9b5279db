"""Everything the check of one program shares: its names, what is declared so far, diagnostics.

A statement needs a function, whose parameter is an array, whose bound is a constant expression, which names a global
... So rules ask for what is declared, and what declares asks the rules. Here is what can be asked for.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import field, replace
from zlib import crc32

from plctool.compiler.base.information import NO_INFORMATION, Information
from plctool.compiler.base.source import Source
from plctool.compiler.semantics.allocation import Allocation, DirectVariables, module_address
from plctool.compiler.semantics.call_graph import CallGraph
from plctool.compiler.semantics.coercion import Coercion
from plctool.compiler.semantics.dynamic_types import Dispatches
from plctool.compiler.semantics.io_channels import IoChannels
from plctool.compiler.semantics.names import Names, PlannedInstance
from plctool.compiler.semantics.pitfalls import Loop
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import (
    BlockInfo,
    ClassInfo,
    FunctionInfo,
    GlobalSymbol,
    Member,
    Namespace,
    PouSymbol,
    TypeSymbol,
    VarSymbol,
)
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.syntax.library import Library
from plctool.compiler.typed.nodes import (
    Assign,
    Call,
    Const,
    DerefPlace,
    Direction,
    Expr,
    Initial,
    Load,
    MemberPlace,
    Parameter,
    Pos,
    Pou,
    PouKind,
    ScalarInit,
    Storage,
    StructInit,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.online_change import Previous
from plctool.iec.types import (
    CLASS_NUMBER,
    UDINT,
    WCHAR,
    EnumType,
    InterfaceType,
    RawPointerType,
    StructType,
    Type,
)
from plctool.records import dataclass

# ---- bodies that wait for their check ----


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

    def has(self, path: str) -> bool:
        """Whether some of a file of the program are to be checked."""
        return any(scope.source.path == path for scope, _ in self._own)

    def take(self, path: str) -> list[tuple[Scope, ast.PouDecl]]:
        """Takes out those of a file of the program."""
        taken = [body for body in self._own if body[0].source.path == path]
        self._own = deque(body for body in self._own if body[0].source.path != path)
        return taken


# ---- what is declared when something first needs it ----


@dataclass(frozen=True)
class Declarers:
    """Who declares what. Each of them says what is wrong the first time, and does nothing the second time."""

    type_of: Callable[[TypeSymbol], Type]
    type_named: Callable[[int, str, Scope], Type]  # ERROR after an error
    type_written: Callable[[ast.TypeSpec, Scope], Type]
    variable: Callable[[GlobalSymbol], VarSymbol]
    function: Callable[[PouSymbol, dict[str, Type]], FunctionInfo | None]  # None while it is being declared
    member: Callable[[Member], FunctionInfo]
    block: Callable[[PouSymbol], BlockInfo | None]  # None when it contains itself
    layout: Callable[[PouSymbol], StructType | None]  # the type of a block, also while it is being declared
    interface: Callable[[PouSymbol], InterfaceType]
    instance: Callable[[PlannedInstance], Namespace]


# ---- what __NEW takes ----


@dataclass(eq=False)
class Pool:
    """The elements of a type for __NEW, with the state of each of them. `pos` is where it is needed first; `declared`:
    how many elements the attribute of the type says, 0 without one, `asked`: the default for what calls of __NEW need.
    `creators` take and initialise elements; by what those start with, unless the type says it, and by the inputs of
    FB_Init, case-folded, that they get."""

    type: Type
    pos: Pos
    elements: Variable
    state: Variable
    declared: int = 0
    asked: int = 0
    creators: dict[tuple[Variable | None, tuple[str, ...]], Pou] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """How many elements there are; final when all bodies are checked."""
        return self.declared or self.asked


# ---- the check of one program ----


class World:
    """What every part of the check may use."""

    def __init__(
        self,
        library: Library,
        diagnostics: Diagnostics,
        io: IoChannels,
        declared_by: Callable[[World], Declarers],
        information: Information = NO_INFORMATION,
        previous: Previous | None = None,
    ) -> None:
        """`declared_by` makes what declares, for this world; it is called when the world has all else."""
        self.diagnostics = diagnostics
        self.pause: Callable[[], None] = lambda: None  # called between two units; what it raises ends the check
        self.dialect = diagnostics.dialect
        self.information = information
        self.names = Names(library, diagnostics, lambda planned: self.declared.instance(planned))
        self.coerce = Coercion(self.diagnostics, self._text_of)
        self.calls = CallGraph(self.diagnostics)
        self.dispatches = Dispatches()
        self.previous = previous
        self.allocation = Allocation(previous)
        self.direct = DirectVariables(self.allocation)
        self.io = io
        self.bodies = BodyQueue()
        self.blocks: dict[StructType, BlockInfo] = {}
        self.open_members: dict[StructType, dict[str, VarSymbol]] = {}  # of structures: AT %I*, %Q*, %M*
        self.interfaces: dict[StructType, ClassInfo] = {}
        self.defaults: dict[str, StructInit] = {}
        self.shared: dict[tuple[str, str, int, frozenset[tuple[str, Type]]], Variable] = {}
        self.enumeration_texts: dict[EnumType, PouSymbol] = {}  # what gives the names of values
        self._copiers: dict[StructType, Pou] = {}
        self._texts: dict[tuple[int | float | str, Type], Variable] = {}
        self._defaults_in_memory: dict[VarSymbol | TypeSymbol, Variable] = {}
        self.constants: dict[str, Const] = {}  # that have no memory, by full name
        self.inferred: dict[tuple[str, str, int], Type] = {}  # of TypeOf, by path and name of the source, and offset
        self.pools: dict[Type, Pool] = {}
        self.closers: dict[Type, Pou] = {}  # what ends the elements that a POINTER TO the type leads to
        self.clock: dict[str, Variable] = {}  # what TIME and LTIME read in unit tests
        self.programs_run: set[str] | None = None  # by tasks of the device, in lower case; None in unit tests
        self.pous: list[Pou] = []
        self.loops: list[tuple[Pou, Loop]] = []  # of the program, each with the unit it stands in
        self.declared = declared_by(self)

    @property
    def extent(self) -> tuple[int, ...]:
        """How much there is of all that the check of a body may add to."""
        added = (self.allocation.variables, self.allocation.once_placed, self.blocks, self.open_members)
        made = (self.interfaces, self.defaults, self.shared, self.enumeration_texts, self._copiers, self._texts)
        more = (self._defaults_in_memory, self.constants, self.inferred, self.pools, self.closers, self.clock)
        return (*(len(of) for of in (*added, *made, *more)), bool(self.bodies), self.dispatches.count)

    def scope(self, source: Source, *, library: bool = False) -> Scope:
        """An empty scope in a source."""
        return Scope(self.names, source, library)

    def scope_of(self, symbol: PouSymbol) -> Scope:
        """The surroundings of a unit: its source and namespace."""
        scope = self.scope(symbol.decl.source, library=symbol.library)
        scope.enter(symbol.decl.namespace)
        return scope

    def class_of(self, t: Type) -> ClassInfo | None:
        """The class of instances of a function block type or of an interface."""
        if not isinstance(t, StructType):
            return None
        block = self.blocks.get(t)
        return block.cls if block is not None else self.interfaces.get(t)

    def default_of(self, symbol: VarSymbol, pou: Pou) -> Variable:
        """What a parameter of `pou` that is a structure or an array holds when a call leaves it out: a constant in
        memory."""
        return self._default(symbol, f"{pou.name}.{symbol.name}", symbol.type, symbol.pos, symbol.default)

    def start_of(self, symbol: TypeSymbol) -> Variable | None:
        """What a variable of a declared type starts with, if another name of it starts otherwise: a constant in
        memory."""
        t, decl = self.declared.type_of(symbol), symbol.decl
        own = isinstance(t, StructType) and t.name == symbol.full_name
        if own or symbol.default is None:
            return None
        return self._default(symbol, symbol.full_name, t, decl.source.pos(decl.pos), symbol.default)

    def _default(
        self, symbol: VarSymbol | TypeSymbol, name: str, t: Type, pos: Pos, initial: Initial | None
    ) -> Variable:
        variable = self._defaults_in_memory.get(symbol)
        if variable is None:
            variable = Variable(f"default of {name}", t, Storage.AREA, pos, initial=initial, constant=True)
            self._defaults_in_memory[symbol] = variable
            self.allocation.add(variable)
        return variable

    def copier_of(self, t: StructType, number: int) -> Pou:
        """The function that makes an instance of a block of the part that it has of a derived one."""
        known = self._copiers.get(t)
        if known is not None:
            return known
        pos, field = Pos("", 1, 1), t.member(CLASS_NUMBER)
        assert field is not None
        given = Variable("given", RawPointerType(t), Storage.LOCAL, pos)
        pou = self._copiers[t] = Pou(f"__COPY({t})", PouKind.FUNCTION, pos)
        pou.result = Variable(pou.name, t, Storage.LOCAL, pos)
        pou.locals.append(pou.result)
        pou.parameters.append(Parameter(given, Direction.INPUT))
        whole = VarPlace(pou.result, t, pos)
        source = DerefPlace(Load(VarPlace(given, given.type, pos), given.type, pos), t, pos)
        pou.body = [
            Assign(whole, Load(source, t, pos), pos),
            Assign(MemberPlace(whole, field.offset, UDINT, pos), Const(number, UDINT, pos), pos),
        ]
        self.pous.append(pou)
        return pou

    def at_address(self, node: ast.DirectAddress, scope: Scope) -> VarSymbol | None:
        """What a statement means by an address such as %IW2; None after an error."""
        address = module_address(node)
        if address is None:
            return self.direct.find(node, scope)
        bound, pos = self.io.bound(address), scope.pos(node.pos)
        if not bound:
            self.io.bind(address, (address.text,), pos, self.diagnostics)
        symbol = self.direct.in_module(address, pos, bound)
        if symbol is None:
            scope.error(node.pos, "location", f"{node.text} is {bound}; use that name here")
        return symbol

    def text(self, constant: Const) -> Variable:
        """Memory that holds a text for those who ask for its address."""
        variable = self._texts.get((constant.value, constant.type))
        if variable is None:
            initial = ScalarInit(constant.value)
            number = crc32(f"{constant.type}:{constant.value}".encode(errors="surrogatepass"))
            name = f"text {number:08X}"  # of its content, so that an online change finds it again
            while any(known.name == name for known in self._texts.values()):
                name += "'"
            variable = Variable(name, constant.type, Storage.AREA, constant.pos, initial=initial, constant=True)
            self._texts[constant.value, constant.type] = variable
            self.allocation.add(variable)
        return variable

    def _text_of(self, character: Expr) -> Expr:
        """A CHAR or WCHAR as a text, by a function of the library."""
        symbol = self.names.unit("wchar_to_wstring" if character.type is WCHAR else "char_to_string", library=True)
        assert isinstance(symbol, PouSymbol)
        info = self.declared.function(symbol, {})
        assert info is not None and info.result is not None
        return Call(info.pou, [character], info.result, character.pos)
