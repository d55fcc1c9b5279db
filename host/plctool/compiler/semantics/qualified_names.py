"""Names with dots: what is in a namespace, in a list of globals, in an instance of a program.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.diagnostics import did_you_mean
from plctool.compiler.semantics.conversions import error_value
from plctool.compiler.semantics.expressions import Expressions, describe
from plctool.compiler.semantics.symbols import GlobalSymbol, Namespace, ProgramInfo, TypeSymbol, VarSymbol
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Expr

_LONGEST = 16  # parts of a name behind its first; more are members of members


class QualifiedNames(Expressions):
    """Finds what such names stand for."""

    def qualified(self, node: ast.Member) -> Expr | None:
        """A global, or the value of an enumeration, in a namespace; None when `node` names none."""
        name = self.dotted(node)
        if name is None:
            return None
        program = self.space_of(node.base)
        if program is not None:
            return self._namespace_member(program, node)
        symbol = self.scope.lookup(name)
        if isinstance(symbol, GlobalSymbol):
            if not self.scope.may_use(symbol, name, node.name_pos):
                return error_value(self.pos(node.pos))
            return self.variable(self.world.declarations.global_variable(symbol), self.pos(node.pos))
        if symbol is not None:
            return self.error(node.pos, "name", f"{name} is {describe(symbol)}, not a value")
        space, _, value = name.rpartition(".")
        owner = self.scope.lookup(space)
        if isinstance(owner, TypeSymbol):
            return self.expr(ast.EnumValue(node.pos, space, value))
        if owner is None and space.casefold() in self.world.namespaces and name.casefold() not in self.world.namespaces:
            hint = did_you_mean(value, self.world.names_in(space))
            return self.error(node.name_pos, "unknown", f"the namespace {space} has no {value}{hint}")
        return None

    def space_of(self, node: ast.Expr) -> Namespace | None:
        """The list of globals or the program instance an expression names, perhaps in a namespace."""
        name = node.name if isinstance(node, ast.Name) else self.dotted(node)
        symbol = None if name is None else self.scope.lookup(name)
        return symbol if isinstance(symbol, Namespace) else None

    def called_program(self, callee: ast.Expr) -> ProgramInfo | None:
        """The instance of a PROGRAM that a call is about."""
        space = self.space_of(callee)
        return None if space is None else space.program

    def is_namespace(self, name: str) -> bool:
        """Whether a name stands for a namespace here."""
        return name.casefold() in self.world.namespaces and self.scope.lookup(name) is None

    def dotted(self, node: ast.Expr) -> str | None:
        """`a.b.c` as a name when `a` may be a namespace or a library."""
        parts = list[str]()
        while isinstance(node, ast.Member) and len(parts) < _LONGEST:
            parts.append(node.name)
            node = node.base
        if not isinstance(node, ast.Name) or not parts or isinstance(self.scope.lookup(node.name), VarSymbol):
            return None
        return ".".join([node.name, *reversed(parts)])
