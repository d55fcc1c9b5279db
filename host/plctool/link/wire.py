"""Layouts of packets as the firmware's CmpPackets.h defines them, so that both ends have one definition.

A layout packs members by name and gives them back by name. Members of a struct in a struct (the head of a package)
count as its own. Integers are unsigned and little-endian.
"""

from __future__ import annotations

import struct
from collections import namedtuple
from collections.abc import Iterator
from typing import Any

from plctool.core import ffi

_CODES = {1: "B", 2: "H", 4: "I", 8: "Q"}


class Layout:
    """The struct `name`; with `before`, only the members before that one, which is all that older peers send."""

    def __init__(self, name: str, before: str = "") -> None:
        members = list(_members(ffi.typeof(name)))
        names = [member for member, _ in members]
        members = members[: names.index(before)] if before else members
        self.codes = "".join(code for _, code in members)  # of module struct
        self._struct = struct.Struct("<" + self.codes)
        self._record: Any = namedtuple(name, [member for member, _ in members])  # type: ignore[misc]
        self._zeros = {member: b"" if code.endswith("s") else 0 for member, code in members}

    @property
    def size(self) -> int:
        """Bytes."""
        return self._struct.size

    def pack(self, **values: int | bytes) -> bytes:
        """The bytes of it; members that are not given are zero. Raises TypeError for one that it has not."""
        return self._struct.pack(*self._record(**{**self._zeros, **values}))

    def unpack(self, data: bytes | bytearray | memoryview) -> Any:
        """A named tuple of the members at the start of `data`, which must be `size` bytes long at least."""
        return self._record._make(self._struct.unpack_from(data))

    def unpack_each(self, data: bytes) -> Iterator[Any]:
        """The same for each of the layouts that `data` consists of; what is left at its end is ignored."""
        whole = len(data) - len(data) % self.size
        return map(self._record._make, self._struct.iter_unpack(data[:whole]))


def signed32(value: int) -> int:
    """A 32 bit member as signed."""
    return value - (1 << 32) if value >= 1 << 31 else value


def _members(kind: Any) -> Iterator[tuple[str, str]]:
    """Name and code (of module struct) of each member."""
    for name, field in kind.fields:
        inner = field.type
        if inner.kind == "struct":
            yield from _members(inner)
        elif inner.kind == "array" and "reserved" not in name and inner.length in _CODES:
            yield name, _CODES[inner.length]
        elif inner.kind == "array":
            yield name, f"{inner.length}s"
        else:
            yield name, _CODES[ffi.sizeof(inner)]
