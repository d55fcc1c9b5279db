"""Diagrams as SVG. Networks of LD, FBD and CFC: values flow from left to right, networks stand below each other.

The places in the file are not used: exports of CODESYS and TwinCAT have none.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from html import escape

from plctool.compiler.formats.plcopen_graph import RAILS, networks
from plctool.compiler.formats.xml_tree import Element
from plctool.doc.chart import ChartPicture
from plctool.doc.diagram import text_at, width_of
from plctool.doc.drawn import ChartBody, Diagram
from plctool.doc.monitor import Monitor
from plctool.errors import UsageError

_ROW = 20  # pixels
_GAP = 50  # between columns, for lines
_BELOW = 16  # under an element
_RAIL = 12  # from the left
_SYMBOL = 24  # width of a contact or coil
_OUTSIDE = ("inVariable", "outVariable", "inOutVariable", "label", "jump", "return", "connector", "continuation")
_DRAWN = (*_OUTSIDE, "contact", "coil", "block")
_LETTERS = {"set": "S", "reset": "R", "rising": "P", "falling": "N"}


@dataclass
class _Pin:
    """An input or output: its name, whether it is negated, the variable to which an output goes, and what an input is
    connected to: local id and output."""

    name: str
    negated: bool
    target: str = ""
    sources: list[tuple[str, str]] = field(default_factory=list)


@dataclass
class _Node:
    """An element with its place."""

    element: Element
    inputs: list[_Pin]
    outputs: list[_Pin]
    column: int = 0
    x: float = 0
    y: float = 0

    @property
    def tag(self) -> str:
        return self.element.tag

    @property
    def is_block(self) -> bool:
        return self.tag == "block"

    @property
    def text(self) -> str:
        """What stands in or above the element."""
        if self.is_block:
            return self.element.get("typeName")
        if self.tag in ("label", "jump"):
            name = self.element.get("label")
            return f"{name}:" if self.tag == "label" else f"\N{RIGHTWARDS DOUBLE ARROW} {name}"
        if self.tag in ("connector", "continuation"):
            return self.element.get("name")
        child = self.element.child("variable" if self.tag in ("contact", "coil") else "expression")
        return "RETURN" if self.tag == "return" else "" if child is None else child.text

    @property
    def width(self) -> float:
        if self.is_block:
            pins = (max((width_of(p.name) for p in side), default=0) for side in (self.inputs, self.outputs))
            return max(sum(pins) + 30, width_of(self.text) + 16, width_of(self.element.get("instanceName")))
        return max(width_of(self.text), _SYMBOL)

    @property
    def after(self) -> float:
        """The width of the variables to which its outputs go."""
        return max((width_of(pin.target) + 10 for pin in self.outputs if pin.target), default=0)

    @property
    def height(self) -> float:
        rows = max(len(self.inputs), len(self.outputs)) + 2 if self.is_block else 2
        return rows * _ROW

    def pin_y(self, row: int) -> float:
        """Where a pin is; those of a block are below its instance and its type."""
        return self.y + (row + 2.5 if self.is_block else 1.5) * _ROW


def picture(name: str, diagram: Diagram, monitor: Monitor | None = None) -> str:
    """Returns the picture of a diagram. `name`: its label for screen readers. `monitor`: the values that it shows.
    Raises UsageError if it is nested too deeply."""
    try:
        return _picture(name, diagram.body, monitor or Monitor())
    except RecursionError:
        raise UsageError(f"{name} is nested too deeply to be drawn; cut it into networks.", "no-diagram") from None


def _picture(name: str, body: Element | ChartBody, monitor: Monitor) -> str:
    if isinstance(body, ChartBody):
        chart = ChartPicture(body, monitor)
        return _svg(name, list(chart.parts()), chart.width, chart.height)
    parts: list[str] = []
    top = width = 10.0
    for network in networks([e for e in body.children if e.get("localId")]):
        drawing = _Network(network, top, monitor)
        if drawing.nodes:
            parts += drawing.parts()
            top, width = drawing.bottom + _BELOW, max(width, drawing.right)
    return _svg(name, parts, width, top)


def _svg(name: str, parts: list[str], width: float, height: float) -> str:
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="diagram" width="{width + 20:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width + 20:.0f} {height:.0f}" role="img" aria-label="{escape(name, quote=True)}" '
        'font-family="monospace" font-size="12" fill="currentColor" stroke="none">'
    )
    return "\n".join([head, *parts, "</svg>\n"])


def _node(element: Element) -> _Node:
    if element.tag == "block":
        inputs = [_pin(v) for which in ("inputVariables", "inOutVariables") for v in _variables(element, which)]
        return _Node(element, inputs, [_pin(v) for v in _variables(element, "outputVariables")])
    return _Node(element, [_pin(element)], [_Pin("", negated=False)])


def _variables(block: Element, which: str) -> list[Element]:
    return [v for part in block.all(which) for v in part.all("variable")]


def _pin(element: Element) -> _Pin:
    connections = [(c.get("refLocalId"), c.get("formalParameter")) for c in element.every("connection")]
    written = element.child("connectionPointOut", "expression")
    target = "" if written is None else written.text
    return _Pin(element.get("formalParameter"), element.get("negated") == "true", target, connections)


class _Network:
    """The drawing of one network below `top`."""

    def __init__(self, elements: list[Element], top: float, monitor: Monitor) -> None:
        self._monitor = monitor
        self.nodes = {e.get("localId"): _node(e) for e in elements if e.tag in _DRAWN}
        self._rails = {e.get("localId") for e in elements if e.tag in RAILS}
        self._top = top
        self._free: dict[int, float] = {}
        for node in self.nodes.values():
            self._find_column(node, [])
        for node in self.nodes.values():
            if not self._is_read(node):
                self._place(node, top)
        for node in self.nodes.values():
            self._place(node, top)  # what only feeds itself
        self._set_columns()

    @property
    def bottom(self) -> float:
        """Where it ends."""
        return max(node.y + node.height for node in self.nodes.values())

    @property
    def right(self) -> float:
        """Where it ends."""
        return max(node.x + node.width + node.after for node in self.nodes.values())

    def _sources(self, node: _Node) -> list[_Node]:
        return [self.nodes[key] for pin in node.inputs for key, _ in pin.sources if key in self.nodes]

    def _is_read(self, node: _Node) -> bool:
        return any(source is node for other in self.nodes.values() for source in self._sources(other))

    def _find_column(self, node: _Node, before: list[_Node]) -> int:
        """The column of a node: one after those that it reads, but for itself."""
        if not node.column:
            path = [*before, node]
            sources = [s for s in self._sources(node) if not any(s is other for other in path)]
            node.column = 1 + max((self._find_column(s, path) for s in sources), default=0)
        return node.column

    def _place(self, node: _Node, y: float) -> None:
        """Gives a node its height, beside the first one that it reads."""
        if node.y:
            return
        node.y = max(y, self._free.get(node.column, self._top))
        self._free[node.column] = node.y + node.height + _BELOW
        for row, pin in enumerate(node.inputs):
            for number, (key, _) in enumerate(pin.sources):
                source = self.nodes.get(key)
                if source is not None and source.column < node.column:
                    beside = node.pin_y(row) - 1.5 * _ROW if not (row or number) or not source.is_block else node.y
                    self._place(source, beside)

    def _set_columns(self) -> None:
        x = float(_RAIL + _GAP)
        for column in sorted({node.column for node in self.nodes.values()}):
            nodes = [node for node in self.nodes.values() if node.column == column]
            width = max(node.width for node in nodes)
            for node in nodes:
                node.x = x + (width - node.width if node.tag == "inVariable" else 0)
            x += width + _GAP

    # ---- drawing ----

    def parts(self) -> Iterator[str]:
        """The lines and elements."""
        for node in self.nodes.values():
            for row, pin in enumerate(node.inputs):
                yield from self._lines(node, row, pin)
            yield from _drawn(node)
            yield from self._values(node)
        if any(self._from_rail(node) for node in self.nodes.values()):
            yield f'<path d="M{_RAIL} {self._top:.0f}V{self.bottom:.0f}" stroke="currentColor" stroke-width="3"/>'

    def _values(self, node: _Node) -> Iterator[str]:
        """The values of an element, or of the pins of a block."""
        local_id = node.element.get("localId")
        if not node.is_block:
            yield from self._value(local_id, "", node.x + node.width / 2, node.pin_y(0) + 20, "middle")
            return
        for side, x, anchor in ((node.inputs, node.x - 6, "end"), (node.outputs, node.x + node.width + 6, "start")):
            for row, pin in enumerate(side):
                yield from self._value(local_id, pin.name, x, node.pin_y(row) - 4, anchor)

    def _value(self, local_id: str, pin: str, x: float, y: float, anchor: str) -> Iterator[str]:
        name = self._monitor.names.get((local_id, pin))
        if name is not None:
            more = f'class="value" fill="#06c" font-size="10" data-variable="{escape(name, quote=True)}"'
            yield text_at(x, y, self._monitor.values.get(name, ""), anchor, more)

    def _from_rail(self, node: _Node) -> bool:
        return any(key not in self.nodes for pin in node.inputs for key, _ in pin.sources)

    def _lines(self, node: _Node, row: int, pin: _Pin) -> Iterator[str]:
        x, y = _left(node), node.pin_y(row)
        for key, formal in pin.sources:
            source = self.nodes.get(key)
            if source is None:  # the power rail
                yield f'<path d="M{_RAIL} {y:.0f}H{x:.0f}" stroke="currentColor"/>'
                continue
            rows = [number for number, out in enumerate(source.outputs) if out.name == formal]
            start, from_y = _right(source), source.pin_y(rows[0] if rows else 0)
            if source.column < node.column:
                turn = x - 8 - 4 * row
                path = f"M{start:.0f} {from_y:.0f}H{turn:.0f}V{y:.0f}H{x:.0f}"
                yield f'<path d="{path}" fill="none" stroke="currentColor"/>'
            else:
                around = max(source.y + source.height, node.y + node.height) + 6
                path = f"M{start:.0f} {from_y:.0f}h10V{around:.0f}H{x - 10:.0f}V{y:.0f}H{x:.0f}"
                yield f'<path d="{path}" fill="none" stroke="currentColor" stroke-dasharray="4 2"/>'


def _left(node: _Node) -> float:
    """Where lines to an element end."""
    return node.x + (node.width - _SYMBOL) / 2 if node.tag in ("contact", "coil") else node.x - 2


def _right(node: _Node) -> float:
    """Where lines from an element begin."""
    return node.x + (node.width + _SYMBOL) / 2 if node.tag in ("contact", "coil") else node.x + node.width + 2


def _drawn(node: _Node) -> Iterator[str]:
    if node.is_block:
        yield from _block(node)
    elif node.tag in ("contact", "coil"):
        yield from _symbol(node)
    else:
        mark = "NOT " if node.element.get("negated") == "true" else ""
        yield text_at(node.x, node.pin_y(0) + 4, mark + node.text, "start", f'data-id="{node.element.get("localId")}"')


def _symbol(node: _Node) -> Iterator[str]:
    """A contact or coil: its variable above, and S, R, P, N or / in it."""
    x, y, middle = _left(node), node.pin_y(0), node.x + node.width / 2
    yield text_at(middle, y - 12, node.text, "middle", f'data-id="{node.element.get("localId")}"')
    if node.tag == "contact":
        sides = f"M{x + 6:.0f} {y - 8:.0f}v16M{x + 18:.0f} {y - 8:.0f}v16"
        ends = f"M{x:.0f} {y:.0f}h6M{x + 18:.0f} {y:.0f}h6"
    else:
        sides = f"M{x + 8:.0f} {y - 8:.0f}q-8 8 0 16M{x + 16:.0f} {y - 8:.0f}q8 8 0 16"
        ends = f"M{x:.0f} {y:.0f}h4M{x + 20:.0f} {y:.0f}h4"
    yield f'<path d="{sides}{ends}" fill="none" stroke="currentColor"/>'
    inside = _LETTERS.get(node.element.get("storage")) or _LETTERS.get(node.element.get("edge"))
    inside = inside or ("/" if node.element.get("negated") == "true" else "")
    if inside:
        yield text_at(middle, y + 4, inside, "middle")


def _block(node: _Node) -> Iterator[str]:
    top, middle = node.y + _ROW, node.x + node.width / 2
    if node.element.get("instanceName"):
        yield text_at(middle, top - 4, node.element.get("instanceName"), "middle")
    box = f'x="{node.x:.0f}" y="{top:.0f}" width="{node.width:.0f}" height="{node.height - _ROW:.0f}"'
    yield f'<rect {box} fill="none" stroke="currentColor" data-id="{node.element.get("localId")}"/>'
    yield text_at(middle, top + 14, node.text, "middle", 'font-weight="bold"')
    for side, x, anchor, inside in ((node.inputs, node.x, "start", 6), (node.outputs, node.x + node.width, "end", -6)):
        for row, pin in enumerate(side):
            yield text_at(x + inside, node.pin_y(row) + 4, pin.name, anchor)
            if pin.target:
                yield text_at(x + 6, node.pin_y(row) + 12, pin.target, "start")
            if pin.negated:
                yield f'<circle cx="{x:.0f}" cy="{node.pin_y(row):.0f}" r="3" fill="white" stroke="currentColor"/>'
