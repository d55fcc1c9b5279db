"""Function blocks and programs: the layout of their instances.

The instance is declared when a task or a name needs it first, as everything else is. A PROGRAM that is not needed is
checked with variables that go nowhere.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.allocation import Allocation
from plctool.compiler.semantics.declarations.classes import Classes
from plctool.compiler.semantics.declarations.type_declarations import May, TypeDeclarations
from plctool.compiler.semantics.declarations.unit_variables import (
    ROLES,
    UnitVariables,
    edge_variables,
    new_pou,
    see_edge,
)
from plctool.compiler.semantics.declarations.variables import Variables
from plctool.compiler.semantics.generics import NAME, give_bounds, group_of, is_any
from plctool.compiler.semantics.instances import require_instances
from plctool.compiler.semantics.mocks import IN_C
from plctool.compiler.semantics.names import PlannedInstance
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import (
    DIRECTIONS,
    ERROR,
    BlockInfo,
    Namespace,
    PouSymbol,
    ProgramInfo,
    Role,
    VarSymbol,
)
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Direction, Initial, Parameter, Pou, Storage, StructInit, Variable
from plctool.iec.types import DWORD, Field, Keep, ReferenceType, StringType, StructType, Type

# ---- function blocks ----

_MEMBER_MAY = {
    Role.INPUT: May.BE_EDGE | May.HAVE_OPEN_ADDRESS, Role.OUTPUT: May.HAVE_OPEN_ADDRESS,
    Role.IN_OUT: May.BE_OPEN_ARRAY, Role.LOCAL: May.HAVE_OPEN_ADDRESS, Role.STEP: May.BE_PLAIN,
}  # fmt: skip


class Blocks:
    """Declares function blocks when they are first referred to."""

    def __init__(
        self, world: World, types: TypeDeclarations, variables: Variables, units: UnitVariables, classes: Classes
    ) -> None:
        self._world = world
        self._types = types
        self._variables = variables
        self._units = units
        self._classes = classes
        self._blocks: dict[PouSymbol, BlockInfo] = {}
        self._layouts: dict[PouSymbol, StructType] = {}
        self._busy: set[PouSymbol] = set()

    def block(self, symbol: PouSymbol) -> BlockInfo | None:
        """A function block ready to be instantiated; None when it contains itself."""
        info = self._blocks.get(symbol)
        if info is not None:
            return info
        if symbol in self._busy:
            return None
        self._busy.add(symbol)
        with self._types.postponing():
            try:
                info = self._declare_block(symbol)
            finally:
                self._busy.discard(symbol)
            self._blocks[symbol] = info
        return info

    def _declare_block(self, symbol: PouSymbol) -> BlockInfo:
        decl = symbol.decl
        pou = new_pou(symbol, self._world.names.unique_name(symbol))
        scope = self._world.scope_of(symbol)
        scope.pou = pou
        layout = StructType(pou.name)
        info = BlockInfo(pou, layout, {})
        pou.instance = layout
        defaults: dict[str, Initial] = {}
        self._layouts[symbol] = layout
        self._classes.begin_block(symbol, info, scope, defaults)
        for block in self._units.declare_alike(decl, pou, scope):
            self._members(block, info, defaults, scope)
        self._classes.instance_variables(info, defaults, scope)
        layout.fields = [f for f in layout.fields if f.type is not ERROR]
        layout.lay_out()
        for field in layout.fields:
            symbol_of = info.members.get(field.name.casefold())
            if symbol_of is not None and symbol_of.variable is not None:
                symbol_of.variable.offset = field.offset
        if defaults:
            self._world.defaults[layout.name] = StructInit(defaults)
        info.members |= {k: s for k, s in scope.names.items() if isinstance(s, VarSymbol) and s.role is not Role.TEMP}
        self._world.blocks[layout] = info
        self._classes.end_block(info, scope)
        if "external" in decl.attributes or IN_C in decl.attributes:
            for member in info.members.values():
                member.used = True  # in C
        if "external" in decl.attributes:
            self._classes.in_c(info, scope)
        else:
            self._world.bodies.add(scope, decl)
        return info

    def layout(self, symbol: PouSymbol) -> StructType | None:
        """The type of instances, also while the block is being declared: what points to it may be part of it."""
        if symbol not in self._layouts:
            self.block(symbol)
        return self._layouts.get(symbol)

    def _members(self, block: ast.VarBlock, info: BlockInfo, defaults: dict[str, Initial], scope: Scope) -> None:
        role, direction = ROLES[block.keyword], DIRECTIONS.get(block.keyword)
        keep = self._units.keep_of(block, info.pou)
        info.retain = info.retain or keep.kept
        for line in block.decls:
            described = is_any(line.type) and role in (Role.INPUT, Role.OUTPUT)
            t, default = (
                self._any(line, scope) if described else self._types.declared_type(line, scope, _MEMBER_MAY[role])
            )
            if role is not Role.IN_OUT:
                require_instances(self._world, t, scope, line.pos)
            info.retain = info.retain or (role is not Role.IN_OUT and self._variables.is_retain(t))
            for offset, name in line.names:
                symbol = VarSymbol(name, scope.pos(offset), t, role, default=default)
                symbol.given, symbol.used = line.init is not None, direction is not None
                symbol.access = next(iter(block.qualifiers & ast.ACCESS), None)
                symbol.open_area = line.location.text[1] if line.location is not None else ""
                symbol.constant = ast.Modifier.CONSTANT in block.qualifiers
                symbol.group = group_of(line.type) if described else ""
                symbol.is_path = "instance-path" in line.attributes
                symbol.used = symbol.used or symbol.is_path
                if symbol.is_path and not isinstance(t, StringType) and t is not DWORD:
                    message = f"the path of the instance needs a STRING, or a DWORD for its CRC-32, not {t}"
                    scope.error(offset, "attribute", message)
                if not scope.declare(symbol, offset):
                    continue
                info.make_way(name, defaults)
                info.members[name.casefold()] = symbol
                alias = line.attributes.get("alias", "") if scope.library else ""
                if alias:
                    info.members[alias.casefold()] = symbol
                if t is ERROR:
                    scope.lacks(info.pou.name)
                    continue
                self._variables.check_kept(name, t, keep, scope, offset)
                reference = role is Role.IN_OUT
                storage = Storage.REFERENCE if reference else Storage.SELF
                symbol.variable = Variable(name, t, storage, symbol.pos, initial=None if reference else default)
                info.type.fields.append(Field(name, ReferenceType(t) if reference else t, alias=alias, keep=keep))
                if default is not None and not reference:
                    defaults[name] = default
                if direction is not None:
                    info.pou.parameters.append(Parameter(symbol.variable, direction, reference))
                for bound in give_bounds(symbol.variable, Storage.SELF):
                    self._hidden_member(bound, info, keep)
                if line.edge:
                    last, edge = edge_variables(symbol.variable)
                    self._hidden_member(last, info, keep)
                    self._hidden_member(edge, info, keep)
                    see_edge(symbol, line.edge, last, edge, scope)

    def _any(self, line: ast.VarDecl, scope: Scope) -> tuple[Type, None]:
        """What an instance has of the argument for an input or output of type ANY_..."""
        if line.init is not None:
            scope.error(line.pos, "type", f"{group_of(line.type)} has no initial value")
        return self._world.declared.type_named(line.pos, f"__SYSTEM.{NAME}", scope), None

    def _hidden_member(self, variable: Variable, info: BlockInfo, keep: Keep) -> None:
        """A member that has no name in the program."""
        symbol = VarSymbol(variable.name, variable.pos, variable.type, Role.LOCAL, variable)
        info.members[variable.name.casefold()] = symbol
        info.type.fields.append(Field(variable.name, variable.type, keep=keep))


# ---- programs ----

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
        """Warns of programs that are never run. What tests run may be there for them alone, such as a plant."""
        names = self._world.names
        tested = names.types_of_tests()
        for symbol in names.program_symbols():
            run = any(name.casefold() in self._declared for name in names.instances_of(symbol))
            if not run and symbol.decl.name.casefold() not in tested:
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
                location = self._variables.address(line.location, t, scope, symbol.pos, full_name)
                connected = self._world.io.area(full_name) is not None
                symbol.used = symbol.used or connected
                wanted = own if location is not None or connected else keep
                symbol.variable = self._variables.area_variable(full_name, t, init, location, wanted, scope, offset)
                if symbol.variable is None:
                    continue
                symbol.variable.shared_output = "shared_output" in line.attributes
                symbol.variable.from_c = "from_c" in line.attributes
                symbol.used = symbol.used or symbol.variable.from_c
                allocation.add(symbol.variable)
                if direction is not None:
                    info.parameters.append((symbol, direction))
                if line.edge:
                    last, edge = edge_variables(symbol.variable)
                    allocation.add(last)
                    allocation.add(edge)
                    see_edge(symbol, line.edge, last, edge, scope)
