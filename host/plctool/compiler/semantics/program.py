"""The check of one program: who declares what, and the order in which all of it is declared and checked.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext

from plctool.compiler.base.information import NO_INFORMATION, Information
from plctool.compiler.base.internal import note_position
from plctool.compiler.semantics.body_records import BodyRecords
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.construction import construct, construct_new
from plctool.compiler.semantics.declarations.classes import Classes
from plctool.compiler.semantics.declarations.functions import Functions
from plctool.compiler.semantics.declarations.instance_config import InstanceConfig
from plctool.compiler.semantics.declarations.instance_layouts import Blocks, Programs
from plctool.compiler.semantics.declarations.type_declarations import TypeDeclarations
from plctool.compiler.semantics.declarations.unit_variables import UnitVariables
from plctool.compiler.semantics.declarations.variables import Variables
from plctool.compiler.semantics.generics import describes_any, is_generic
from plctool.compiler.semantics.io_channels import IoChannels
from plctool.compiler.semantics.pools import write_pools
from plctool.compiler.semantics.rules.control import write_body
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.sfc_statements import statements_of
from plctool.compiler.semantics.symbols import PouSymbol, TypeSymbol
from plctool.compiler.semantics.trail import reserve_trail
from plctool.compiler.semantics.world import Declarers, World
from plctool.compiler.sources.imports import ImportedLibrary
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import Diagnostics
from plctool.compiler.syntax.library import Library
from plctool.compiler.typed.nodes import Pou, Variable
from plctool.compiler.typed.online_change import Previous


class Program:
    """All parts of the check."""

    def __init__(
        self,
        library: Library,
        libraries: Sequence[ImportedLibrary],
        diagnostics: Diagnostics,
        io: IoChannels,
        information: Information = NO_INFORMATION,
        previous: Previous | None = None,
    ) -> None:
        self.libraries = libraries
        self.startup: Pou | None = None  # calls FB_Init
        self.startup_of_new: Pou | None = None  # the same of the variables that an online change adds
        self.shutdown: Pou | None = None  # calls FB_Exit
        self.may_recurse = False
        self.trail: Variable | None = None
        self.checked: list[Scope] = []  # of bodies without errors
        self.records: BodyRecords | None = None  # for a process in which a changed body is checked again alone
        self.world = World(library, diagnostics, io, self._declared_by, information, previous)

    def _declared_by(self, world: World) -> Declarers:
        self.types = TypeDeclarations(world)
        self.config = InstanceConfig(world, self.types)
        self.variables = Variables(world, self.types, self.config)
        units = UnitVariables(world, self.types, self.variables)
        self._functions = Functions(world, self.types, units)
        self._classes = Classes(world, self.types, self._functions)
        self._blocks = Blocks(world, self.types, self.variables, units, self._classes)
        self.programs = Programs(world, self.types, self.variables, units, self._classes)
        return Declarers(
            type_of=self.types.type_of_symbol,
            type_named=self.types.named_type,
            type_written=lambda spec, scope: self.types.type_of(spec, scope)[0],
            variable=self.variables.global_variable,
            function=self._functions.function,
            member=self._classes.signature,
            block=self._blocks.block,
            layout=self._blocks.layout,
            interface=self._classes.interface,
            instance=self.programs.instance,
        )

    def declare_all(self) -> None:
        """Declares what the program itself has, used or not, so that all of it is checked."""
        for symbol in self.world.names.units():
            self.world.pause()
            if isinstance(symbol, TypeSymbol):
                self.types.type_of_symbol(symbol)
            elif symbol.keyword is ast.Unit.FUNCTION_BLOCK:
                self._blocks.block(symbol)
            elif symbol.keyword is ast.Unit.FUNCTION and (not is_generic(symbol.decl) or describes_any(symbol.decl)):
                self._functions.function(symbol, {})
        for variable in self.world.names.globals():
            self.variables.global_variable(variable)

    def external_functions(self) -> list[Pou]:
        """The functions, blocks and methods the program declares that are implemented in C, in order."""
        functions = [s for s in self.world.names.functions() if not is_generic(s.decl)]
        declared = [self._functions.function(s, {}) for s in functions]
        found = [info.pou for info in declared if info is not None]
        for symbol in self.world.names.units():
            if isinstance(symbol, PouSymbol) and "external" in symbol.decl.attributes:
                block = self._blocks.block(symbol) if symbol.keyword is ast.Unit.FUNCTION_BLOCK else None
                if block is not None and block.cls is not None:
                    found += [block.pou, *(self._classes.signature(m).pou for m in block.cls.members.values())]
        return [pou for pou in found if pou.external is not None]

    def check_bodies(self) -> None:
        """Checks all bodies, and those of the library and of the programs they need; what is left over at the end."""
        world = self.world
        self._check_queue()
        while self.programs.declare_others():
            self._check_queue()
        write_pools(world)
        self.startup, self.shutdown = construct(world)
        self.startup_of_new = construct_new(world)
        self.trail = reserve_trail(world)
        world.pous += world.dispatches.queries.pous()
        self._classes.find_targets(
            v for vs in (world.allocation.variables, *(p.locals for p in world.pous)) for v in vs
        )
        world.dispatches.note_calls(world.calls)
        world.calls.report_recursion()
        self.may_recurse = world.calls.report_possible_recursion()

    def check_bodies_in(self, path: str) -> None:
        """Checks the bodies in one file of the program; `check_bodies` then checks the others."""
        more = True
        while more:
            self._classes.declare_members()
            for scope, decl in self.world.bodies.take(path):
                self._check_body(scope, decl)
                self._classes.declare_members()
            more = self.world.bodies.has(path) or self.programs.declare_others()

    def _check_queue(self) -> None:
        """Checks what is queued and what that needs."""
        bodies = self.world.bodies
        self._classes.declare_members()
        while bodies:
            self._check_body(*bodies.next())
            if bodies.only_library:
                self._classes.declare_members()

    def _check_body(self, scope: Scope, decl: ast.PouDecl) -> None:
        world = self.world
        before = world.diagnostics.errors
        world.pause()
        try:
            with nullcontext() if self.records is None else self.records.noted(world, scope, decl):
                write_body(Checker(world, scope), statements_of(world, decl, scope))
        except Exception as error:
            note_position(error, scope.pos(decl.pos))
            raise
        if not scope.library and world.diagnostics.errors == before:  # else it may be used where the errors are
            self.checked.append(scope)
