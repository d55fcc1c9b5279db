"""What every check of an expression or statement gets: where it stands, whom to ask, how to report.

The rules themselves are functions, one for each kind of node of the syntax tree (package `rules`). They register here
for the kind they check; so a rule has its parts checked by `expr` and `statement` without knowing which one does it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from plctool.compiler.base.internal import note_position
from plctool.compiler.base.nesting import MAX_DEPTH, OPERATORS, NestingError
from plctool.compiler.semantics.conversions import elementary, error_value, settle
from plctool.compiler.semantics.labels import Labels
from plctool.compiler.semantics.pitfalls import Loop
from plctool.compiler.semantics.scope import Scope
from plctool.compiler.semantics.symbols import ERROR
from plctool.compiler.semantics.world import World
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Const, Expr, Pos, Statement
from plctool.iec.common_types import NUMBERS
from plctool.iec.dialect import OWN
from plctool.iec.types import BOOL, Type

ExprNode = TypeVar("ExprNode", bound=ast.Expr)
StmtNode = TypeVar("StmtNode", bound=ast.Stmt)
SpecialCalls = Mapping[str, Callable[[ast.Call], list[Statement]]]
"""Calls that are statements of their own, by name in upper case."""


class Checker:
    """The check of the expressions and statements of one scope."""

    def __init__(self, world: World, scope: Scope, special_calls: SpecialCalls | None = None) -> None:
        self.world = world
        self.scope = scope
        self.dialect = OWN if scope.library else world.dialect
        self.coerce = world.coerce
        self.pos: Callable[[int], Pos] = scope.source.pos
        self.special_calls: SpecialCalls = special_calls or {}
        self.owner: ast.Expr | None = None  # the last one that a dot follows
        self.loops = 0  # around the statement
        self.labels = Labels([])  # of the body
        self.temps: dict[str, Expr] = {}  # the values of the intermediate results of the body, by name
        self.around: list[list[ast.Stmt]] = []  # the statements it is one of, those around them ...
        self.last = 0  # how many of `around` are around the innermost __FINALLY
        self._expressions = 0
        self._statements = 0

    def expr(self, node: ast.Expr, expected: Type | None = None) -> Expr:
        """The typed expression; `expected` is the type the surroundings would like. Untyped constants stay untyped."""
        level = 1 if type(node) is ast.Binary else OPERATORS
        self._expressions += level
        if self._expressions > MAX_DEPTH * OPERATORS:
            raise NestingError(self.pos(node.pos))
        try:
            e = EXPRESSION_RULES[type(node)](self, node, expected)
        except Exception as error:
            note_position(error, self.pos(node.pos))
            raise
        self._expressions -= level
        return e

    def statement(self, node: ast.Stmt) -> list[Statement]:
        """What a statement becomes; nothing after an error."""
        self._statements += 1
        if self._statements > MAX_DEPTH:
            raise NestingError(self.pos(node.pos))
        try:
            statements = STATEMENT_RULES[type(node)](self, node)
        except Exception as error:
            note_position(error, self.pos(node.pos))
            raise
        self._statements -= 1
        return statements

    def value(self, node: ast.Expr, target: Type) -> Expr:
        """The expression as a value of `target`."""
        return self.coerce(self.expr(node, target), target)

    def settled(self, node: ast.Expr) -> Expr:
        """The expression with the type it has by itself."""
        return settle(self.expr(node))

    def condition(self, node: ast.Expr) -> Expr:
        """The expression as a BOOL."""
        return self.value(node, BOOL)

    def constant(self, node: ast.Expr, expected: Type | None = None) -> Const | None:
        """The value of a constant expression; anything else is reported."""
        e = self.expr(node, expected)
        if e.type is ERROR:
            return None
        if isinstance(e, Const):
            return e
        hint = f"; declare {node.name} in VAR CONSTANT" if isinstance(node, ast.Name) else ""
        self.error(node.pos, "constant", f"a constant is needed here{hint}")
        return None

    def integer(self, node: ast.Expr) -> int | None:
        """The value of a constant integer expression."""
        e = self.constant(node)
        if e is None:
            return None
        e = e if e.whole is None else e.whole
        base = elementary(e.type)
        if isinstance(e.value, int) and base is not None and base.kind in NUMBERS:
            return e.value
        self.error(node.pos, "type", "an integer constant is needed here")
        return None

    def error(self, offset: int, code: str, message: str) -> Expr:
        """Reports an error; the value that stands for the expression."""
        self.scope.error(offset, code, message)
        return error_value(self.pos(offset))

    def missing(self, offset: int, name: str, message: str) -> Expr:
        """Reports that nothing is known by a name; the value that stands for the expression."""
        self.scope.missing(offset, name, message)
        return error_value(self.pos(offset))

    def note_loop(self, loop: Loop) -> None:
        """Notes a loop, to be looked at when all bodies are checked: whether it ends."""
        if self.scope.pou is not None and not self.scope.library:
            self.world.loops.append((self.scope.pou, loop))

    def warning(self, offset: int, code: str, message: str) -> None:
        """Reports a warning."""
        self.scope.warning(offset, code, message)


ExprRule = Callable[[Checker, ExprNode, Type | None], Expr]
StmtRule = Callable[[Checker, StmtNode], list[Statement]]

EXPRESSION_RULES: dict[type, ExprRule[Any]] = {}
STATEMENT_RULES: dict[type, StmtRule[Any]] = {}


def checks(kind: type[ExprNode]) -> Callable[[ExprRule[ExprNode]], ExprRule[ExprNode]]:
    """Makes a function the rule for a kind of expression."""

    def register(rule: ExprRule[ExprNode]) -> ExprRule[ExprNode]:
        EXPRESSION_RULES[kind] = rule
        return rule

    return register


def checks_statement(kind: type[StmtNode]) -> Callable[[StmtRule[StmtNode]], StmtRule[StmtNode]]:
    """Makes a function the rule for a kind of statement."""

    def register(rule: StmtRule[StmtNode]) -> StmtRule[StmtNode]:
        STATEMENT_RULES[kind] = rule
        return rule

    return register
