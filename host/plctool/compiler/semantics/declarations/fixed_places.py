"""Parts of variables that are at a fixed address: `Main.fb.values[3]`.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from plctool.compiler.semantics.generics import bounds_of
from plctool.compiler.typed.nodes import (
    ArrayInit,
    BitPlace,
    Const,
    IndexPlace,
    Initial,
    MemberPlace,
    Place,
    Storage,
    StructInit,
    Variable,
    VarPlace,
    array_runs,
    overlay,
)  # fmt: skip
from plctool.iec.types import BYTE, ArrayType, Field, StructType, Type

Step = str | int  # the name of a member, or the number of an element from 0


@dataclass
class FixedPlace:
    """`offset` in bytes within the variable; `steps` lead to it; `bit` when it is one bit of what is there."""

    variable: Variable
    offset: int = 0
    steps: list[Step] = field(default_factory=list)
    bit: int | None = None


def _is_of(f: Field, place: MemberPlace) -> bool:
    """Whether a place is the member, or the byte that the member is a bit of."""
    return place.type is (BYTE if f.bit is not None else f.type)


def fixed_place(place: Place) -> FixedPlace | None:
    """Where a place is; None when that is only known when it runs."""
    if isinstance(place, VarPlace):
        return FixedPlace(place.var) if place.var.storage is Storage.AREA else None
    if not isinstance(place, MemberPlace | IndexPlace | BitPlace):
        return None
    found, t = fixed_place(place.base), place.base.type
    if found is None:
        return None
    if isinstance(place, BitPlace):
        found.bit = place.bit
    elif isinstance(place, MemberPlace) and isinstance(t, StructType):
        found.steps.append(next(f.name for f in t.fields if f.offset == place.offset and _is_of(f, place)))
        found.offset += place.offset
    elif isinstance(place, IndexPlace) and isinstance(t, ArrayType):
        number = _element_number(place)
        if number is None:
            return None
        found.steps.append(number)
        found.offset += number * t.element.size
    else:
        return None
    return found


def _element_number(place: IndexPlace) -> int | None:
    number = 0
    for index, (low, high) in zip(place.indices, bounds_of(place.base), strict=True):
        known = [e.value for e in (index, low, high) if isinstance(e, Const) and isinstance(e.value, int)]
        if len(known) < 3:
            return None
        number = number * (known[2] - known[1] + 1) + known[0] - known[1]
    return number


def with_part(
    t: Type, initial: Initial | None, steps: list[Step], value: Initial, defaults: Mapping[str, StructInit]
) -> Initial:
    """The initial value of a variable of type `t` where the part that `steps` lead to starts with `value`. `defaults`:
    of the struct types."""
    if not steps:
        return value
    step, *rest = steps
    if isinstance(t, StructType) and isinstance(step, str):
        given = initial if isinstance(initial, StructInit) else StructInit({})
        default = defaults.get(t.name)
        part = given.members.get(step) or (default.members.get(step) if default is not None else None)
        member = t.member(step)
        assert member is not None
        changed = with_part(member.type, part, rest, value, defaults)
        return overlay(t, StructInit({step: changed}), given)
    assert isinstance(t, ArrayType) and isinstance(step, int)
    runs: list[tuple[int, Initial | None]] = []
    first = 0
    for count, part in array_runs(t, initial):
        if not first <= step < first + count:
            runs.append((count, part))
        else:
            changed = with_part(t.element, part, rest, value, defaults)
            runs += [(n, p) for n, p in ((step - first, part), (1, changed), (first + count - 1 - step, part)) if n]
        first += count
    return ArrayInit(runs)
