"""PLCopen XML out: Sequential Function Charts.

Steps stand below each other, transitions from left to right, which is the order in which they are looked at. What leads
back to a step that stands above is a jump.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from plctool.compiler.plcopen_export.declarations import Declarations
from plctool.compiler.plcopen_export.elements import Xml, child, documentation, text_in
from plctool.compiler.plcopen_export.outline import Part, closed
from plctool.compiler.syntax.lexer import Token

_ROW, _COLUMN = 80, 120  # distances
NoPlace = Callable[[int, str, str], None]  # offset, what the standard has not, what to write otherwise


@dataclass
class _Transition:
    part: Part
    priority: str
    sources: list[str]
    targets: list[str]
    condition: list[Token]
    id: str = ""


class ChartWriter:
    """Writes one chart. `no_place`: takes what the standard has no place for."""

    def __init__(self, parent: Xml, parts: list[Part], declarations: Declarations, no_place: NoPlace) -> None:
        self._sfc = child(parent, "SFC")
        self._declarations = declarations
        self._slice = declarations.slice
        self._no_place = no_place
        self._next = 0
        self._steps = [part for part in parts if part.kind != "TRANSITION"]
        self._transitions = [self._read(part) for part in parts if part.kind == "TRANSITION"]
        self._rows = {part.name.casefold(): row for row, part in enumerate(self._steps)}
        self._ids = {name: self._id() for name in self._rows}

    def write(self) -> None:
        """All of it."""
        for transition in self._transitions:
            transition.id = self._id()
        into: dict[str, list[str]] = {}  # what leads to a step, by its name
        jumps: list[tuple[str, str]] = []
        divergences: list[tuple[str, str]] = []
        for transition in self._transitions:
            source = transition.id
            if len(transition.targets) > 1:
                source = self._id()
                divergences.append((source, transition.id))
            above = max(self._rows[s] for s in transition.sources)
            # Jumps come after all steps, so what leads to several has either steps or jumps: their order matters.
            down = all(self._rows[t] > above for t in transition.targets)
            down = down and transition.targets == sorted(transition.targets, key=self._rows.__getitem__)
            for target in transition.targets:
                if down:
                    into.setdefault(target, []).append(source)
                else:
                    jumps.append((target, source))
        for part in self._steps:
            self._step(part, into.get(part.name.casefold(), []))
        outgoing: dict[str, str] = {}
        for name, step in self._ids.items():
            leaving = [t for t in self._transitions if name in t.sources]
            outgoing[name] = self._selection(step, name) if len(leaving) > 1 else step
        for column, transition in enumerate(self._transitions):
            self._transition(transition, column, outgoing)
        for number, source in divergences:
            self._connected("simultaneousDivergence", number, [source])
        for target, source in jumps:
            jump = self._connected("jumpStep", self._id(), [source])
            jump.set("targetName", self._steps[self._rows[target]].name)

    # ---- steps ----

    def _step(self, part: Part, before: list[str]) -> None:
        name = part.name
        row = self._rows[name.casefold()]
        if len(before) > 1:
            before = [self._connected("selectionConvergence", self._id(), before).get("localId", "")]
        step = self._connected("step", self._ids[name.casefold()], before, y=row * _ROW)
        step.set("name", name)
        if part.kind == "INITIAL_STEP":
            step.set("initialStep", "true")
        child(child(step, "connectionPointOut", formalParameter="sfc"), "relPosition", x="0", y="0")
        at = next(i for i, t in enumerate(part.tokens) if t.type == "IDENT") + 1
        at += part.tokens[at].type == "_COLON"
        tokens = part.tokens[at:-1]
        if tokens:
            child(step, "connectionPointOutAction", formalParameter="")
            block = self._connected("actionBlock", self._id(), [self._ids[name.casefold()]], _COLUMN, row * _ROW)
            start = 0
            for index, token in enumerate(tokens):
                if token.type == "_SEMI":
                    self._action(block, tokens[start:index])
                    start = index + 1
        documentation(step, comment_text(part.gap))

    def _action(self, block: Xml, tokens: list[Token]) -> None:
        if not tokens:
            return
        opening = next((i for i, t in enumerate(tokens) if t.type == "_LPAR"), len(tokens))
        name, inside = self._slice(tokens[:opening]), tokens[opening + 1 : -1]
        arguments = [self._slice(part) for part in _arguments(inside)]
        qualifier, rest = (arguments[0].upper() if arguments else "N"), arguments[1:]
        more = {"qualifier": qualifier}
        if rest and qualifier in ("L", "D", "SD", "DS", "SL"):
            more["duration"] = rest.pop(0)
        if len(rest) > 1:
            self._no_place(tokens[0].pos, f"second indicator of an action, as {name} has it", "give it one")
        if rest:
            more["indicator"] = rest[0]
        action = child(block, "action", localId=self._id(), **more)
        child(action, "relPosition", x="0", y="0")
        child(action, "reference", name=name)

    # ---- transitions ----

    def _read(self, part: Part) -> _Transition:
        tokens = part.tokens
        begin = next(i for i, t in enumerate(tokens) if t.type == "_FROM")
        to = next(i for i, t in enumerate(tokens) if t.type == "_TO")
        assign = next(i for i in range(to, len(tokens)) if tokens[i].type == "_ASSIGN")
        priority = next((t.text for t in tokens[:begin] if t.type == "NUMBER"), "")
        end = len(tokens) - 1 - (tokens[-2].type == "_SEMI")
        sources, targets = _names(tokens[begin:to]), _names(tokens[to:assign])
        return _Transition(part, priority, sources, targets, tokens[assign + 1 : end])

    def _transition(self, transition: _Transition, column: int, outgoing: dict[str, str]) -> None:
        sources = [outgoing[name] for name in transition.sources]
        row = max(self._rows[name] for name in transition.sources)
        if len(sources) > 1:
            sources = [self._connected("simultaneousConvergence", self._id(), sources, y=row * _ROW).get("localId", "")]
        written = self._connected("transition", transition.id, sources, column * _COLUMN, row * _ROW + _ROW // 2)
        if transition.priority:
            written.set("priority", transition.priority)
        inline = child(child(written, "condition"), "inline", name="")
        text_in(child(inline, "ST"), self._declarations.written(transition.condition))
        documentation(written, comment_text(transition.part.gap))

    def _selection(self, step: str, name: str) -> str:
        y = self._rows[name] * _ROW
        return self._connected("selectionDivergence", self._id(), [step], y=y).get("localId", "")

    # ---- elements ----

    def _id(self) -> str:
        self._next += 1
        return str(self._next)

    def _connected(self, tag: str, number: str, sources: list[str], x: int = 0, y: int = 0) -> Xml:
        element = child(self._sfc, tag, localId=number)
        child(element, "position", x=str(x), y=str(y))
        several = tag in ("selectionConvergence", "simultaneousConvergence")
        for group in [[source] for source in sources] if several else [sources] * bool(sources):
            point = child(element, "connectionPointIn")
            for source in group:
                child(point, "connection", refLocalId=source)
        return element


def _names(tokens: list[Token]) -> list[str]:
    return [token.text.casefold() for token in tokens if token.type == "IDENT"]


def _arguments(tokens: list[Token]) -> list[list[Token]]:
    found: list[list[Token]] = [[]]
    at = 0
    while at < len(tokens):
        if tokens[at].type == "_COMMA":
            found.append([])
            at += 1
            continue
        end = closed(tokens, at) + 1
        found[-1] += tokens[at:end]
        at = end
    return [argument for argument in found if argument]


def comment_text(gap: str) -> str:
    """What the comments in a text between two parts say, with their marks."""
    return gap.strip()
