"""JMP and labels, and the loops that are made of them.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.checker import Checker, checks_statement
from plctool.compiler.semantics.labels import Place
from plctool.compiler.semantics.pitfalls import JumpLoop
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import did_you_mean
from plctool.compiler.typed.nodes import If, Jump, Label, Statement

_WORDS = {ast.If: "IF", ast.Case: "CASE", ast.For: "FOR", ast.While: "WHILE", ast.RepeatUntil: "REPEAT",
          ast.Try: "__TRY"}  # fmt: skip


def report_repeated(c: Checker) -> None:
    """Reports the labels whose name the body has already."""
    for label, first in c.labels.repeated:
        c.error(label.pos, "duplicate", f"{label.name} is a label in line {c.pos(first.pos).line} already")


@checks_statement(ast.Label)
def label_statement(c: Checker, node: ast.Label) -> list[Statement]:
    """A label; one that no JMP names is nothing."""
    if not c.labels.is_target(node):
        c.warning(node.pos, "unused", f"no JMP goes to the label {node.name}")
        return []
    return [Label(node.name.casefold(), c.pos(node.pos))]


@checks_statement(ast.Jump)
def jump_statement(c: Checker, node: ast.Jump) -> list[Statement]:
    """JMP: forward, backward and out of the statements around it, but not into others."""
    place = c.labels.find(node.name)
    if place is None:
        c.error(node.name_pos, "unknown", _not_found(c, node.name))
        return []
    if not any(among is place.among for among in c.around):
        c.error(node.name_pos, "statement", _leads_inside(c, place))
        return []
    if not any(among is place.among for among in c.around[c.last :]):
        return report_leaving(c, node.pos, f"JMP {node.name}")
    return [Jump(node.name.casefold(), c.pos(node.pos))]


def report_leaving(c: Checker, offset: int, statement: str) -> list[Statement]:
    """Reports a statement that would leave a __FINALLY."""
    c.error(offset, "statement", f"{statement} leads out of __FINALLY, which always runs to its end; write an IF in it")
    return []


def _not_found(c: Checker, name: str) -> str:
    if c.labels.is_value(name):
        return f"{name}: in a CASE is a value, not a label; put the label in front of the CASE"
    hint = did_you_mean(name, c.labels.names()) or "; a JMP does not leave its body, METHOD or ACTION"
    return f"there is no label {name} here{hint}"


def _leads_inside(c: Checker, place: Place) -> str:
    assert place.inside is not None
    word, line = _WORDS[type(place.inside)], c.pos(place.inside.pos).line
    return (
        f"{place.label.name} stands inside of the {word} in line {line}, and a JMP leads out of such statements only, "
        f"not into them; put the label in front of the {word} or after it"
    )


def note_loops(c: Checker, statements: list[Statement]) -> None:
    """Notes the loops that a JMP back makes in some statements: they are looked at when all bodies are checked."""
    labels: dict[str, int] = {}
    for index, statement in enumerate(statements):
        if isinstance(statement, Label):
            labels[statement.name] = index
        elif isinstance(statement, Jump) and statement.name in labels:
            c.note_loop(JumpLoop(None, statements[labels[statement.name] : index], statement.pos))
        elif labels and isinstance(statement, If):
            condition, body = statement.branches[0]
            jump = body[-1] if body else None
            if isinstance(jump, Jump) and jump.name in labels:
                c.note_loop(JumpLoop(condition, statements[labels[jump.name] : index + 1], jump.pos))
