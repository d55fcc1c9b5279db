"""Marks for the coverage of tests: every statement of the program notes that it runs.

All of it happens in the syntax tree, before anything is checked, and only for the program that runs the tests: each
statement gets one before it that sets its element of a hidden variable. A cold start clears it; so what a test has run
is read after that test.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from plctool.compiler.base.source import Source
from plctool.compiler.syntax import ast
from plctool.compiler.typed.nodes import Pos

MARKS = "__marks"
"""ARRAY OF BOOL: which statements ran."""


class StatementMarks:
    """`places`: where each marked statement begins, in the order of the elements of MARKS."""

    def __init__(self) -> None:
        self.places: list[Pos] = []

    def marked(self, declarations: Sequence[ast.Declaration]) -> list[ast.Declaration]:
        """The declarations with marks in all bodies, but those of tests. The bodies are changed."""
        return [self._unit(decl) if isinstance(decl, ast.PouDecl) else decl for decl in declarations]

    def variable(self, source: Source) -> ast.GlobalBlock:
        """The declaration of MARKS, when everything is marked."""
        last = max(0, len(self.places) - 1)
        of_bool = ast.ArraySpec(0, [(_number(0), _number(last))], ast.NamedType(0, "BOOL"))
        line = ast.VarDecl(0, [(0, MARKS)], None, of_bool, None)
        return ast.GlobalBlock(ast.VarBlock(0, ast.Section.VAR_GLOBAL, set(), [line]), source)

    def _unit(self, decl: ast.PouDecl) -> ast.PouDecl:
        self._mark(decl.body, decl.source)
        return replace(decl, members=[self._unit(member) for member in decl.members])

    def _mark(self, body: list[ast.Stmt], source: Source) -> None:
        for statement in body:
            for inner in ast.inner_bodies(statement):
                self._mark(inner, source)
        body[:] = [part for statement in body for part in self._with_mark(statement, source)]

    def _with_mark(self, statement: ast.Stmt, source: Source) -> list[ast.Stmt]:
        if isinstance(statement, ast.Label):
            return [statement]
        pos = statement.targets[0].pos if isinstance(statement, ast.Assign) else statement.pos
        element = ast.Index(pos, ast.Name(pos, MARKS), [_number(len(self.places))])
        self.places.append(source.pos(pos))
        true = ast.Literal(pos, ast.LiteralKind.BOOL, True)
        return [ast.Assign(pos, [element], ast.Assigning.VALUE, true), statement]


def _number(value: int) -> ast.Literal:
    return ast.Literal(0, ast.LiteralKind.INT, value)
