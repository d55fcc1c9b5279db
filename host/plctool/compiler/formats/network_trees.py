"""Networks that a system stores as trees (TwinCAT, CODESYS 2.3), written as elements of PLCopen XML.

Those are compiled by `plcopen_graph` and drawn by `plctool render`. A tree needs no places: its items run in the order
in which they are stored, each after what it needs.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import NamedTuple

from plctool.compiler.formats.plcopen_body import NotTranslatedError
from plctool.compiler.formats.text import Chunk, Place
from plctool.compiler.formats.xml_tree import Element
from plctool.records import dataclass

_GATES = frozenset(("AND", "OR"))


@dataclass(frozen=True)
class Rail:
    """The left power rail."""

    at: Place


@dataclass(frozen=True)
class Operand:
    """A variable or literal."""

    text: str
    at: Place
    negated: bool = False
    edge: str = ""


class Output(NamedTuple):
    """An output of a box, the variable that it goes to, and its type; "" for none or an unknown one."""

    name: str
    target: str = ""
    type: str = ""


@dataclass(frozen=True)
class Box:
    """A call. `inputs`: name and value, None for an open input; EN is one of them. `outputs`: the first is the one that
    continues the line."""

    kind: str
    at: Place
    inputs: tuple[tuple[str, Tree | None], ...]
    outputs: tuple[Output, ...] = ()
    instance: str = ""
    negated: bool = False
    edge: str = ""


@dataclass(frozen=True)
class Branch:
    """What a `Definition` with this number has."""

    number: str
    at: Place


Tree = Rail | Operand | Box | Branch


@dataclass(frozen=True)
class Target:
    """Where a value goes: a variable, a label (`way` "jump") or out of the unit (`way` "return")."""

    text: str
    at: Place
    negated: bool = False
    storage: str = ""  # set, reset
    way: str = ""


@dataclass(frozen=True)
class Assignment:
    """A value and where it goes; None for a network that has nothing there."""

    value: Tree | None
    targets: tuple[Target, ...]
    at: Place


@dataclass(frozen=True)
class Definition:
    """A branch: a value that several others take."""

    number: str
    value: Tree


@dataclass(frozen=True)
class TreeNetwork:
    """A network; `label`: "" for none."""

    label: str
    at: Place
    items: tuple[Assignment | Definition | Box, ...]


@dataclass(frozen=True)
class _Wire:
    """An output of an element."""

    local_id: str
    formal: str = ""


@dataclass
class Elements:
    """Builds a body of PLCopen XML. `contacts`: AND and OR of a ladder become contacts, as they are drawn; they are
    compiled as functions, so that several coils get the value of the same moment. An element has the same local id in
    both, and the number of its network. `first`: the first local id."""

    tag: str
    at: Place
    contacts: bool = False
    first: int = 1
    _root: Element = field(init=False)
    _count: int = 0
    _networks: int = 0
    _rail: _Wire | None = None
    _branches: dict[str, list[_Wire]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._root = Element(self.tag, {}, self.at)

    @property
    def body(self) -> Element:
        """The body."""
        return self._root

    @property
    def next_id(self) -> int:
        """The next local id."""
        return self.first + self._count

    def add(self, network: TreeNetwork) -> None:
        """Adds a network. Raises NotTranslatedError."""
        self._branches = {}
        self._networks += 1
        if network.label:
            self._element("label", network.at, {"label": network.label})
        for item in network.items:
            if isinstance(item, Box):
                self._box(item)
                self._root.children[-1].attributes["computed"] = "here"
            elif isinstance(item, Definition):
                self._branches[item.number] = self._wires(_once(item.value))
                self._root.children[-1].attributes["computed"] = "here"
            else:
                self._assign(item)

    def _assign(self, item: Assignment) -> None:
        value = item.value
        if value is None:
            raise NotTranslatedError(item.at, "a part of it is connected to nothing")
        special = any(t.negated or t.storage for t in item.targets)
        if len(item.targets) > 1 and (special or (isinstance(value, Operand) and (value.negated or value.edge))):
            value = _once(value)
        wires = self._plain(value) if value is not item.value else self._wires(value)
        for target in item.targets:
            self._target(target, wires)

    def _target(self, target: Target, wires: list[_Wire]) -> None:
        attributes = {"negated": "true"} if target.negated else {}
        if target.storage:
            attributes["storage"] = target.storage
        point = _point(target.at, wires)
        if target.way:
            label = {"label": target.text} if target.way == "jump" else {}
            self._element(target.way, target.at, attributes | label, [point])
        elif self.tag == "LD":
            self._element("coil", target.at, attributes, [point, _text("variable", target.text, target.at)])
        else:
            self._element("outVariable", target.at, attributes, [point, _text("expression", target.text, target.at)])

    # ---- values ----

    def _wires(self, tree: Tree) -> list[_Wire]:
        """What a value comes from; several wires are parallel."""
        if self.contacts and self._is_ladder(tree):
            return self._contacts(tree, [])
        return self._plain(tree)

    def _plain(self, tree: Tree) -> list[_Wire]:
        if isinstance(tree, Rail):
            return [self._left_rail(tree.at)]
        if isinstance(tree, Branch):
            if tree.number not in self._branches:
                raise NotTranslatedError(tree.at, f"branch {tree.number} is used before it has a value")
            return self._branches[tree.number]
        if isinstance(tree, Box):
            return [self._box(tree)]
        return [self._element("inVariable", tree.at, _modifiers(tree), [_text("expression", tree.text, tree.at)])]

    def _left_rail(self, at: Place) -> _Wire:
        if self._rail is None:
            self._rail = _Wire("0")
            self._root.children.insert(0, Element("leftPowerRail", {"localId": "0"}, at))
        return self._rail

    def _box(self, box: Box) -> _Wire:
        inputs, outputs = Element("inputVariables", {}, box.at), Element("outputVariables", {}, box.at)
        for name, value in box.inputs:
            points = [] if value is None else [_point(box.at, self._wires(value))]
            inputs.children.append(Element("variable", {"formalParameter": name}, box.at, points))
        for number, output in enumerate(box.outputs):
            attributes = {"formalParameter": output.name, "type": output.type}
            attributes |= _modifiers(box) if number == 0 else {}
            point = Element("connectionPointOut", {}, box.at)
            if output.target:
                point.children.append(_text("expression", output.target, box.at))
            outputs.children.append(Element("variable", attributes, box.at, [point]))
        attributes = {"typeName": box.kind, "instanceName": box.instance}
        made = self._element("block", box.at, {k: v for k, v in attributes.items() if v}, [inputs, outputs])
        return replace(made, formal=box.outputs[0].name if box.outputs else "")

    # ---- contacts ----

    def _is_ladder(self, tree: Tree, *, first: bool = True) -> bool:
        """True if a tree can be drawn as contacts that follow each other or are parallel."""
        if isinstance(tree, Operand):
            return True
        if isinstance(tree, Box) and tree.kind in _GATES and not (tree.negated or tree.edge):
            values = [value for _, value in tree.inputs]
            return all(
                v is not None and self._is_ladder(v, first=first and (tree.kind == "OR" or not number))
                for number, v in enumerate(values)
            )
        return first and not (isinstance(tree, Box) and tree.kind in _GATES)

    def _contacts(self, tree: Tree, sources: list[_Wire]) -> list[_Wire]:
        if isinstance(tree, Operand):
            point = _point(tree.at, sources or [self._left_rail(tree.at)])
            return [self._element("contact", tree.at, _modifiers(tree), [point, _text("variable", tree.text, tree.at)])]
        if not isinstance(tree, Box) or tree.kind not in _GATES:
            return self._plain(tree)
        values = [value for _, value in tree.inputs if value is not None]
        if tree.kind == "OR":
            found = [wire for value in values for wire in self._contacts(value, sources)]
        else:
            found = sources
            for value in values:
                found = self._contacts(value, found)
        self._count += 1  # the local id of its function
        return found

    def _element(self, tag: str, at: Place, attributes: dict[str, str], children: list[Element] | None = None) -> _Wire:
        local_id = str(self.next_id)
        self._count += 1
        own = {"localId": local_id, "network": str(self._networks)}
        self._root.children.append(Element(tag, own | attributes, at, children or []))
        return _Wire(local_id)


def _once(tree: Tree) -> Tree:
    """A value that is computed once, whatever happens to its variables afterwards."""
    if not isinstance(tree, Operand):
        return tree
    return Box("MOVE", tree.at, (("IN", tree),), (Output("OUT"),))


def _modifiers(tree: Operand | Box) -> dict[str, str]:
    if tree.negated and tree.edge:
        raise NotTranslatedError(tree.at, "it has an edge of a negated value; write the negation before it")
    return ({"negated": "true"} if tree.negated else {}) | ({"edge": tree.edge} if tree.edge else {})


def _point(at: Place, wires: list[_Wire]) -> Element:
    made = [{"refLocalId": w.local_id} | ({"formalParameter": w.formal} if w.formal else {}) for w in wires]
    return Element("connectionPointIn", {}, at, [Element("connection", attributes, at) for attributes in made])


def _text(tag: str, text: str, at: Place) -> Element:
    return Element(tag, {}, at, [], [Chunk(text, at.line, at.column)])
