"""VAR_CONFIG and VAR_ACCESS: what is said from outside about variables of programs and of the instances in them.

A variable of a program, or a global one, with `AT %I*` is at the address that VAR_CONFIG gives. One of a function
block is in the instance like any other; the task copies it from its address before the programs, or to its address
after them. Without an entry it is plain memory.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

from plctool.compiler.semantics.allocation import located
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import load, same_type, whole
from plctool.compiler.semantics.declarations.fixed_places import FixedPlace, fixed_place, with_part
from plctool.compiler.semantics.declarations.type_declarations import TypeDeclarations
from plctool.compiler.semantics.instances import instances_in
from plctool.compiler.semantics.rules.places import named_place
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import ERROR, VarSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    Assign,
    Initial,
    MemberPlace,
    Place,
    Pos,
    Pou,
    PouKind,
    Storage,
    Task,
    Variable,
)  # fmt: skip
from plctool.iec.addresses import AREAS
from plctool.iec.areas import Area
from plctool.iec.types import BOOL, ArrayType, StructType, Type, base_of


@dataclass(eq=False)
class Entry:
    """A line of VAR_CONFIG. `path` is without the names of configuration and resource; `placed`: a variable was
    declared at its address."""

    line: ast.ConfigLine
    scope: Scope
    path: ast.Expr
    placed: bool = False

    @property
    def name(self) -> str:
        """The path as text."""
        return _path_text(self.path)


@dataclass
class _Copy:
    """`place`, part of an instance in the variable `root`, and what is at its address."""

    root: Variable
    place: Place
    outside: Place
    area: Area

    def inwards(self) -> Assign | None:
        """What is done before the programs."""
        return None if self.area is Area.OUTPUT else Assign(self.place, load(self.outside), self.place.pos)

    def outwards(self) -> Assign | None:
        """What is done after them."""
        return None if self.area is Area.INPUT else Assign(self.outside, load(self.place), self.place.pos)


_Access = tuple[str, ast.Expr, ast.AccessLine, Scope]  # the new name, of what, where that is written


class InstanceConfig:
    """The entries of all VAR_CONFIG and VAR_ACCESS."""

    def __init__(self, world: World, types: TypeDeclarations) -> None:
        self._world = world
        self._types = types
        self._missing: dict[Pos, list[tuple[str, str, Type]]] = {}
        self._open_parts: dict[Type, list[tuple[str, VarSymbol]]] = {}
        self._accesses: list[tuple[Variable, Variable, int]] = []

    # ---- VAR_CONFIG ----

    @cached_property
    def entries(self) -> dict[str, Entry]:
        """By path, case-folded."""
        found: dict[str, Entry] = {}
        for line, scope in self._lines():
            if not isinstance(line, ast.ConfigLine):
                continue
            entry = Entry(line, scope, self._relative(line.path))
            if found.setdefault(entry.name.casefold(), entry) is not entry:
                scope.error(line.pos, "duplicate", f"{entry.name} is in VAR_CONFIG already")
        return found

    def location(self, letter: str, t: Type, pos: Pos, *names: str) -> ast.DirectAddress | None:
        """The address of a variable that is declared AT %I*, %Q* or %M* (`letter`) under these names; None for none."""
        entry = next((e for n in names if (e := self.entries.get(n.casefold())) is not None), None)
        if entry is None or entry.line.location is None:
            self._missing.setdefault(pos, []).append((names[0], letter, t))
            return None
        entry.placed = True
        return entry.line.location if self._has_area(entry, letter) else None

    def gives_address(self, *names: str) -> bool:
        """Whether VAR_CONFIG has an address for a variable with one of these names."""
        found = (self.entries.get(n.casefold()) for n in names)
        return any(entry is not None and entry.line.location is not None for entry in found)

    @cached_property
    def _places(self) -> set[str]:
        """The names before a path that lead to no variable."""
        names = self._world.names
        prefixes = {name.casefold() for decl in names.configurations for name in (decl.name, *decl.resources)}
        return prefixes - names.planned.keys()

    def _has_area(self, entry: Entry, letter: str) -> bool:
        location = entry.line.location
        if location is None or location.text[1:2] == letter:
            return True
        message = f"{entry.name} is declared AT %{letter}*, so it cannot be at {location.text}"
        entry.scope.error(location.pos, "location", message)
        return False

    def _lines(self) -> list[tuple[ast.ConfigLine | ast.AccessLine, Scope]]:
        lines = []
        for block in self._world.names.instance_blocks:
            scope = self._world.scope(block.source)
            scope.sees_inside = True
            lines += [(line, scope) for line in block.lines]
        return lines

    def _relative(self, path: ast.Expr) -> ast.Expr:
        """The path without the names of configuration and resource in front."""
        if isinstance(path, ast.Index):
            return ast.Index(path.pos, self._relative(path.base), path.indices)
        if not isinstance(path, ast.Member):
            return path
        base = self._relative(path.base)
        if isinstance(base, ast.Name) and base.name.casefold() in self._places:
            return ast.Name(path.name_pos, path.name)
        return ast.Member(base.pos, base, path.name, path.name_pos)

    def apply(self, tasks: Sequence[Task]) -> None:
        """Does what the entries say, when all variables are declared."""
        copies = [copy for entry in self.entries.values() if (copy := self._apply(entry)) is not None]
        copies += self._channel_copies()
        for task in tasks:
            names = tuple(f"{pou.name}." for pou in task.programs)
            others = tuple(f"{pou.name}." for t in tasks if t is not task for pou in t.programs)
            own = [c for c in copies if c.root.name.startswith(names) or not c.root.name.startswith(others)]
            self._insert(task, own)
        self._report_missing()
        self._access()

    def _insert(self, task: Task, copies: list[_Copy]) -> None:
        before = [s for c in copies if (s := c.inwards()) is not None]
        behind = [s for c in copies if (s := c.outwards()) is not None]
        first, last = (
            [Pou(f"{task.name}.{name}", PouKind.PROGRAM, body[0].pos, body=list(body))] if body else []
            for name, body in (("inputs", before), ("outputs", behind))
        )
        task.programs[:] = [*first, *task.programs, *last]
        self._world.pous += [*first, *last]

    def _apply(self, entry: Entry) -> _Copy | None:
        line, scope = entry.line, entry.scope
        found = self._find(entry.path, line.type, scope, "VAR_CONFIG")
        if found is None:
            return None
        place, fixed = found
        initial: Initial | None = None
        if line.init is not None:
            decl = ast.VarDecl(line.pos, [(line.pos, entry.name)], None, line.type, line.init)
            initial = self._types.declared_type(decl, scope, overrides=True)[1]
            variable = fixed.variable
            if initial is not None:
                variable.initial = with_part(
                    variable.type, variable.initial, fixed.steps, initial, self._world.defaults
                )
        if line.location is None or entry.placed:
            return None
        return self._copy(entry, line.location, place, fixed, initial)

    def _copy(
        self, entry: Entry, location: ast.DirectAddress, place: Place, fixed: FixedPlace, initial: Initial | None
    ) -> _Copy | None:
        symbol = self._member(place)
        if symbol is None or not symbol.open_area:
            message = f"{entry.name} is not declared AT %{location.text[1:2]}*, so it cannot get an address here"
            entry.scope.error(location.pos, "location", message)
            return None
        if not self._has_area(entry, symbol.open_area):
            return None
        variable = located(entry.name, place.type, initial or symbol.default, location, entry.scope, entry.line.pos)
        if variable is None:
            return None
        variable.shared_output = True  # a global instance is copied by every task
        self._world.allocation.add(variable)
        return _Copy(fixed.variable, place, whole(variable, variable.pos), AREAS[symbol.open_area])

    def _member(self, place: Place) -> VarSymbol | None:
        """The variable of a function block that a place is."""
        if not isinstance(place, MemberPlace) or not isinstance(place.base.type, StructType):
            return None
        symbols = self._symbols(place.base.type).values()
        return next((s for s in symbols if s.variable is not None and _lies_at(s.variable, place.offset)), None)

    def _symbols(self, t: StructType) -> dict[str, VarSymbol]:
        """The members of a function block, or those of a structure that may have addresses, by case-folded name."""
        block = self._world.blocks.get(t)
        return block.members if block is not None else self._world.open_members.get(t, {})

    # ---- channels of inputs and outputs ----

    def _channel_copies(self) -> list[_Copy]:
        """What channels say of parts of variables and of instances."""
        io, allocation = self._world.io, self._world.allocation
        parts = io.parts(allocation.variables)
        if not parts:
            return []
        source = io.source()
        scope = self._world.scope(source)
        scope.sees_inside = True
        copies = []
        for channel in parts:
            path = io.path(channel, source)
            place = named_place(Checker(self._world, scope), path, "a channel")
            fixed = None if place is None else fixed_place(place)
            if place is None:
                continue
            if fixed is None or fixed.bit is not None:
                scope.error(path.pos, "place", "a channel names a variable by a path of names and constant indices")
            elif any(part in self._world.blocks for part in instances_in(place.type)):
                scope.error(path.pos, "place", f"{channel.target} is {place.type}; name a variable in it")
            else:
                outside = io.place(
                    channel, place.type, fixed.variable, fixed.offset, allocation, self._world.diagnostics
                )
                if outside is not None:
                    copies.append(_Copy(fixed.variable, place, whole(outside, outside.pos), outside.area))
        return copies

    # ---- variables without an address ----

    def _report_missing(self) -> None:
        for variable in self._world.allocation.variables:
            for part, symbol in self._open_members(variable.type):
                name = variable.name + part
                entry = self.entries.get(name.casefold())
                if (entry is None or entry.line.location is None) and self._world.io.area(name) is None:
                    self._missing.setdefault(symbol.pos, []).append((name, symbol.open_area, symbol.type))
        for pos, missing in self._missing.items():
            name, letter, t = missing[0]
            more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
            line = f"{name} AT %{letter}{_example(t)} : {t};"
            message = f"{name}{more} has no address and is plain memory; write in VAR_CONFIG: {line}"
            self._world.diagnostics.warning(pos, "unlocated", message)

    def _open_members(self, t: Type) -> list[tuple[str, VarSymbol]]:
        """The members AT %I* and the like in the instances that a variable of the type holds, by their path in it."""
        known = self._open_parts.get(t)
        if known is not None:
            return known
        found: list[tuple[str, VarSymbol]] = []
        if isinstance(t, ArrayType):
            inside = self._open_members(t.element)
            indices = product(*(range(low, high + 1) for low, high in t.bounds)) if inside else ()
            found = [(f"[{','.join(map(str, i))}]{part}", s) for i in indices for part, s in inside]
        elif isinstance(t, StructType):
            symbols = self._symbols(t)
            for f in t.fields:
                symbol = symbols.get(f.name.casefold())
                if symbol is not None and symbol.open_area:
                    found.append((f".{f.name}", symbol))
                found += [(f".{f.name}{part}", s) for part, s in self._open_members(f.type)]
        self._open_parts[t] = found
        return found

    # ---- VAR_ACCESS ----

    def accesses(self) -> list[Variable]:
        """The names of VAR_ACCESS, when all variables have their addresses."""
        for alias, of, offset in self._accesses:
            alias.offset = of.offset + offset
        return [alias for alias, _, _ in self._accesses]

    def _access(self) -> None:
        seen: set[str] = set()
        for name, path, line, scope in (*self._given_access(), *self._given_by_programs()):
            if name.casefold() in seen:
                scope.error(line.pos, "duplicate", f"{line.name} is in VAR_ACCESS already")
            seen.add(name.casefold())
            found = self._find(path, line.type, scope, "VAR_ACCESS")
            if found is not None:
                (place, fixed), of = found, found[1].variable
                alias = Variable(name, place.type, of.storage, scope.pos(line.pos), of.area, bit=fixed.bit)
                alias.constant = not line.writable
                self._accesses.append((alias, of, fixed.offset))

    def _given_access(self) -> Iterator[_Access]:
        for line, scope in self._lines():
            if isinstance(line, ast.AccessLine):
                yield line.name, self._relative(line.path), line, scope

    def _given_by_programs(self) -> Iterator[_Access]:
        """The lines of VAR_ACCESS in a PROGRAM: each instance of it gets `Main.name`, for what is in it."""
        names, variables = self._world.names, self._world.allocation.variables
        for instance in [i for i in names.planned.values() if i.symbol.decl.accesses]:
            names.instance(instance.name.casefold())  # declares its variables, if nothing has needed them yet
            declared = {variable.name.casefold() for variable in variables}
            for line in instance.symbol.decl.accesses:
                scope = self._world.scope_of(instance.symbol)
                scope.sees_inside = True
                name = f"{instance.name}.{line.name}"
                if name.casefold() in declared:
                    scope.error(line.pos, "duplicate", f"{instance.name} has a {line.name} already")
                    continue
                yield name, _inside(instance.name, line.path), line, scope

    # ---- both ----

    def _find(self, path: ast.Expr, spec: ast.TypeSpec, scope: Scope, use: str) -> tuple[Place, FixedPlace] | None:
        """The variable of a path, which has to be of the type given; None after an error."""
        wanted, _ = self._types.type_of(spec, scope)
        place = named_place(Checker(self._world, scope), path, use)
        if place is None or wanted is ERROR:
            return None
        if isinstance(path, ast.BitAccess):
            scope.error(path.pos, "place", f"{use} names variables, not single bits of them")
            return None
        if not same_type(wanted, place.type):
            scope.error(spec.pos, "type", f"{_path_text(path)} is {place.type}, not {wanted}")
            return None
        fixed = fixed_place(place)
        if fixed is None:
            scope.error(path.pos, "place", f"{use} names variables by a path of names and constant indices")
            return None
        return place, fixed


def _lies_at(variable: Variable, offset: int) -> bool:
    """Whether it is that part of the instance; constants and VAR_STAT are none."""
    return variable.storage is Storage.SELF and variable.offset == offset


def _inside(instance: str, path: ast.Expr) -> ast.Expr:
    """The path of a variable of a program, from outside."""
    if isinstance(path, ast.Name):
        return ast.Member(path.pos, ast.Name(path.pos, instance), path.name, path.pos)
    if isinstance(path, ast.Member | ast.Index | ast.BitAccess | ast.Deref):
        return replace(path, base=_inside(instance, path.base))
    return path


def _example(t: Type) -> str:
    """An address that would do, without its first letters."""
    return "X0.0" if base_of(t) is BOOL else {2: "W0", 4: "D0", 8: "L0"}.get(t.align, "B0")


def _path_text(path: ast.Expr) -> str:
    """`Main.fb[3].x` as written, without spaces."""
    if isinstance(path, ast.Member):
        return f"{_path_text(path.base)}.{path.name}"
    if isinstance(path, ast.Index):
        indices = ",".join(str(e.value) if isinstance(e, ast.Literal) else "?" for e in path.indices)
        return f"{_path_text(path.base)}[{indices}]"
    return path.name if isinstance(path, ast.Name) else path.text if isinstance(path, ast.DirectAddress) else "?"
