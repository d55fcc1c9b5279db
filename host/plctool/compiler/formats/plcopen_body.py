"""What bodies are made of when they are translated: lines and the variables they need.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import dataclass, field

from plctool.compiler.formats.text import Part, Place, Text
from plctool.compiler.formats.xml_tree import Element


class NotTranslatedError(Exception):
    """A diagram has no translation; `at` is the part of it that has none, `needs` as in Finding."""

    def __init__(self, at: Place, why: str, needs: str = "") -> None:
        super().__init__(why)
        self.at = at
        self.needs = needs


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
    """What a body may have to know of its unit. `types`: of variables, as far as known, by case-folded name. `blocks`:
    of outputs of the function blocks and functions of the file ("" is the result), and of members of its structures."""

    name: str
    keeps: bool  # whether its variables live from one call to the next
    types: dict[str, str]
    blocks: dict[str, dict[str, str]]
    transitions: dict[str, Element] = field(default_factory=dict)  # their bodies
    actions: frozenset[str] = frozenset()  # names, case-folded
