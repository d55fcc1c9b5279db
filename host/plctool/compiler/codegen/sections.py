"""Bodies that are too long for one function: LLVM takes more than proportional time for long runs of instructions."""

from __future__ import annotations

from dataclasses import replace

from plctool.compiler.typed import Jump, Pou, PouKind, Return, Statement
from plctool.compiler.typed_nodes import walk

_LONG = 3000  # expressions and statements, some 250 lines


def sections(pou: Pou) -> list[Pou]:
    """A body in parts that run one after the other, each a unit of its own; the unit itself when it is short, or
    cannot be cut: temporary variables live in one function, RETURN leaves only one, and a JMP stays in one."""
    if pou.kind not in (PouKind.PROGRAM, PouKind.FUNCTION_BLOCK) or pou.locals or len(pou.body) < 2:
        return [pou]
    bodies: list[list[Statement]] = []
    size = _LONG
    for statement in pou.body:
        if size >= _LONG:
            bodies.append([])
            size = 0
        bodies[-1].append(statement)
        for node in walk(statement):
            size += 1
            if isinstance(node, Return | Jump):
                return [pou]
    return [replace(pou, body=body) for body in bodies] if len(bodies) > 1 else [pou]
