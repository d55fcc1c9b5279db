"""The variables of the pins, contacts, coils and steps of a diagram, for their live values.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from plctool.compiler.formats.plcopen_graph import enable_variable, result_variable
from plctool.compiler.formats.xml_tree import Element
from plctool.debug.symbols import SymbolTable
from plctool.doc.drawn import ChartBody, Diagram
from plctool.errors import UsageError
from plctool.iec.types import ArrayType, OpenArrayType, StructType

Place = tuple[str, str]
"""Local id of an element and name of its pin, "" for its only one; of a step "" and its name."""


@dataclass(frozen=True)
class Monitor:
    """`names`: the variable of each place that has one. `values`: of each variable, as text."""

    names: Mapping[Place, str] = field(default_factory=dict)
    values: Mapping[str, str] = field(default_factory=dict)


def monitored(diagram: Diagram, instance: str, table: SymbolTable) -> dict[Place, str]:
    """Returns the variable of each place of a diagram. `instance`: the program or function block that it is of."""
    found: dict[Place, str] = {}
    for place, text in _places(diagram.body):
        name = next((name for name in (f"{instance}.{text}", text) if _has(table, name)), None)
        if name is not None:
            found[place] = name
    return found


def _has(table: SymbolTable, name: str) -> bool:
    """True if a variable has a value of its own."""
    try:
        return not isinstance(table.resolve(name).type, StructType | ArrayType | OpenArrayType)
    except UsageError:
        return False


def _places(body: Element | ChartBody) -> Iterator[tuple[Place, str]]:
    if isinstance(body, ChartBody):
        for step in body.chart.steps:
            yield ("", step.name), f"{step.name}.X"
        return
    for element in body.children:
        if element.tag == "block":
            yield from _pins(element)
        elif element.get("localId"):
            text = element.child("variable" if element.tag in ("contact", "coil") else "expression")
            if text is not None and text.text and not text.text[0].isdigit() and not text.text.startswith("%"):
                yield (element.get("localId"), ""), text.text


def _pins(block: Element) -> Iterator[tuple[Place, str]]:
    local_id, instance = block.get("localId"), block.get("instanceName")
    sides = ("inputVariables", "inOutVariables", "outputVariables")
    pins = [
        (side, v.get("formalParameter")) for side in sides for part in block.all(side) for v in part.all("variable")
    ]
    results = [name for side, name in pins if side == "outputVariables" and name.upper() != "ENO"]
    for side, name in pins:
        if name.upper() in ("EN", "ENO"):
            yield (local_id, name), enable_variable(block)
        elif instance:
            yield (local_id, name), f"{instance}.{name}"
        elif side == "outputVariables" and name == results[0]:
            yield (local_id, name), result_variable(block)
