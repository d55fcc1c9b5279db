"""Whether two targets hold the same values."""

from __future__ import annotations

import math
import struct

from batch import AREAS, Recording, State

from plctool.debug.variables import Symbol
from plctool.iec.areas import Area
from plctool.iec.types import LREAL, REAL, PointerType, StringType


def is_nan(data: bytes) -> bool:
    return math.isnan(struct.unpack("<f" if len(data) == 4 else "<d", data)[0])


def value_of(leaf: Symbol, data: bytes) -> bytes:
    """The bytes of a variable without what is not part of its value.

    That is what is past the end of a string, which of the many not-a-numbers it is, and an address, of which only
    remains whether it is NULL.
    """
    if isinstance(leaf.type, StringType):
        return data.partition(b"\0")[0].ljust(len(data), b"\0")
    if isinstance(leaf.type, PointerType) or (leaf.type in (REAL, LREAL) and is_nan(data)):
        return bytes([any(data)]).ljust(len(data), b"\0")
    return data


def values_of(recording: Recording, state: State) -> tuple[bytes, ...]:
    """The areas without what is not part of a value."""
    areas = tuple(map(bytearray, state.areas))
    for leaf in recording.leaves:
        place = slice(leaf.offset, leaf.offset + leaf.size)
        area = areas[AREAS.index(Area(leaf.area))]
        area[place] = value_of(leaf, bytes(area[place]))
    return tuple(map(bytes, areas))


def describe(recording: Recording, area: Area, offset: int, want: bytes, got: bytes) -> str:
    """The variable at a place and what it is, for people."""
    for leaf in recording.leaves:
        place = slice(leaf.offset, leaf.offset + leaf.size)
        if leaf.area == area.value and leaf.offset <= offset < place.stop:
            return f"{leaf.name} is {leaf.decode(got[place])!r} in place of {leaf.decode(want[place])!r}"
    return f"{area.name} offset {offset} is {got[offset]} in place of {want[offset]}"


def differences(recording: Recording, states: list[State]) -> list[str]:
    wrong = []
    for number, (expected, actual) in enumerate(zip(recording.states, states, strict=True), 1):
        where = f"{recording.name}, step {number}"
        if actual.exception != expected.exception:
            wrong.append(f"{where}: exception {actual.exception} in place of {expected.exception}")
        if actual.areas == expected.areas:
            continue  # as nearly always; only what differs is worth a look at each variable
        for area, want, got in zip(AREAS, values_of(recording, expected), values_of(recording, actual), strict=True):
            places = [i for i, (w, g) in enumerate(zip(want, got, strict=True)) if w != g]
            wrong += [f"{where}: {text}" for text in {describe(recording, area, i, want, got): None for i in places}]
    return wrong
