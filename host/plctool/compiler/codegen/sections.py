"""Bodies that are too long for one function: LLVM takes more than proportional time for long runs of instructions."""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.typed.nodes import Jump, Label, Pou, PouKind, Return, Statement
from plctool.compiler.typed.typed_nodes import walk

_LONG = 3000  # expressions and statements, some 250 lines


def sections(pou: Pou) -> list[Pou]:
    """A body in parts that run one after the other, each a unit of its own; the unit itself when it is short, or
    cannot be cut: temporary variables live in one function, RETURN leaves only one, and a JMP stays in one."""
    if pou.kind not in (PouKind.PROGRAM, PouKind.FUNCTION_BLOCK) or pou.locals or len(pou.body) < 2:
        return [pou]
    sizes: list[int] = []
    labels = {s.name: number for number, s in enumerate(pou.body) if isinstance(s, Label)}
    joined_up_to = [0] * len(pou.body)  # for each statement, the last one that a JMP joins it with
    for number, statement in enumerate(pou.body):
        size = 0
        for node in walk(statement):
            size += 1
            if isinstance(node, Return):
                return [pou]
            if isinstance(node, Jump) and node.name in labels:  # others stay within the statement
                first, last = sorted((number, labels[node.name]))
                joined_up_to[first] = max(joined_up_to[first], last)
        sizes.append(size)
    bodies: list[list[Statement]] = []
    size, joined = _LONG, -1
    for number, statement in enumerate(pou.body):
        if size >= _LONG and number > joined:
            bodies.append([])
            size = 0
        bodies[-1].append(statement)
        size += sizes[number]
        joined = max(joined, joined_up_to[number])
    return [replace(pou, body=body) for body in bodies] if len(bodies) > 1 else [pou]
