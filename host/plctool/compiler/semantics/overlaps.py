"""Variables at addresses (AT) that share memory.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterable

from plctool.compiler.diagnostics import Diagnostics
from plctool.compiler.typed import Variable
from plctool.iec.areas import Area


def report_overlaps(variables: Iterable[Variable], diagnostics: Diagnostics) -> None:
    """Warns of variables that are over others, at the one that is declared later, unless that is meant."""
    located = [v for v in variables if v.area in (Area.INPUT, Area.OUTPUT, Area.MEMORY) and not v.name.startswith("%")]
    numbers = {variable: number for number, variable in enumerate(located)}
    reaching: list[Variable] = []
    for variable in sorted(located, key=lambda v: (v.area.value, *_bits(v))):
        start, _ = _bits(variable)
        reaching = [v for v in reaching if v.area is variable.area and _bits(v)[1] > start]
        for other in reaching:
            if _is_meant(variable, other):
                continue
            later, earlier = sorted((variable, other), key=lambda v: numbers[v], reverse=True)
            where = f"in line {earlier.pos.line}" if earlier.pos.file == later.pos.file else f"in {earlier.pos.file}"
            message = f"{later.name} shares its memory with {earlier.name} {where}"
            diagnostics.warning(later.pos, "overlap", message)
        reaching.append(variable)


def _is_meant(one: Variable, other: Variable) -> bool:
    """A bit of something larger, in the memory area any part of something larger; the instances of one PROGRAM."""
    if one.pos == other.pos or (one.bit is None) != (other.bit is None):
        return True
    (start, end), (other_start, other_end) = _bits(one), _bits(other)
    within = (start >= other_start and end <= other_end) or (other_start >= start and other_end <= end)
    return one.area is Area.MEMORY and within and one.type.size != other.type.size


def _bits(variable: Variable) -> tuple[int, int]:
    """The first bit, and the one past the end of the variable."""
    first = variable.offset * 8
    if variable.bit is not None:
        return first + variable.bit, first + variable.bit + 1
    return first, first + variable.type.size * 8
