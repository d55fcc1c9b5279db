"""Variables that exist once: constants, global ones, those of programs; where each lives and what it starts with.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.allocation import is_open, located, misfit, module_address
from plctool.compiler.semantics.declarations.instance_config import InstanceConfig
from plctool.compiler.semantics.declarations.type_declarations import May, TypeDeclarations
from plctool.compiler.semantics.instances import instances_in, require_instances
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import ERROR, GlobalSymbol, Role, VarSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed.kept import is_kept
from plctool.compiler.typed.nodes import (
    Binary,
    Call,
    ComputedInit,
    Const,
    Convert,
    Expr,
    Initial,
    IntrinsicCall,
    Load,
    Pos,
    ScalarInit,
    Storage,
    Unary,
    ValuePlace,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.areas import Area
from plctool.iec.types import (
    ArrayType,
    Elementary,
    Keep,
    Kind,
    PointerType,
    StringType,
    StructType,
    Type,
    base_of,
    is_scalar,
)  # fmt: skip


class Variables:
    """Makes variables of declarations."""

    def __init__(self, world: World, types: TypeDeclarations, config: InstanceConfig) -> None:
        self._world = world
        self._types = types
        self._config = config
        self._calculated: set[Variable] = set()  # constants whose value is computed when the application starts

    def _is_calculated(self, e: Expr) -> bool:
        """Whether a value is made of constants by functions of the library alone, as LOG(2.0) is."""
        for node in walk(e):
            if isinstance(node, Call) and not node.function.pos.file.startswith("stdlib/"):
                return False
            if isinstance(node, VarPlace) and node.var not in self._calculated:
                return False
            if not isinstance(node, Call | VarPlace | ValuePlace | Load | Unary | Binary | Convert | IntrinsicCall):
                return False
        return True

    def constant_symbol(
        self, offset: int, name: str, t: Type, init: Initial | None, scope: Scope, owner: str, role: Role
    ) -> VarSymbol:
        """A constant: scalars and strings are folded, arrays and structs get memory once, however many instances there
        are."""
        pos, full_name = scope.pos(offset), f"{owner}.{name}" if owner else name
        calculated = isinstance(init, ComputedInit) and self._is_calculated(init.value)
        if isinstance(init, ComputedInit) and not calculated:
            scope.error(offset, "constant", f"the value of the constant {name} is not known before the program runs")
        if any(instance in self._world.blocks for instance in instances_in(t)):
            scope.error(offset, "constant", f"{name} changes when it is called; declare it without CONSTANT")
        symbol = VarSymbol(name, pos, t, role, constant=True, default=init)
        if calculated:  # by functions of the library: once, when the application starts
            symbol.variable = self.shared_variable(full_name, t, init, scope, offset)
            self._calculated.add(symbol.variable)
        elif is_scalar(t) or isinstance(t, StringType):
            zero: int | float | str = "" if isinstance(t, StringType) else 0.0 if _is_real(t) else 0
            symbol.value = Const(init.value if isinstance(init, ScalarInit) else zero, t, pos)
            if not scope.library:
                self._world.constants[full_name] = symbol.value
        elif t is not ERROR:
            symbol.variable = self.shared_variable(full_name, t, init, scope, offset, constant=True)
        return symbol

    def shared_variable(
        self,
        full_name: str,
        t: Type,
        init: Initial | None,
        scope: Scope,
        offset: int,
        *,
        constant: bool = False,
        keep: Keep = Keep.UNSAID,
    ) -> Variable:
        """A variable that exists once for all instances of its POU; of a generic function, for each of its types."""
        key = (scope.source.path, scope.source.name, offset, frozenset(scope.bindings.items()))
        variable = self._world.shared.get(key)
        if variable is None:
            area = self._area(t, keep)
            variable = Variable(full_name, t, Storage.AREA, scope.pos(offset), area, initial=init, constant=constant)
            variable.keep = keep
            self._world.shared[key] = variable
            self._world.allocation.add(variable)
        return variable

    def global_variable(self, symbol: GlobalSymbol) -> VarSymbol:
        """Declares a global when it is first used, so that the order of declarations does not matter."""
        if symbol.symbol is not None:
            return symbol.symbol
        scope = self._world.scope(symbol.source)
        scope.enter(symbol.namespace)
        if symbol.busy:
            scope.error(symbol.pos, "recursion", f"the value of {symbol.name} depends on itself")
            return VarSymbol(symbol.name, scope.pos(symbol.pos), ERROR, Role.GLOBAL)
        symbol.busy = True
        t, init = self._types.declared_type(symbol.decl, scope, May.HAVE_ADDRESS)
        require_instances(self._world, t, scope, symbol.pos)
        owner = symbol.full_name.rpartition(".")[0]
        if ast.Modifier.CONSTANT in symbol.qualifiers:
            result = self.constant_symbol(symbol.pos, symbol.name, t, init, scope, owner, Role.GLOBAL)
        else:
            result = VarSymbol(symbol.name, scope.pos(symbol.pos), t, Role.GLOBAL, default=init)
            if t is not ERROR:
                location = self.address(symbol.decl.location, t, scope, result.pos, symbol.full_name, symbol.name)
                keep = Keep.of(symbol.qualifiers)
                self.check_kept(symbol.name, t, keep, scope, symbol.pos)
                result.variable = self.area_variable(symbol.full_name, t, init, location, keep, scope, symbol.pos)
                if result.variable is not None:
                    result.variable.shared_output = "shared_output" in symbol.decl.attributes
                    result.variable.from_c = "from_c" in symbol.decl.attributes
                    self._world.allocation.add(result.variable)
        symbol.busy = False
        symbol.symbol = result
        return result

    def address(
        self, location: ast.DirectAddress | None, t: Type, scope: Scope, pos: Pos, *names: str
    ) -> ast.DirectAddress | None:
        """Where a variable with these names is: for `AT %I*` VAR_CONFIG says it. None: it has no address, but perhaps a
        channel, as it must if it is in a module."""
        in_module = module_address(location)
        if location is not None and in_module is not None:
            problem = misfit(t, location.text, in_module.width)
            if problem:
                scope.error(location.pos, "location", problem)
            else:
                self._world.io.bind(in_module, names, scope.pos(location.pos), self._world.diagnostics)
            return None
        if location is None or not is_open(location):
            return location
        claimed = self._world.io.claims(location.text[1], names, self._world.diagnostics)
        if claimed and not self._config.gives_address(*names):
            return None
        return self._config.location(location.text[1], t, pos, *names)

    def area_variable(
        self,
        name: str,
        t: Type,
        init: Initial | None,
        location: ast.DirectAddress | None,
        keep: Keep,
        scope: Scope,
        offset: int,
    ) -> Variable | None:
        """A variable of a program or a global one; not allocated yet."""
        pos = scope.pos(offset)
        if location is not None and self._holds_instances(t):
            message = f"{t} has instances of function blocks, which have no address; give one to their variables"
            scope.error(location.pos, "location", message)
            return None
        if location is not None and keep.kept:
            message = f"what is at an address is not kept; declare {name} without AT, or without {keep.value}"
            scope.error(location.pos, "location", message)
            return None
        if location is not None:
            return located(name, t, init, location, scope, offset)
        area = self._world.io.area(name)
        if area is None or keep.kept or self._holds_instances(t) or isinstance(t, PointerType):
            area = self._area(t, keep)
        return Variable(name, t, Storage.AREA, pos, area, initial=init, keep=keep)

    def check_kept(self, name: str, t: Type, keep: Keep, scope: Scope, offset: int) -> None:
        """Warns of a variable of which nothing is kept though its section says so."""
        if keep.kept and t is not ERROR and not is_kept(t, keep):
            message = f"{name} holds an address, which means nothing after a start: it is not kept"
            scope.warning(offset, "kept", message)

    def _area(self, t: Type, keep: Keep) -> Area:
        return Area.RETAIN if keep.kept or self.is_retain(t) else Area.DATA

    def _holds_instances(self, t: Type) -> bool:
        return any(part in self._world.blocks for part in instances_in(t))

    def is_retain(self, t: Type) -> bool:
        """Whether instances of the type live in the retain area as a whole."""
        while isinstance(t, ArrayType):
            t = t.element
        block = self._world.blocks.get(t) if isinstance(t, StructType) else None
        if block is not None:
            return block.retain
        return isinstance(t, StructType) and any(self.is_retain(f.type) for f in t.fields)


def _is_real(t: Type) -> bool:
    base = base_of(t)
    return isinstance(base, Elementary) and base.kind is Kind.REAL
