"""Everything the check of one program shares: its names, what is declared so far, diagnostics.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.diagnostics import Diagnostics
from plctool.compiler.library import Library
from plctool.compiler.nesting import NestingError
from plctool.compiler.semantics.addresses import DirectVariables
from plctool.compiler.semantics.allocation import Allocation
from plctool.compiler.semantics.body_queue import BodyQueue
from plctool.compiler.semantics.call_graph import CallGraph
from plctool.compiler.semantics.coercion import Coercion
from plctool.compiler.semantics.declared import Declared
from plctool.compiler.semantics.dispatches import Dispatches
from plctool.compiler.semantics.endless import Loop
from plctool.compiler.semantics.io_channels import IoChannels
from plctool.compiler.semantics.names import Names
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import BlockInfo, ClassInfo, PouSymbol, VarSymbol
from plctool.compiler.source import Source
from plctool.compiler.typed import Call, Const, Expr, Pou, ScalarInit, Storage, StructInit, Variable
from plctool.iec.types import WCHAR, EnumType, StructType, Type


class World:
    """What every part of the check may use."""

    declared: Declared
    """Set by what declares."""

    def __init__(self, library: Library) -> None:
        self.diagnostics = Diagnostics(s.path for s in library.sources)
        self.names = Names(library, self.diagnostics)
        self.coerce = Coercion(self.diagnostics, self._text_of)
        self.calls = CallGraph(self.diagnostics)
        self.dispatches = Dispatches()
        self.allocation = Allocation()
        self.direct = DirectVariables(self.allocation)
        self.io = IoChannels()
        self.bodies = BodyQueue()
        self.blocks: dict[StructType, BlockInfo] = {}
        self.open_members: dict[StructType, dict[str, VarSymbol]] = {}  # of structures: AT %I*, %Q*, %M*
        self.interfaces: dict[StructType, ClassInfo] = {}
        self.defaults: dict[str, StructInit] = {}
        self.shared: dict[tuple[str, str, int], Variable] = {}
        self.enumeration_texts: dict[EnumType, PouSymbol] = {}  # what gives the names of values
        self._texts: dict[tuple[int | float | str, Type], Variable] = {}
        self._parameter_defaults: dict[tuple[str, int], Variable] = {}
        self.constants: dict[str, Const] = {}  # that have no memory, by full name
        self.clock: dict[str, Variable] | None = None  # what TIME and LTIME read in unit tests
        self.pous: list[Pou] = []
        self.loops: list[tuple[Pou, Loop]] = []  # of the program, each with the unit it stands in

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

    def default_of(self, symbol: VarSymbol) -> Variable:
        """What a parameter that is a structure or an array holds when a call leaves it out: a constant in memory."""
        key = (symbol.pos.file, symbol.pos.line << 16 | symbol.pos.column)
        variable = self._parameter_defaults.get(key)
        if variable is None:
            name = f"{symbol.name} default {symbol.pos.line}.{symbol.pos.column}"
            variable = Variable(name, symbol.type, Storage.AREA, symbol.pos, initial=symbol.default, constant=True)
            self._parameter_defaults[key] = variable
            self.allocation.add(variable)
        return variable

    def text(self, constant: Const) -> Variable:
        """Memory that holds a text for those who ask for its address."""
        variable = self._texts.get((constant.value, constant.type))
        if variable is None:
            initial = ScalarInit(constant.value)
            name = f"text {len(self._texts) + 1}"
            variable = Variable(name, constant.type, Storage.AREA, constant.pos, initial=initial, constant=True)
            self._texts[constant.value, constant.type] = variable
            self.allocation.add(variable)
        return variable

    def nested_too_deeply(self, error: NestingError) -> None:
        """Reports what goes beyond MAX_DEPTH."""
        self.diagnostics.error(error.pos, "nesting", "this is nested too deeply; split it")

    def _text_of(self, character: Expr) -> Expr:
        """A CHAR or WCHAR as a text, by a function of the library."""
        symbol = self.names.unit("wchar_to_wstring" if character.type is WCHAR else "char_to_string", library=True)
        assert isinstance(symbol, PouSymbol)
        info = self.declared.function(symbol, {})
        assert info is not None and info.result is not None
        return Call(info.pou, [character], info.result, character.pos)
