"""Names of the elements of diagrams, by their positions in a file: messages give them beside line and column.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator

from plctool.compiler.base.source import ElementName
from plctool.compiler.formats.plcopen_graph import RAILS, networks
from plctool.compiler.formats.text import Place
from plctool.compiler.formats.xml_tree import Element

_PINS = {"inputVariables": "input", "inOutVariables": "input", "outputVariables": "output"}
_KINDS = {
    "actionBlock": "action block", "inVariable": "input", "inOutVariable": "variable", "jumpStep": "jump",
    "outVariable": "output", "selectionDivergence": "branch", "selectionConvergence": "branch",
    "simultaneousDivergence": "branch", "simultaneousConvergence": "branch",
}  # fmt: skip
NETWORK = "network"
"""The attribute with the number of the network, where the file has networks. Local ids are made up there."""


def element_names(unit: str, body: Element) -> list[ElementName]:
    """Returns where the elements of a body in LD, FBD, CFC or SFC begin, and where the body ends. `unit`: what the
    body is of."""
    found = [ElementName(*body.at, unit)]
    numbers = _numbers(body)
    for element in body.children:
        number = numbers.get(element.get("localId"), "")
        parts = [f"network {number}"] * bool(number)
        parts.append(_named(element, with_id=not element.get(NETWORK)))
        named = f"{unit}: {', '.join(parts)}"
        found.append(ElementName(*element.at, named))
        found += [ElementName(*at, f"{named}, {part}") for at, part in _inside(element)]
    found.sort(key=lambda e: (e.line, e.column))
    line, column = _end(body)
    return [*found, ElementName(line, column + 1, "")]


def _numbers(body: Element) -> dict[str, str]:
    """The numbers of networks by local id: those of the file, or from top to bottom those of elements that are
    connected. A chart has none."""
    elements = [e for e in body.children if e.get("localId")]
    if any(e.get(NETWORK) for e in elements):
        return {e.get("localId"): e.get(NETWORK) for e in elements}
    if body.tag not in ("LD", "FBD"):
        return {}
    found = [part for part in networks(elements) if any(e.tag not in RAILS | {"comment"} for e in part)]
    return {e.get("localId"): str(number) for number, part in enumerate(found, 1) for e in part}


def _named(element: Element, *, with_id: bool) -> str:
    """What an element is called: its kind, its name, and the local id if the file gives it one."""
    what = _KINDS.get(element.tag, element.tag)
    name = element.get("instanceName") or element.get("typeName") or element.get("name") or element.get("label")
    name = name or element.get("targetName") or " ".join(_text(element).split())
    name = name if len(name) < 40 else f"{name[:37]}..."
    number = f" (localId {element.get('localId')})" if with_id and element.get("localId") else ""
    return f"{what}{f' {name}' if name else ''}{number}"


def _text(element: Element) -> str:
    return next((part.text for part in element.all("variable", "expression")), "")


def _inside(element: Element) -> Iterator[tuple[Place, str]]:
    """The pins of a block, and the actions of a step."""
    for part in element.children:
        for pin in part.all("variable") if part.tag in _PINS else ():
            name = pin.get("formalParameter")
            if name:
                yield pin.at, f"{_PINS[part.tag]} {name}"
        if part.tag == "action":
            reference = part.child("reference")
            name = "" if reference is None else f" {reference.get('name')}"
            yield part.at, f"action{name}"
        elif part.tag == "condition":
            yield part.at, "condition"


def _end(body: Element) -> Place:
    """The last position that something in a body has."""
    last = body.at
    waiting = [body]
    while waiting:
        element = waiting.pop()
        waiting += element.children
        last = max(last, element.at)
        for chunk in element.chunks:
            lines = chunk.text.count("\n")
            column = len(chunk.text) - chunk.text.rfind("\n") if lines else chunk.column + len(chunk.text)
            last = max(last, Place(chunk.line + lines, column))
    return last
