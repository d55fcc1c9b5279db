"""Functions that are built in, and what they are applied to.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Expr
from plctool.compiler.types import Type


@dataclass(frozen=True)
class Applied:
    """A function with its checked arguments, none of which is wrong."""

    name: str
    args: list[Expr]
    node: ast.Call
    expected: Type | None


@dataclass(frozen=True)
class BuiltIn:
    """What a function becomes, and how many arguments it takes; `most` is None when there is no limit."""

    rule: Callable[[Checker, Applied], Expr]
    least: int
    most: int | None = None

    def takes(self, count: int) -> bool:
        """Whether the number of arguments is right."""
        return self.least <= count and (self.most is None or count <= self.most)

    @property
    def needs(self) -> str:
        """The number of arguments in words."""
        if self.most is None:
            return f"at least {self.least} arguments"
        return "1 argument" if self.least == 1 else f"{self.least} arguments"
