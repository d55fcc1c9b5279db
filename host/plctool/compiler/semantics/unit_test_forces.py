"""FORCE and UNFORCE in unit tests: a forced variable gets its value again after each statement of the test that may
change it, and so before and after each call, as on a controller before and after the code of a task.

The places are known when the test is compiled; hidden variables hold which of them are forced now, and to what.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

from plctool.compiler.semantics.assertions import Bench
from plctool.compiler.semantics.checker import Checker
from plctool.compiler.semantics.conversions import elementary, load
from plctool.compiler.semantics.rules.places import changeable_place
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import (
    Assign,
    Call,
    Case,
    Const,
    Continue,
    Exit,
    FbCall,
    For,
    If,
    IndexPlace,
    Jump,
    Node,
    Place,
    Pos,
    Repeat,
    Return,
    Statement,
    Storage,
    Try,
    Variable,
    VarPlace,
    While,
)
from plctool.compiler.typed.typed_nodes import root_of, walk, written_places
from plctool.iec.areas import Area
from plctool.iec.types import BOOL


@dataclass(frozen=True)
class _Forced:
    """A place that a test forces. `on`: it is forced now; `value`: to what."""

    place: Place
    on: Variable
    value: Variable

    def switch(self, on: bool, pos: Pos) -> Statement:
        """Forces it from now on, or ends that."""
        return Assign(VarPlace(self.on, BOOL, pos), Const(int(on), BOOL, pos), pos)

    def put(self, pos: Pos) -> Statement:
        """Sets it again if it is forced."""
        value = load(VarPlace(self.value, self.value.type, pos))
        return If([(load(VarPlace(self.on, BOOL, pos)), [Assign(self.place, value, pos)])], [], pos)


class Forces:
    """The forces of a TEST and of the SETUP before it (`before`), in the order in which they stand there."""

    def __init__(self, bench: Bench, before: Forces | None = None) -> None:
        self._bench = bench
        self._places: list[_Forced] = [] if before is None else list(before._places)

    def force(self, c: Checker, target: ast.Expr, value: ast.Expr, offset: int) -> list[Statement]:
        """FORCE(variable, value)"""
        place = _fixed_place(c, target)
        e = None if place is None else c.value(value, place.type)
        if place is None or e is None or e.type is ERROR:
            return []
        forced = self._find(place)
        if forced is None:
            hidden = (self._bench.hidden("force", t) for t in (BOOL, place.type))
            forced = _Forced(place, *hidden)
            self._places.append(forced)
        pos = c.pos(offset)
        return [Assign(VarPlace(forced.value, place.type, pos), e, pos), forced.switch(True, pos), forced.put(pos)]

    def unforce(self, c: Checker, target: ast.Expr, offset: int) -> list[Statement]:
        """UNFORCE(variable)"""
        place = _fixed_place(c, target)
        forced = None if place is None else self._find(place)
        if place is not None and forced is None:
            c.error(target.pos, "force", "this is not forced; write FORCE before UNFORCE, with the same name")
        return [] if forced is None else [forced.switch(False, c.pos(offset))]

    def unforce_all(self, c: Checker, offset: int) -> list[Statement]:
        """UNFORCE()"""
        return [forced.switch(False, c.pos(offset)) for forced in self._places]

    def hold(self, body: list[Statement]) -> None:
        """Makes the statements of a test set again what is forced."""
        if self._places:
            body[:] = self._held(body)

    def _held(self, body: list[Statement]) -> Iterator[Statement]:
        for statement in body:
            changes = _Changes(statement)
            changed = [forced for forced in self._places if changes.may_be(forced.place)]
            for inner in _bodies(statement):
                inner[:] = [*(forced.put(statement.pos) for forced in changed), *self._held(inner)]
            yield statement
            if not isinstance(statement, Return | Exit | Continue | Jump):
                yield from (forced.put(statement.pos) for forced in changed)

    def _find(self, place: Place) -> _Forced | None:
        return next((forced for forced in self._places if _is_same(forced.place, place)), None)


class _Changes:
    """What a statement may change."""

    def __init__(self, statement: Statement) -> None:
        nodes = list(walk(statement))
        self._all = any(isinstance(node, Call | FbCall) for node in nodes)
        self._roots = [root_of(place) for node in nodes for place in written_places(node)]

    def may_be(self, place: Place) -> bool:
        """True if it may be a part of this place. What is at an address may overlap, and pointers lead anywhere."""
        root = root_of(place)
        if self._all or None in self._roots or (root is None and self._roots):
            return True
        return any(root is changed or _is_at_address(root, changed) for changed in self._roots)


def _is_at_address(*variables: Variable | None) -> bool:
    return all(v is not None and v.storage is Storage.AREA and v.area is not Area.DATA for v in variables)


def _fixed_place(c: Checker, node: ast.Expr) -> Place | None:
    """The variable to be forced; one that is not the same all the time is reported."""
    place = changeable_place(c, node, "FORCE", "be forced")
    if place is None:
        return None
    if elementary(place.type) is None:
        message = f"FORCE takes a number, BOOL, TIME or enumeration, not {place.type}; force its parts, or assign it"
        c.error(node.pos, "type", message)
        return None
    indices = [index for part in walk(place) if isinstance(part, IndexPlace) for index in part.indices]
    if not all(isinstance(index, Const) for index in indices):
        c.error(node.pos, "force", "FORCE needs a variable with constant indices, such as list[3]")
        return None
    return place


def _bodies(statement: Statement) -> list[list[Statement]]:
    """The statements in a statement."""
    if isinstance(statement, If):
        return [*(body for _, body in statement.branches), statement.otherwise]
    if isinstance(statement, Case):
        return [*(body for _, body in statement.branches), statement.otherwise]
    if isinstance(statement, For | While | Repeat):
        return [statement.body]
    if isinstance(statement, Try):
        return [statement.body, statement.caught, statement.last]
    return []


def _is_same(a: object, b: object) -> bool:
    """True if two places are the same, wherever they stand."""
    if isinstance(a, Node):
        names = [field.name for field in fields(a) if field.name != "pos"]  # type: ignore[arg-type]
        return type(a) is type(b) and all(_is_same(getattr(a, name), getattr(b, name)) for name in names)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(_is_same(*pair) for pair in zip(a, b, strict=True))
    return a == b
