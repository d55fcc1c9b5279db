"""Initial values of declarations: numbers, `[...]` of arrays, `(name := value)` of structs and instances.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.instances import COPY_CODE, INIT_RETAINS, initialisers
from plctool.compiler.semantics.rules.arguments import input_value
from plctool.compiler.semantics.rules.members import dotted_name
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import ERROR, GlobalSymbol, Namespace, Role, VarSymbol
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.compiler.typed.nodes import (
    ArrayInit,
    ComputedInit,
    Const,
    Expr,
    Initial,
    Load,
    ScalarInit,
    StructInit,
    VarPlace,
    array_runs,
    overlay,
    struct_members,
)
from plctool.iec.types import MAX_SIZE, ArrayType, ReferenceType, StringType, StructType, Type

MAX_RUNS = 1_000_000  # of different values that a repetition makes


class InitialValues:
    """Checks initial values."""

    def __init__(self, world: World) -> None:
        self._world = world

    def initial(self, node: ast.Init, t: Type, scope: Scope) -> Initial | None:
        """An initial value, calculated at the start when it is not constant; None after an error."""
        if isinstance(node, ast.ArrayInit):
            return self._array_initial(node, t, scope)
        if isinstance(node, ast.StructInit):
            return self._struct_initial(node, t, scope)
        c = Checker(self._world, scope)
        is_reference = isinstance(t, ReferenceType) and not isinstance(node, ast.Literal)
        e = input_value(c, node, t, "the reference") if is_reference else c.value(node, t)
        if e.type is ERROR:
            return None
        if isinstance(e, Const):
            return ScalarInit(e.value)
        if isinstance(t, StructType) and t in self._world.blocks:
            scope.error(node.pos, "type", f"an instance of {t} is not a value; write (name := value) for its variables")
            return None
        if isinstance(e, Load) and isinstance(e.place, VarPlace) and e.place.var.constant:
            return self._complete(t, e.place.var.initial)
        return ComputedInit(e)

    def _complete(self, t: Type, initial: Initial | None) -> Initial:
        """The value of a constant with its zeros, which the defaults of where it is copied to leave alone."""
        if isinstance(t, ArrayType):
            return ArrayInit([(count, self._complete(t.element, value)) for count, value in array_runs(t, initial)])
        if isinstance(t, StructType):
            given = initial if isinstance(initial, StructInit) else StructInit({})
            members = struct_members(t, given, self._world.defaults.get(t.name))
            return replace(given, members={f.name: self._complete(f.type, value) for f, value in members})
        return initial or ScalarInit("" if isinstance(t, StringType) else 0)

    def _array_initial(self, node: ast.ArrayInit, t: Type, scope: Scope) -> Initial | None:
        if not isinstance(t, ArrayType):
            scope.error(node.pos, "type", f"[...] does not initialise {t}")
            return None
        counts = [high - low + 1 for low, high in t.bounds]
        runs = self._runs(node.items, counts, t.element, scope)
        if runs is None:
            return None
        total = sum(count for count, _ in runs)
        if total > t.count:
            scope.error(node.pos, "range", f"{total} initial values for the {t.count} elements of {t}")
            return None
        return ArrayInit(runs)

    def _runs(
        self, items: Iterable[ast.Init | ast.Repeat], counts: list[int], element: Type, scope: Scope
    ) -> list[tuple[int, Initial | None]] | None:
        """Runs of values in element order. A nested [...] fills one step of the first index."""
        runs: list[tuple[int, Initial | None]] = []
        inner = 1
        for count in counts[1:]:
            inner *= count
        for item in items:
            if isinstance(item, ast.Call) and self._is_repeat(item, scope):
                item = ast.Repeat(item.pos, item.callee, [a.value for a in item.args if a.value is not None])
            if isinstance(item, ast.Repeat):
                more = self._repeated(item, counts, element, scope)
            elif isinstance(item, ast.ArrayInit) and len(counts) > 1:
                more = self._runs(item.items, counts[1:], element, scope)
                if more is not None and (given := sum(c for c, _ in more)) < inner:
                    more.append((inner - given, None))
            else:
                value = self.initial(item, element, scope)
                more = None if value is None else [(1, value)]
            if more is None:
                return None
            runs += more
        return runs

    def _is_repeat(self, item: ast.Call, scope: Scope) -> bool:
        """Whether the callee is a variable: `N(TRUE)`, `Sizes.N(TRUE)`."""
        if isinstance(item.callee, ast.Name):
            return isinstance(scope.lookup(item.callee.name), VarSymbol | GlobalSymbol)
        name = dotted_name(Checker(self._world, scope), item.callee)
        if name is None:
            return False
        owner, _, own = name.rpartition(".")
        space = scope.lookup(owner)
        return isinstance(scope.lookup(name), GlobalSymbol) or (
            isinstance(space, Namespace) and own.casefold() in space.members
        )

    def _repeated(
        self, item: ast.Repeat, counts: list[int], element: Type, scope: Scope
    ) -> list[tuple[int, Initial | None]] | None:
        count = Checker(self._world, scope).integer(item.count)
        if count is None:
            return None
        if not 0 <= count <= MAX_SIZE:
            scope.error(item.pos, "range", f"{count} is not a number of elements")
            return None
        if not item.values:
            return [(count, None)]
        runs = self._runs(item.values, counts, element, scope)
        if runs is None or len(runs) == 1:
            return runs and [(runs[0][0] * count, runs[0][1])]
        if count * len(runs) > MAX_RUNS:
            scope.error(item.pos, "size", "this initial value is too large")
            return None
        return runs * count

    def _struct_initial(self, node: ast.StructInit, t: Type, scope: Scope) -> Initial | None:
        if not isinstance(t, StructType):
            hint = "; the values of an array are written in brackets" if isinstance(t, ArrayType) else ""
            scope.error(node.pos, "type", f"(name := value) does not initialise {t}{hint}")
            return None
        block = self._world.blocks.get(t)
        members: dict[str, Initial] = {}
        arguments: dict[str, Expr] = {}
        properties: dict[str, Expr] = {}
        for offset, name, value, first in self._named(node, t, scope):
            field = t.member(name)
            if (field is None or first) and self._initialiser_argument(name, value, t, arguments, scope):
                continue
            if field is None and self._property(name, value, t, properties, scope):
                continue
            if field is None and self._is_incomplete(t, scope):
                continue
            if field is None or (block is not None and block.members[name.casefold()].role is Role.IN_OUT):
                hint = did_you_mean(name, (f.name for f in t.fields))
                scope.error(offset, "unknown", f"{t} has no member {name} to initialise{hint}")
                continue
            if field.name in members:
                scope.error(offset, "duplicate", f"{name} is initialised twice")
            given = self.initial(value, field.type, scope)
            if given is not None:
                members[field.name] = given
        return StructInit(members, arguments, properties)

    def _is_incomplete(self, t: StructType, scope: Scope) -> bool:
        """True if the type may have members and inputs that are not known, because of an error that was reported."""
        return scope.is_incomplete(t.name) or scope.inherits_unknown(self._world.class_of(t))

    def _property(self, name: str, node: ast.Init, t: StructType, properties: dict[str, Expr], scope: Scope) -> bool:
        """`fb : MyFB := (Mode := 3)` for a property with a SET; False when there is none."""
        cls, key = self._world.class_of(t), name.casefold()
        setter = None if cls is None else cls.find(f"{key}.set")
        if setter is None or isinstance(node, ast.ArrayInit | ast.StructInit):
            return False
        symbol, _ = self._world.declared.member(setter).parameters[0]
        properties[key] = input_value(Checker(self._world, scope), node, symbol.type, name)
        return True

    def _without_name(self, t: StructType) -> str:
        if t in self._world.blocks:
            return f"{t} has no FB_Init that takes this value; give the value a name"
        members = ", ".join(f"{field.name} := ..." for field in t.fields[:2])
        return f"the members of {t} are given by name: ({members})"

    def _named(self, node: ast.StructInit, t: StructType, scope: Scope) -> list[tuple[int, str, ast.Init, bool]]:
        """The members with names: values without one are for the inputs of FB_Init, in their order. With each, whether
        such an input comes before a member of that name."""
        names: list[str] = []
        for member in initialisers(self._world, t)[-1:]:
            inputs = [symbol.name for symbol, _ in self._world.declared.member(member).parameters]
            names = [name for name in inputs if name.casefold() not in (INIT_RETAINS, COPY_CODE)]
        found: list[tuple[int, str, ast.Init, bool]] = []
        for offset, name, value in node.members:
            if not name and not names and self._is_incomplete(t, scope):
                break
            if not name and not names:
                scope.error(offset, "arguments", self._without_name(t))
                break
            found.append((offset, name or names.pop(0), value, node.arguments or not name))
        return found

    def _initialiser_argument(
        self, name: str, node: ast.Init, t: StructType, arguments: dict[str, Expr], scope: Scope
    ) -> bool:
        """`fb : MyFB(id := 3)` for an input of FB_Init; False when there is no such input."""
        for member in reversed(initialisers(self._world, t)):
            for symbol, _ in self._world.declared.member(member).parameters:
                if symbol.name.casefold() == name.casefold():
                    arguments[name.casefold()] = self._argument(name, node, symbol.type, scope)
                    return True
        return False

    def _argument(self, name: str, node: ast.Init, t: Type, scope: Scope) -> Expr:
        c = Checker(self._world, scope)
        if isinstance(node, ast.ArrayInit | ast.StructInit):
            message = f"FB_Init takes a constant or a variable for {name}; declare a constant with these values"
            return c.error(node.pos, "arguments", message)
        return input_value(c, node, t, name)


def with_arguments(decl: ast.VarDecl) -> tuple[ast.TypeSpec, list[ast.Init]]:
    """Type and initial values: what is written in brackets after the type of an array, `F[(1), (2)]`, comes first."""
    spec = decl.type
    given: list[ast.Init] = []
    if isinstance(spec, ast.ArraySpec) and isinstance(spec.element, ast.NamedType):
        element = spec.element
        if element.inits is not None:
            given.append(ast.ArrayInit(element.inits.pos, [_of_instance(item) for item in element.inits.items]))
            spec = ast.ArraySpec(spec.pos, spec.bounds, ast.NamedType(element.pos, element.name))
    return spec, given if decl.init is None else [*given, decl.init]


def combined(t: Type, first: Initial, second: Initial) -> Initial:
    """Both initial values, element by element of an array; where both say something, the second one."""
    if not isinstance(t, ArrayType):
        return overlay(t, second, first)
    runs: list[tuple[int, Initial | None]] = []
    ones, others = list(array_runs(t, first)), list(array_runs(t, second))
    while ones and others:
        (count, one), (other_count, other) = ones[0], others[0]
        taken = min(count, other_count)
        runs.append((taken, overlay(t.element, other, one) if one and other else other or one))
        ones[:1] = [(count - taken, one)] if count > taken else []
        others[:1] = [(other_count - taken, other)] if other_count > taken else []
    return ArrayInit(runs)


def _of_instance(item: ast.Init | ast.Repeat) -> ast.Init | ast.Repeat:
    """`(1)` after the type of an array of instances: the input of one FB_Init."""
    if isinstance(item, ast.StructInit):
        return replace(item, arguments=True)
    if isinstance(item, ast.ArrayInit | ast.Repeat):
        return item
    return ast.StructInit(item.pos, [(item.pos, "", item)], arguments=True)
