"""What bodies are made of when they are translated: lines and the variables they need.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import field

from plctool.compiler.formats.text import Part, Place, Text
from plctool.compiler.formats.xml_tree import Element
from plctool.records import dataclass


class NotTranslatedError(Exception):
    """A diagram has no translation; `at` is the part of it that has none."""

    def __init__(self, at: Place, why: str) -> None:
        super().__init__(why)
        self.at = at


class Written(str):
    """Text of which each part stands for something of its own in the file; `parts` are in order. What is put together
    of it by other means is text without places."""

    __slots__ = ("parts",)
    parts: tuple[tuple[str, Place], ...]

    @staticmethod
    def of(at: Place, *pieces: str) -> Written:
        """Puts pieces together; those without places of their own stand for what is at `at`."""
        parts = [part for piece in pieces for part in (piece.parts if isinstance(piece, Written) else [(piece, at)])]
        made = Written("".join(text for text, _ in parts))
        made.parts = tuple(parts)
        return made


@dataclass
class Body:
    """Statements, steps or both, with variables of its own."""

    parts: list[Part] = field(default_factory=list)
    variables: dict[str, tuple[str, Place]] = field(default_factory=dict)  # their types, by name
    actions: list[tuple[str, Body, Place]] = field(default_factory=list)

    def line(self, text: str, at: Place) -> None:
        """Adds what is translated."""
        self.parts += Written.of(at, text, "\n").parts

    def write(self, text: Text) -> None:
        """Adds the statements to a source."""
        text.parts(self.parts)

    def write_variables(self, text: Text) -> None:
        """Adds the variables, also those of the actions."""
        for name, (spec, at) in self.all_variables().items():
            text.parts(declared(name, spec, at))

    def all_variables(self) -> dict[str, tuple[str, Place]]:
        """With those of the actions."""
        found = dict(self.variables)
        for _, body, _ in self.actions:
            found |= body.all_variables()
        return found


def declared(name: str, spec: str, at: Place) -> tuple[Part, ...]:
    """Returns the declaration of a variable that a body needs."""
    return Written.of(at, f"VAR {name} : ", spec, "; END_VAR\n").parts


@dataclass
class Unit:
    """What a body may have to know of its unit. `results`: whether a unit of the file has a result, by case-folded
    name; False for function blocks and programs."""

    name: str
    keeps: bool  # whether its variables live from one call to the next
    results: dict[str, bool]
    transitions: dict[str, Element] = field(default_factory=dict)  # their bodies
    actions: frozenset[str] = frozenset()  # names, case-folded
