"""Whether a pointer may look at a variable of another type without surprise.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from plctool.compiler.semantics.symbols import ERROR
from plctool.iec.types import ArrayType, Elementary, Kind, PointerType, StringType, StructType, Type, base_of

_BITS = (Kind.BIT, Kind.CHAR)


def overlays(found: Type, wanted: Type) -> bool:
    """Whether `found` is a `wanted`, begins with one or is what one begins with, or either is seen as plain bits."""
    a, b = _plain(found), _plain(wanted)
    if isinstance(a, PointerType) or isinstance(b, PointerType):
        return True
    if ERROR in (a, b) or a == b or _is_bits(a) or _is_bits(b):
        return True
    if isinstance(a, StringType) and isinstance(b, StringType):
        return a.wide is b.wide
    if isinstance(a, StructType) and isinstance(b, StructType) and (a.conforms(b) or b.conforms(a)):
        return True
    first = isinstance(a, StructType) and any(overlays(t, b) for t in _first(a))
    return first or (isinstance(b, StructType) and any(overlays(a, t) for t in _first(b)))


def _plain(t: Type) -> Type:
    """The type of the elements of an array, and of those; of an enumeration or subrange its base."""
    while isinstance(t, ArrayType):
        t = t.element
    return base_of(t)


def _is_bits(t: Type) -> bool:
    return isinstance(t, Elementary) and t.kind in _BITS


def _first(t: StructType) -> list[Type]:
    return [f.type for f in t.fields if f.offset <= 0 and not f.hidden]
