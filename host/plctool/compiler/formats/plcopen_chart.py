"""PLCopen XML: Sequential Function Charts, written as steps, transitions and actions.

A step of CODESYS may have actions of its own: one when it is entered, one while it is active, without a final scan, and
one when it is left. Each is called by an action made for it, in the order in which CODESYS calls them.

Blocks that are drawn beside a chart are executed in every cycle, by an action that the first step starts, as OpenPLC
Editor and Beremiz do.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from plctool.compiler.formats.plcopen_body import Body, NotTranslatedError, Unit, Written
from plctool.compiler.formats.plcopen_graph import Network
from plctool.compiler.formats.text import Chunk, Place
from plctool.compiler.formats.units import tokens_of
from plctool.compiler.formats.xml_tree import Element

_BRANCHES = ("selectionDivergence", "selectionConvergence", "simultaneousDivergence", "simultaneousConvergence")
_COMPUTE = "COMPUTE_FUNCTION_BLOCKS"


class _StepAction(NamedTuple):
    """An action of a step in CODESYS: the qualifier and the statement with which it is called here."""

    kind: str
    qualifier: str
    call: str


_STEP_ACTIONS = {
    "a2621e18-7de3-4ea6-ae6d-89e9e0b7befd": _StepAction("exit", "P0", "{action}();"),
    "a6b08bd8-b696-47e3-9cbf-7408b61c9ff8": _StepAction("entry", "P1", "{action}();"),
    "700a583f-b4d4-43e4-8c14-629c7cd3bec8": _StepAction("main", "N", "IF {step}.X THEN {action}(); END_IF;"),
}
"""By the identifier of the attribute that names the action; in the order of their calls in a cycle."""


class Chart:
    """One chart. `statements`: makes a body of the one in an inline action."""

    def __init__(self, element: Element, unit: Unit, body: Body) -> None:
        self._unit = unit
        self._body = body
        self._elements = {e.get("localId"): e for e in element.children if e.get("localId")}
        self._root = element
        self._following: dict[str, list[Element]] = {}
        for e in element.children:
            for connection in _connections(e):
                self._following.setdefault(connection, []).append(e)
        blocks = Body()
        self._network = Network(element, unit, blocks)
        self._blocks = blocks

    def translate(self) -> None:
        """Adds steps, transitions and actions. Raises NotTranslatedError."""
        for macro in self._root.all("macroStep"):
            raise NotTranslatedError(macro.at, "it has a macro step")
        self._network.translate()
        transitions = sorted(self._root.all("transition"), key=_column)
        conditions = [self._condition(t) for t in transitions]
        self._body.variables |= self._blocks.variables
        computes = bool(self._blocks.parts)
        if computes:
            self._body.actions.append((_COMPUTE, Body(self._blocks.parts), self._root.at))
        steps = self._root.all("step")
        own = self._step_actions(steps)
        for step in steps:
            self._step(step, own.get(step.get("name"), []), computes=computes)
        for transition, condition in zip(transitions, conditions, strict=True):
            self._transition(transition, condition)

    def _step_actions(self, steps: list[Element]) -> dict[str, list[str]]:
        """Makes an action for each action of a step; returns how each step names its own, by the name of the step."""
        found: dict[str, list[str]] = {}
        for identifier, how in _STEP_ACTIONS.items():
            for step in steps:
                action = _attribute(step, identifier)
                if not action:
                    continue
                name, made = step.get("name"), Body()
                made.line(how.call.format(step=name, action=action), step.at)
                self._body.actions.append((f"{name}_{how.kind}_action", made, step.at))
                found.setdefault(name, []).append(f"{name}_{how.kind}_action({how.qualifier});")
        return found

    def _step(self, step: Element, own: list[str], *, computes: bool) -> None:
        self._check_actions(step)
        name = step.get("name")
        initial = step.get("initialStep") == "true"
        self._body.line(f"{'INITIAL_STEP' if initial else 'STEP'} {name}:", step.at)
        for block in self._root.all("actionBlock"):
            if step.get("localId") in _connections(block):
                for action in block.all("action"):
                    self._action(action, name)
        for association in own:
            self._body.line(f"    {association}", step.at)
        if initial and computes:
            self._body.line(f"    {_COMPUTE}(S);", step.at)
        self._body.line("END_STEP", step.at)

    def _check_actions(self, step: Element) -> None:
        """Refuses an attribute of an unknown kind that names an action."""
        for attribute in step.every("attribute"):
            known = attribute.get("guid").lower() in _STEP_ACTIONS
            if not known and attribute.text.casefold() in self._unit.actions - {step.get("name").casefold()}:
                what = f"the step {step.get('name')} has an action of CODESYS, {attribute.text}"
                raise NotTranslatedError(step.at, f"{what}; use an action block")

    def _action(self, action: Element, step: str) -> None:
        reference, inline = action.child("reference"), action.child("inline", "ST")
        if reference is not None:
            name = reference.get("name")
        elif inline is not None:
            name = f"{step}_inline{len(self._body.actions)}"
            self._body.actions.append((name, Body(list(inline.every_chunk())), action.at))
        else:
            raise NotTranslatedError(action.at, f"an action of the step {step} is drawn inside the chart")
        qualifier = action.get("qualifier", "N") or "N"
        duration = f", {action.get('duration')}" if action.get("duration") else ""
        indicator = f", {action.get('indicator')}" if action.get("indicator") else ""
        self._body.line(f"    {name}({qualifier}{duration}{indicator});", action.at)

    # ---- transitions ----

    def _transition(self, transition: Element, condition: list[Chunk | tuple[str, Place]]) -> None:
        sources = list(dict.fromkeys(self._steps_before(transition)))
        targets = list(dict.fromkeys(self._steps_behind(transition)))
        if not sources or not targets:
            raise NotTranslatedError(transition.at, "a transition has no step before or after it")
        priority = transition.get("priority")
        order = f" (PRIORITY := {priority})" if priority.isdecimal() and priority != "0" else ""
        head = f"TRANSITION{order} FROM {_listed(sources)} TO {_listed(targets)} := "
        self._body.parts.append((head, transition.at))
        self._body.parts += condition
        self._body.line("\n;\nEND_TRANSITION", transition.at)  # the condition may end with a comment

    def _condition(self, transition: Element) -> list[Chunk | tuple[str, Place]]:
        condition = transition.child("condition")
        if condition is None:
            raise NotTranslatedError(transition.at, "a transition has no condition")
        negated = "true" in (condition.get("negated"), *(c.get("negated") for c in condition.children))
        reference, inline = condition.child("reference"), condition.child("inline")
        body = self._unit.transitions.get(reference.get("name").casefold()) if reference is not None else inline
        text = next(iter(body.every("ST")), None) if body is not None else None
        if text is not None:
            found = expression(text)
        elif body is not None:
            value = self._drawn(body, transition.get("name") if reference is None else reference.get("name"))
            found = [*Written.of(body.at, value).parts]
        elif reference is not None:
            found = [(reference.get("name"), reference.at)]
        else:
            power = self._network.point(condition.child("connectionPointIn"))
            found = [] if power is None else [*Written.of(transition.at, power).parts]
        if not found:
            raise NotTranslatedError(transition.at, "a transition has no condition")
        return [("NOT (", transition.at), *found, ("\n)", transition.at)] if negated else found

    def _drawn(self, body: Element, name: str) -> str:
        """Returns a condition in LD or FBD as an expression."""
        drawn = next(body.every("LD", "FBD"), None)
        if drawn is None:
            raise NotTranslatedError(body.at, "a condition is written in a language other than ST, LD and FBD")
        return Network(drawn, self._unit, Body(), inline=True).expression(name)

    def _steps_before(self, element: Element, depth: int = 0) -> Iterator[str]:
        for ref in _connections(element):
            before = self._elements.get(ref)
            if before is not None and before.tag == "step":
                yield before.get("name")
            elif before is not None and before.tag in _BRANCHES and depth < len(self._elements):
                yield from self._steps_before(before, depth + 1)

    def _steps_behind(self, element: Element, depth: int = 0) -> Iterator[str]:
        for behind in self._following.get(element.get("localId"), []):
            if behind.tag == "step":
                yield behind.get("name")
            elif behind.tag == "jumpStep":
                yield behind.get("targetName")
            elif behind.tag in _BRANCHES and depth < len(self._elements):
                yield from self._steps_behind(behind, depth + 1)


def expression(text: Element) -> list[Chunk | tuple[str, Place]]:
    """The condition in a body of Structured Text: `x`, `:= x` or `:= x;`, with comments before and after it."""
    chunks = text.every_chunk()
    *tokens, _ = tokens_of("".join(chunk.text for chunk in chunks))
    signs = {t.pos: t.end for t in tokens[:1] if t.text == ":="} | {t.pos: t.end for t in tokens[-1:] if t.text == ";"}
    found, at = [], 0
    for chunk in chunks:
        kept = chunk.text
        for begin, end in signs.items():
            first, last = (min(max(offset - at, 0), len(kept)) for offset in (begin, end))
            kept = kept[:first] + " " * (last - first) + kept[last:]
        found.append(chunk._replace(text=kept))
        at += len(kept)
    return [*found] if len(tokens) > len(signs) else []


def _connections(element: Element) -> list[str]:
    return [c.get("refLocalId") for point in element.all("connectionPointIn") for c in point.all("connection")]


def _attribute(step: Element, identifier: str) -> str:
    """Returns an attribute of CODESYS; "" if the step does not have it."""
    return next((a.text for a in step.every("attribute") if a.get("guid").lower() == identifier), "")


def _column(transition: Element) -> float:
    """Branches are looked at from left to right."""
    position = transition.child("position")
    try:
        return 0.0 if position is None else float(position.get("x", "0"))
    except ValueError:
        return 0.0


def _listed(steps: list[str]) -> str:
    return steps[0] if len(steps) == 1 else f"({', '.join(steps)})"
