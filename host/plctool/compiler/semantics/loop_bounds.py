"""Arrays whose bounds a FOR leaves for certain: limits, index and bounds are constants, and nothing leads around it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator

from plctool.compiler.semantics.pitfalls import has_exit
from plctool.compiler.typed.nodes import (
    Assign,
    Binary,
    BinaryOp,
    CallStatement,
    Const,
    Continue,
    Convert,
    Expr,
    FbCall,
    For,
    If,
    IndexPlace,
    Intrinsic,
    IntrinsicCall,
    Jump,
    Load,
    Node,
    Pos,
    Return,
    Statement,
    Try,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.ranges import type_range
from plctool.compiler.typed.typed_nodes import root_of, walk, written_places
from plctool.iec.types import ArrayType, OpenArrayType


def passed_bounds(loop: For) -> Iterator[tuple[Pos, str]]:
    """What to say, and where, of each index that runs past the bounds of its array. Only what every iteration does
    counts; of a loop that may be left early, only its first one."""
    values = known_values(loop.start, loop.stop, loop.step)
    if not values or not isinstance(loop.var, VarPlace) or _may_be_set(loop.var.var, loop.body):
        return
    certain = values[:1] if _may_be_left(loop.body) else (values[0], values[-1])
    for node in _certain_nodes(loop.body):
        array = node.base.type if isinstance(node, IndexPlace) else None
        if not isinstance(node, IndexPlace) or not isinstance(array, ArrayType) or isinstance(array, OpenArrayType):
            continue
        for index, (low, high) in zip(node.indices, array.bounds, strict=True):
            reached = (_index_at(index, loop.var.var, value) for value in certain)
            outside = next((n for n in reached if n is not None and not low <= n <= high), None)
            if outside is not None:
                yield index.pos, f"the loop comes to the index {outside}, outside of {low}..{high}"


def known_values(*limits: Expr) -> range:
    """The values of a variable with this start, stop and step; none when they are not known."""
    ends = [e.value for e in limits if isinstance(e, Const) and isinstance(e.value, int)]
    if len(ends) < 3 or ends[2] == 0:
        return range(0)
    first, stop, step = ends
    return range(first, stop + (1 if step > 0 else -1), step)


def _may_be_set(variable: Variable, body: list[Statement]) -> bool:
    return any(root_of(place) is variable for node in walk(body) for place in written_places(node))


def _may_be_left(body: list[Statement]) -> bool:
    return has_exit(body) or any(isinstance(node, Return | Jump | Try) for node in walk(body))


def _certain_nodes(body: list[Statement]) -> Iterator[Node]:
    """What every iteration evaluates, up to the first statement that may lead around the rest."""
    for statement in body:
        found: list[Node] = []
        if isinstance(statement, Assign | CallStatement | FbCall):
            found = list(walk(statement))
        elif isinstance(statement, If):
            found = list(walk(statement.branches[0][0]))
        if not any(_is_partial(node) for node in found):
            yield from found
        if has_exit([statement], (Continue,)) or _may_be_left([statement]):
            return


def _is_partial(node: Node) -> bool:
    """Whether not all that it is made of may be evaluated."""
    if isinstance(node, Binary):
        return node.op in (BinaryOp.AND_THEN, BinaryOp.OR_ELSE)
    return isinstance(node, IntrinsicCall) and node.intrinsic in (Intrinsic.SELECT, Intrinsic.MUX)


def _index_at(index: Expr, variable: Variable, value: int) -> int | None:
    """The index when the variable has a value; None when it is not the variable or its sum with constants."""
    result: int | None = None
    if isinstance(index, Load) and isinstance(index.place, VarPlace) and index.place.var is variable:
        result = value
    elif isinstance(index, Convert):
        result = _index_at(index.operand, variable, value)
    elif isinstance(index, Binary) and index.op in (BinaryOp.ADD, BinaryOp.SUB) and isinstance(index.right, Const):
        left, right = _index_at(index.left, variable, value), index.right.value
        if left is not None and isinstance(right, int):
            result = left + right if index.op is BinaryOp.ADD else left - right
    limits = type_range(index.type)
    fits = result is not None and limits is not None and limits[0] <= result <= limits[1]
    return result if fits else None
