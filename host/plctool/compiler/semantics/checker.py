"""What all checks of expressions have in common: the ways in, errors, values and places.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

from plctool.compiler.nesting import MAX_DEPTH, NestingError
from plctool.compiler.semantics.conversions import (
    NUMBERS,
    elementary,
    error_value,
    settle,
)  # fmt: skip
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import (
    ERROR,
    UNTYPED_INT,
    UNTYPED_REAL,
    VarSymbol,
)  # fmt: skip
from plctool.compiler.syntax import ast
from plctool.compiler.typed import (
    Const,
    DerefPlace,
    Expr,
    Load,
    Place,
    Pos,
    SelfPlace,
    ValuePlace,
    VarPlace,
)  # fmt: skip
from plctool.compiler.types import (
    BOOL,
    ReferenceType,
    Type,
)  # fmt: skip


def is_untyped(e: Expr) -> bool:
    """Whether the expression is a constant that takes the type its surroundings need."""
    return e.type is UNTYPED_INT or e.type is UNTYPED_REAL


def place_of(e: Expr) -> Place:
    """The place a value was loaded from, or a temporary one."""
    return e.place if isinstance(e, Load) else ValuePlace(e, e.type, e.pos)


def is_temporary(place: Place) -> bool:
    """Whether a place is (part of) a value that nobody else sees."""
    while not isinstance(place, VarPlace | DerefPlace | ValuePlace | SelfPlace):
        place = place.base
    return isinstance(place, ValuePlace)


def load(place: Place) -> Load:
    """The value of a place; of a reference, the value it refers to."""
    if isinstance(place.type, ReferenceType):
        place = DerefPlace(Load(place, place.type, place.pos), place.type.target, place.pos)
    return Load(place, place.type, place.pos)


class Checker(ABC):
    """Checks the expressions of one scope. What it needs is provided by the classes built on it."""

    def __init__(self, scope: Scope) -> None:
        self.scope = scope
        self.world = scope.world
        self.coerce = scope.world.coerce
        self.pos: Callable[[int], Pos] = scope.source.pos
        self._depth = 0

    # ---- entry points ----

    def value(self, node: ast.Expr, target: Type) -> Expr:
        """The expression as a value of `target`."""
        return self.coerce(self.expr(node, target), target)

    def settled(self, node: ast.Expr) -> Expr:
        """The expression with the type it has by itself."""
        return settle(self.expr(node))

    def condition(self, node: ast.Expr) -> Expr:
        """The expression as a BOOL."""
        e = self.expr(node, BOOL)
        if e.type is BOOL:
            return e
        return self.coerce(e, BOOL)

    def constant(self, node: ast.Expr, expected: Type | None = None) -> Const | None:
        """The value of a constant expression; anything else is reported."""
        e = self.expr(node, expected)
        if e.type is ERROR:
            return None
        if isinstance(e, Const):
            return e
        self.error(node.pos, "constant", "a constant is needed here")
        return None

    def integer(self, node: ast.Expr) -> int | None:
        """The value of a constant integer expression."""
        e = self.constant(node)
        if e is None:
            return None
        base = elementary(e.type)
        if isinstance(e.value, int) and base is not None and base.kind in NUMBERS:
            return e.value
        self.error(node.pos, "type", "an integer constant is needed here")
        return None

    def place(self, node: ast.Expr, use: str) -> Place | None:
        """The variable (or part of one) an expression names; `use` says what for."""
        e = self.expr(node)
        if e.type is ERROR:
            return None
        if isinstance(e, Load) and not is_temporary(e.place):
            return e.place
        self.error(node.pos, "place", f"{use} needs a variable")
        return None

    def error(self, offset: int, code: str, message: str) -> Expr:
        """Reports an error; the value that stands for the expression."""
        self.scope.error(offset, code, message)
        return error_value(self.pos(offset))

    def _deeper(self, offset: int) -> None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise NestingError(self.pos(offset))

    # ---- what the classes built on this one provide ----

    @abstractmethod
    def expr(self, node: ast.Expr, expected: Type | None = None) -> Expr:
        """The typed expression; `expected` is the type the surroundings would like. Untyped constants stay untyped."""

    @abstractmethod
    def call_by_name(self, name: str, args: list[Expr], offset: int, expected: Type | None) -> Expr:
        """A call of a library function with checked arguments."""

    @abstractmethod
    def call(self, node: ast.Call, expected: Type | None) -> Expr:
        """A call as a value."""

    @abstractmethod
    def input(self, node: ast.Expr, t: Type, name: str) -> Expr:
        """The value of an input."""

    @abstractmethod
    def own_name(self, node: ast.Name, symbol: object) -> Expr | None:
        """THIS, SUPER or a property by its bare name."""

    @abstractmethod
    def member_of(self, base: Expr, node: ast.Member) -> Expr | None:
        """A property of an instance."""

    @abstractmethod
    def qualified(self, node: ast.Member) -> Expr | None:
        """What is in a namespace."""

    @abstractmethod
    def followed(self, e: Expr) -> Expr:
        """The result of a call, or what it refers to."""

    @abstractmethod
    def may_see(self, symbol: VarSymbol, t: Type, node: ast.Member) -> bool:
        """Whether a variable that is not PUBLIC may be used here; reports it when not."""
