"""The labels of a body and where they stand: a JMP goes on in the statements it is in, or in those around them.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from plctool.compiler.syntax import ast


@dataclass(frozen=True)
class Place:
    """A label, the statements it is one of, and the statement those are in; None for those of the body itself."""

    label: ast.Label
    among: list[ast.Stmt]
    inside: ast.Stmt | None


class Labels:
    """The labels of one body, by name in any case of its letters. `repeated`: each with the first of that name."""

    def __init__(self, body: list[ast.Stmt]) -> None:
        self.repeated: list[tuple[ast.Label, ast.Label]] = []
        self._places: dict[str, Place] = {}
        self._targets: set[str] = set()
        self._values: set[str] = set()
        todo: list[tuple[list[ast.Stmt], ast.Stmt | None]] = [(body, None)]
        while todo:
            among, inside = todo.pop()
            for statement in among:
                if isinstance(statement, ast.Label):
                    self._add(Place(statement, among, inside))
                elif isinstance(statement, ast.Jump):
                    self._targets.add(statement.name.casefold())
                else:
                    if isinstance(statement, ast.Case):
                        self._values |= set(_named_values(statement))
                    todo += [(inner, statement) for inner in ast.inner_bodies(statement)]

    def _add(self, place: Place) -> None:
        key = place.label.name.casefold()
        other = self._places.get(key)
        if other is None:
            self._places[key] = place
            return
        first, second = sorted((other, place), key=lambda p: p.label.pos)
        self._places[key] = first
        self.repeated.append((second.label, first.label))

    def find(self, name: str) -> Place | None:
        """Where a label stands."""
        return self._places.get(name.casefold())

    def names(self) -> Iterable[str]:
        """All of them, as written."""
        return [place.label.name for place in self._places.values()]

    def is_target(self, node: ast.Stmt) -> bool:
        """Whether it is a label that a JMP names."""
        return isinstance(node, ast.Label) and node.name.casefold() in self._targets

    def is_value(self, name: str) -> bool:
        """Whether a branch of a CASE is for a value of that name."""
        return name.casefold() in self._values


def _named_values(case: ast.Case) -> Iterable[str]:
    for labels, _ in case.branches:
        yield from (label.low.name.casefold() for label in labels if isinstance(label.low, ast.Name))
