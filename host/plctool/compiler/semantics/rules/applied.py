"""Functions that are built in, and what they are applied to.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from plctool.compiler.semantics.checker import Checker
from plctool.compiler.syntax import ast
from plctool.compiler.typed import Expr
from plctool.iec.types import Type


@dataclass(frozen=True)
class Applied:
    """A function with its checked arguments, none of which is wrong."""

    name: str
    args: list[Expr]
    node: ast.Call
    expected: Type | None


def _numbered(key: str) -> int | None:
    """IN, or IN1, IN2 ..."""
    if key == "IN":
        return 0
    return int(key[2:]) - 1 if re.fullmatch(r"IN[1-9]\d{0,2}", key) else None


@dataclass(frozen=True)
class BuiltIn:
    """What a function becomes, how many arguments it takes (`most` is None when there is no limit), and which of them
    a name in capitals stands for."""

    rule: Callable[[Checker, Applied], Expr]
    least: int
    most: int | None = None
    index_of: Callable[[str], int | None] = _numbered

    def takes(self, count: int) -> bool:
        """Whether the number of arguments is right."""
        return self.least <= count and (self.most is None or count <= self.most)

    @property
    def needs(self) -> str:
        """The number of arguments in words."""
        if self.most is None:
            return f"at least {self.least} arguments"
        return "1 argument" if self.least == 1 else f"{self.least} arguments"


def named(*names: str) -> Callable[[str], int | None]:
    """The arguments have these names."""
    return lambda key: names.index(key) if key in names else None
