"""Instances of PROGRAMs: those that a CONFIGURATION names, and one by its own name of every other PROGRAM.

The instance is declared when a task or a name needs it first, as everything else is. A PROGRAM that is not needed is
checked with variables that go nowhere.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.allocation import Allocation
from plctool.compiler.semantics.declarations.classes import Classes
from plctool.compiler.semantics.declarations.type_declarations import May, TypeDeclarations
from plctool.compiler.semantics.declarations.unit_variables import ROLES, UnitVariables, new_pou
from plctool.compiler.semantics.declarations.variables import Variables
from plctool.compiler.semantics.edges import edge_variables, see_edge
from plctool.compiler.semantics.instances import require_instances
from plctool.compiler.semantics.names import PlannedInstance
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import (
    DIRECTIONS,
    ERROR,
    Namespace,
    PouSymbol,
    ProgramInfo,
    Role,
    VarSymbol,
)
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    Direction,
    Pou,
    Variable,
)  # fmt: skip
from plctool.iec.types import Keep, ReferenceType

_PROGRAM_MAY = {
    Direction.INPUT: May.HAVE_ADDRESS | May.BE_EDGE, Direction.OUTPUT: May.HAVE_ADDRESS, None: May.HAVE_ADDRESS,
    Direction.IN_OUT: May.BE_PLAIN,
}  # fmt: skip


class Programs:
    """The instances, each declared when it is first asked for."""

    def __init__(
        self, world: World, types: TypeDeclarations, variables: Variables, units: UnitVariables, classes: Classes
    ) -> None:
        self._world = world
        self._types = types
        self._variables = variables
        self._units = units
        self._classes = classes
        self._declared: dict[str, Namespace] = {}
        self._checked: set[PouSymbol] = set()

    def instance(self, planned: PlannedInstance) -> Namespace:
        """The instance with its variables placed; its body is queued for checking."""
        key = planned.name.casefold()
        known = self._declared.get(key)
        if known is not None:
            return known
        instance = self._declared[key] = Namespace(planned.name, "program", {})
        info, scope = self._declare(planned, self._world.allocation)
        instance.program, instance.cls = info, scope.cls
        for member, variable in scope.names.items():
            if isinstance(variable, VarSymbol) and variable.role is not Role.TEMP:
                instance.members[member] = variable
        self._checked.add(planned.symbol)
        return instance

    def declared(self) -> dict[str, Pou]:
        """The instances that something needs."""
        return {space.name: space.program.pou for space in self._declared.values() if space.program is not None}

    def declare_others(self) -> bool:
        """Queues the PROGRAMs that are not needed for checking; whether there are any."""
        others = [s for s in self._world.names.program_symbols() if s not in self._checked]
        for symbol in others:
            self._declare(PlannedInstance(symbol.decl.full_name, symbol), Allocation())
        self._checked.update(others)
        return bool(others)

    def report_unused(self) -> None:
        """Warns of programs that are never run."""
        names = self._world.names
        for symbol in names.program_symbols():
            if not any(name.casefold() in self._declared for name in names.instances_of(symbol)):
                message = f"the program {symbol.decl.name} is never run: no task does, and nothing calls it"
                self._world.diagnostics.warning(symbol.decl.source.pos(symbol.decl.pos), "unused", message)

    # ---- declaring ----

    def _declare(self, planned: PlannedInstance, allocation: Allocation) -> tuple[ProgramInfo, Scope]:
        """An instance whose variables go into `allocation`. Its qualifiers, such as RETAIN, are for all variables that
        have none."""
        symbol, name, keep = planned.symbol, planned.name, Keep.of(planned.qualifiers)
        decl = symbol.decl
        pou = new_pou(symbol, name)
        info = ProgramInfo(name, pou, [])
        scope = self._world.scope_of(symbol)
        scope.pou = pou
        for block in self._units.declare_alike(decl, pou, scope):
            self._program_variables(block, info, scope, allocation, keep)

        def place(member: str, variable: VarSymbol) -> Variable | None:
            full_name, t = f"{name}.{member}", variable.type
            own = keep.of_member(variable.keep)
            placed = self._variables.area_variable(full_name, t, variable.default, None, own, scope, 0)
            if placed is not None:
                allocation.add(placed)
            return placed

        self._classes.program(symbol, scope, place)
        self._world.bodies.add(scope, decl)
        return info, scope

    def _program_variables(
        self, block: ast.VarBlock, info: ProgramInfo, scope: Scope, allocation: Allocation, keep: Keep
    ) -> None:
        direction, own = DIRECTIONS.get(block.keyword), self._units.keep_of(block, info.pou)
        keep = keep.of_member(own)
        for line in block.decls:
            t, init = self._types.declared_type(line, scope, _PROGRAM_MAY[direction])
            if direction is Direction.IN_OUT and t is not ERROR:  # a call leaves its address here
                t, init = ReferenceType(t), None
            else:
                require_instances(self._world, t, scope, line.pos)
            for offset, name in line.names:
                symbol = VarSymbol(name, scope.pos(offset), t, ROLES[block.keyword], default=init)
                symbol.used = direction is not None or line.location is not None
                symbol.constant = direction is not None and ast.Modifier.CONSTANT in block.qualifiers
                if not scope.declare(symbol, offset) or t is ERROR:
                    continue
                self._variables.check_kept(name, t, own, scope, offset)
                full_name = f"{info.name}.{name}"
                location = self._variables.address(line.location, t, symbol.pos, full_name)
                wanted = own if location is not None else keep
                symbol.variable = self._variables.area_variable(full_name, t, init, location, wanted, scope, offset)
                if symbol.variable is None:
                    continue
                symbol.variable.shared_output = "shared_output" in line.attributes
                allocation.add(symbol.variable)
                if direction is not None:
                    info.parameters.append((symbol, direction))
                if line.edge:
                    last, edge = edge_variables(symbol.variable)
                    allocation.add(last)
                    allocation.add(edge)
                    see_edge(symbol, line.edge, last, edge, scope)
