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


@dataclass
class Body:
    """Statements, steps or both, with variables of its own."""

    parts: list[Part] = field(default_factory=list)
    variables: dict[str, tuple[str, Place]] = field(default_factory=dict)  # their types, by name
    actions: list[tuple[str, Body, Place]] = field(default_factory=list)

    def line(self, text: str, at: Place) -> None:
        """Adds what is translated."""
        self.parts.append((f"{text}\n", at))

    def write(self, text: Text) -> None:
        """Adds the statements to a source."""
        text.parts(self.parts)

    def write_variables(self, text: Text) -> None:
        """Adds the variables, also those of the actions."""
        for name, (spec, at) in self.all_variables().items():
            text.made(f"VAR {name} : {spec}; END_VAR\n", at)

    def all_variables(self) -> dict[str, tuple[str, Place]]:
        """With those of the actions."""
        found = dict(self.variables)
        for _, body, _ in self.actions:
            found |= body.all_variables()
        return found


@dataclass
class Unit:
    """What a body may have to know of its unit. `results`: whether a unit of the file has a result, by case-folded
    name; False for function blocks and programs."""

    name: str
    keeps: bool  # whether its variables live from one call to the next
    results: dict[str, bool]
    transitions: dict[str, Element] = field(default_factory=dict)  # their bodies
    actions: frozenset[str] = frozenset()  # names, case-folded
