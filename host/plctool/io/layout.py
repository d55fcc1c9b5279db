"""Addresses of the variables that channels name and that have none of their own.

The address follows from the name alone, as far as that is possible: a module that is inserted into the description
leaves the variables of the others where they are. The variables get a power of two of bytes, at least half as large
again as they need, after all addresses that the program and the description name. Each begins its search at the place
that the CRC-32 of its full name, in lower case, gives (in units of its alignment), and takes the first that is free.
The larger alignment comes first, then the smaller CRC. So a new variable moves another only if both want the same
place, or if there must be more bytes.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping

from plctool.iec.types import Type, align_up

FIRST_ALIGN = 16  # bytes: so that a bit that the program adds at an address seldom moves all
_LEAST = 8


def lay_out(variables: Mapping[str, Type], first: int) -> dict[str, int]:
    """The offset of each variable, in bytes, from the byte after the last address that is given (`first`) on."""
    start = align_up(first, FIRST_ALIGN)
    size = _LEAST
    while 2 * size < 3 * sum(align_up(t.size, t.align) for t in variables.values()):
        size *= 2
    while True:
        found = _try(variables, size)
        if found is not None:
            return {name: start + offset for name, offset in found.items()}
        size *= 2


def _try(variables: Mapping[str, Type], size: int) -> dict[str, int] | None:
    used = bytearray(size)
    found: dict[str, int] = {}
    for name in sorted(variables, key=lambda n: (-variables[n].align, _number(n), n)):
        t = variables[name]
        places = size // t.align
        wish = _number(name) % places
        for step in range(places):
            at = (wish + step) % places * t.align
            if at + t.size <= size and not any(used[at : at + t.size]):
                used[at : at + t.size] = b"\1" * t.size
                found[name] = at
                break
        else:
            return None
    return found


def _number(name: str) -> int:
    return zlib.crc32(name.lower().encode("utf-8"))
