"""Function blocks that are closed: a call touches nothing but the variables of its instance, which are scalars, and
raises no exception. The timers, counters and edges of the standard library are.

So what a caller knows of other variables holds after the call. The first output comes back in a register as well,
since most are used right after the call, and what does not ask for the time gets no context (`signatures.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

from plctool.compiler.typed.nodes import (
    Assign,
    Binary,
    BinaryOp,
    BitPlace,
    Case,
    Const,
    Convert,
    Direction,
    If,
    Intrinsic,
    IntrinsicCall,
    Load,
    Pou,
    PouKind,
    Return,
    Storage,
    Unary,
    Variable,
    VarPlace,
)
from plctool.compiler.typed.typed_nodes import walk
from plctool.iec.types import Elementary, Kind, base_of, is_scalar
from plctool.image.targets import Target

_PLAIN = (Assign, BitPlace, Case, If, Load, Return, Unary)
_OPEN = (Intrinsic.EXCHANGE, Intrinsic.STRING_SIZE)
_OF_CONTEXT = (Intrinsic.TIME, Intrinsic.LTIME, Intrinsic.TASK)
_LARGEST = 1000  # expressions and statements: a larger body may become several functions


@dataclass(frozen=True)
class Closed:
    """What the function of a closed block is like: the output that it returns, whether it gets the context, and how
    many calls of it the program has."""

    returned: Variable | None
    has_context: bool
    calls: int


def closed_block(pou: Pou, target: Target, calls: int) -> Closed | None:
    """None for what is not closed."""
    if pou.kind is not PouKind.FUNCTION_BLOCK or pou.external:
        return None
    has_context = False
    for number, node in enumerate(walk(pou.body)):
        if number > _LARGEST or not _is_harmless(node):
            return None
        has_context |= isinstance(node, IntrinsicCall) and node.intrinsic in _OF_CONTEXT
    outputs = [p.variable for p in pou.parameters if p.direction is Direction.OUTPUT]
    fitting = (v for v in outputs if is_scalar(v.type) and v.type.size <= target.pointer_size)
    return Closed(next(fitting, None), has_context, calls)


def _is_harmless(node: object) -> bool:
    if isinstance(node, VarPlace):
        return node.var.storage in (Storage.SELF, Storage.LOCAL) and is_scalar(node.var.type)
    if isinstance(node, Binary):
        return node.op not in (BinaryOp.DIV, BinaryOp.MOD) or _cannot_fail(node)
    if isinstance(node, Convert):
        return node.check is None
    if isinstance(node, IntrinsicCall):
        return node.intrinsic not in _OPEN
    return isinstance(node, _PLAIN)


def _cannot_fail(division: Binary) -> bool:
    """Whether a division raises no exception: of a REAL, or by a constant."""
    t, divisor = base_of(division.type), division.right
    is_real = isinstance(t, Elementary) and t.kind is Kind.REAL
    return is_real or (isinstance(divisor, Const) and divisor.value not in (0, ""))
