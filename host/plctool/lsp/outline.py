"""The blocks of a text by its tokens: units, sections and statements, also of a text that is not finished."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from plctool.compiler.syntax.lexer import Token

_ENDS = {
    "PROGRAM": "_END_PROGRAM", "FUNCTION": "_END_FUNCTION", "FUNCTION_BLOCK": "_END_FUNCTION_BLOCK",
    "CLASS": "_END_CLASS", "INTERFACE": "_END_INTERFACE", "METHOD": "_END_METHOD", "ACTION": "_END_ACTION",
    "PROPERTY": "_END_PROPERTY", "PROPERTY_GET": "_END_PROPERTY", "PROPERTY_SET": "_END_PROPERTY", "GET": "_END_GET",
    "SET": "_END_SET", "TYPE": "_END_TYPE", "NAMESPACE": "_END_NAMESPACE", "CONFIGURATION": "_END_CONFIGURATION",
    "RESOURCE": "_END_RESOURCE", "TEST": "_END_TEST", "SETUP": "_END_SETUP", "TEARDOWN": "_END_TEARDOWN",
    "STRUCT": "_END_STRUCT", "UNION": "_END_UNION", "VAR": "_END_VAR", "GLOBAL": "_END_VAR", "CONFIG": "_END_VAR",
    "ACCESS": "_END_VAR", "IF": "_END_IF", "CASE": "_END_CASE", "FOR": "_END_FOR", "WHILE": "_END_WHILE",
    "REPEAT": "_END_REPEAT", "STEP": "_END_STEP", "INITIAL_STEP": "_END_STEP", "TRANSITION": "_END_TRANSITION",
    "TRY": "_END_TRY",
}  # fmt: skip
"""The terminal that ends a block, by the one that begins it."""

TOP = frozenset(("PROGRAM", "FUNCTION", "FUNCTION_BLOCK", "CLASS", "INTERFACE", "TYPE", "TEST", "SETUP", "TEARDOWN"))
"""Units that are in no other one, so that they end one which is not finished."""
MEMBERS = frozenset(("METHOD", "ACTION", "PROPERTY", "PROPERTY_GET", "PROPERTY_SET", "GET", "SET"))
UNITS = TOP | MEMBERS
SECTIONS = frozenset(("VAR", "GLOBAL", "CONFIG", "ACCESS"))
_ALONE = frozenset(("NAMESPACE", "CONFIGURATION"))
_ENDING = frozenset(_ENDS.values())


@dataclass(eq=False)
class Block:
    """`first` and `last` are indices of tokens; `closed`: it has its END."""

    kind: str
    first: int
    last: int
    closed: bool = False
    inner: list[Block] = field(default_factory=list)

    def every(self) -> Iterator[Block]:
        """Returns it and all blocks in it."""
        yield self
        for block in self.inner:
            yield from block.every()


def outline(tokens: Sequence[Token]) -> list[Block]:
    """Returns the outermost blocks."""
    found: list[Block] = []
    stack: list[Block] = []
    for at, token in enumerate(tokens):
        kind = token.type
        if kind in _ENDS:
            if kind == "PROGRAM" and any(b.kind in ("CONFIGURATION", "RESOURCE") for b in stack):
                continue  # an instance
            if kind in TOP or kind in _ALONE:
                while stack and stack[-1].kind not in _ALONE:
                    stack.pop().last = at - 1
            block = Block(kind, at, at)
            (stack[-1].inner if stack else found).append(block)
            stack.append(block)
        elif kind in _ENDING:
            _close(stack, kind, at)
    for block in stack:
        block.last = max(block.first, len(tokens) - 2)  # the last one is $END
    return found


def _close(stack: list[Block], ending: str, at: int) -> None:
    """Ends the nearest block that has this ending, and those in it."""
    if not any(_ENDS[block.kind] == ending for block in stack):
        return
    while True:
        block = stack.pop()
        block.last = at
        if _ENDS[block.kind] == ending:
            block.closed = True
            return


def top_block(blocks: Sequence[Block], tokens: Sequence[Token], offset: int) -> Block | None:
    """Returns the outermost block that an offset is in or after."""
    starts = [tokens[block.first].pos for block in blocks]
    at = bisect_right(starts, offset) - 1
    return blocks[at] if at >= 0 else None
