"""The variable that shows the way of an exception which a `__TRY` let out: codegen/trail.py writes it.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.world import World
from plctool.compiler.typed.nodes import Pou, Storage, Try, Variable
from plctool.compiler.typed.typed_nodes import walk
from plctool.debug.passed_lines import DEPTH, TRAIL
from plctool.iec.types import UDINT, ArrayType


def reserve_trail(world: World) -> Variable | None:
    """The variable; None for a program in which no exception leaves a `__TRY` that is around a call."""
    where = next((pou for pou in world.pous if lets_out(pou)), None)
    if where is None:
        return None
    variable = Variable(TRAIL, ArrayType(UDINT, ((0, DEPTH),)), Storage.AREA, where.pos)
    world.allocation.add(variable)
    return variable


def lets_out(pou: Pou) -> bool:
    """True if an exception may leave a `__TRY` of the unit."""
    return any(isinstance(node, Try) and (node.exception is None or node.last) for node in walk(pou.body))
