"""What is kept over a power cut, variable by variable: the table that the image carries (CDL_KEPT).

A changed program finds a value again by the full name and the type of the variable, member or element. So an entry is
about a scalar or a string, or about all elements of one array, distinguished by their indices. Of an array of structs
there is an entry for each member. What is an address is never kept.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import groupby, product

from plctool.compiler.typed.nodes import Variable
from plctool.core import lib
from plctool.errors import UsageError
from plctool.iec.types import (
    BYTE,
    ArrayType,
    Elementary,
    EnumType,
    Field,
    Keep,
    PointerType,
    StringType,
    StructType,
    SubrangeType,
    Type,
)
from plctool.image.file import KeptVariable

_WIDEST = 0xFFFF  # bytes: of CDL_KEPT_RUN.size and .stride


@dataclass(frozen=True)
class KeptPart:
    """A part of a variable that is kept, or the same part of all elements of an array. `name`: with `[]` for those;
    `type`: as far as a kept value depends on it; `size`, `stride`, `offset` [bytes]."""

    name: str
    type: str
    offset: int
    size: int
    persistent: bool
    stride: int = 0
    count: int = 1
    first: int = 0

    @property
    def is_array(self) -> bool:
        """Whether it stands for all elements of an array."""
        return "[]" in self.name

    @property
    def key(self) -> tuple[str, str]:
        """What a changed program finds it again by."""
        return self.name.casefold(), self.type


def kept_parts(variables: Iterable[Variable]) -> list[KeptPart]:
    """What is kept of variables in the retain area."""
    return [
        replace(part, name=variable.name + part.name, offset=variable.offset + part.offset)
        for variable in variables
        for part in _parts(variable.type, variable.keep)
    ]


def is_kept(t: Type, keep: Keep) -> bool:
    """Whether anything of a variable is kept."""
    return any(True for _ in _parts(t, keep))


def kept_variables(parts: Iterable[KeptPart]) -> list[KeptVariable]:
    """The entries of the table. Raises UsageError when two variables look the same, or one is too large."""
    found: dict[bytes, KeptPart] = {}
    for part in parts:
        if part.size > _WIDEST:
            raise UsageError(f"{part.name} has {part.size} bytes, but what is kept has at most {_WIDEST}.", "kept-size")
        other = found.setdefault(_hash(part), part)
        if other is not part:
            raise UsageError(
                f"{part.name} and {other.name} look the same to the device; rename one of them.", "kept-name"
            )
    return [
        KeptVariable(
            key, p.offset, p.size, p.persistent, p.stride or p.size, p.count, p.first, _is_run(p)
        )
        for key, p in sorted(found.items())
    ]  # fmt: skip


def _is_run(part: KeptPart) -> bool:
    return part.is_array or part.size not in (1, 2, 4, 8)


def _hash(part: KeptPart) -> bytes:
    return hashlib.blake2b(":".join(part.key).encode(), digest_size=int(lib.CDL_KEPT_HASH_SIZE)).digest()


def _parts(t: Type, keep: Keep) -> Iterator[KeptPart]:
    """Of a variable of the type; names begin after its own."""
    if isinstance(t, ArrayType):
        yield from _elements(t, keep)
    elif isinstance(t, StructType) and not t.union:
        for f in _members(t):
            for part in _parts(f.type, keep.of_member(f.keep)) if _is_data(f) else ():
                yield replace(part, name=f".{f.name}{part.name}", offset=f.offset + part.offset)
    elif keep.kept and not _has_address(t):
        yield KeptPart("", _type_text(t), 0, t.size, keep is Keep.PERSISTENT)


def _members(t: StructType) -> Iterator[Field]:
    """The members; of BITs their bytes, each with the names of all its bits: where one is added, none of them is taken
    for another."""
    for _, group in groupby(t.fields, lambda f: f.name if f.bit is None else f.offset):
        first, *others = group
        names = "+".join(f.name for f in (first, *others))
        yield Field(names, BYTE, first.offset) if first.bit is not None else first


def _is_data(field: Field) -> bool:
    """Whether it belongs to the program, or is what an input with R_EDGE was in the call before."""
    return not field.hidden or field.name.endswith(".before")


def _elements(t: ArrayType, keep: Keep) -> Iterator[KeptPart]:
    *outer, (first, last) = t.bounds
    stride, count = t.element.size, last - first + 1
    rows = list(product(*(range(low, high + 1) for low, high in outer)))
    for part in _parts(t.element, keep):
        for number, row in enumerate(rows):
            start = part.offset + number * count * stride
            prefix = "".join(f"[{i}]" for i in row)
            if part.is_array or stride > _WIDEST:
                for i in range(count):
                    yield replace(part, name=f"{prefix}[{first + i}]{part.name}", offset=start + i * stride)
            else:
                name = f"{prefix}[]{part.name}"
                yield replace(part, name=name, offset=start, stride=stride, count=count, first=first)


def _has_address(t: Type) -> bool:
    """Whether a value of the type holds an address, which means nothing after a start."""
    if isinstance(t, ArrayType):
        return _has_address(t.element)
    if isinstance(t, StructType):
        return any(_has_address(f.type) for f in t.fields)
    return isinstance(t, PointerType)


def _type_text(t: Type) -> str:
    """What has to be the same for a value to mean the same. A string may become longer, and the values of an
    enumeration may get other names; the limits of a subrange may not change, because a value could be outside."""
    if isinstance(t, StringType):
        return t.keyword
    if isinstance(t, EnumType):
        return f"{t.name.casefold()}={t.base.name}"
    if isinstance(t, SubrangeType):
        return f"{t.base.name}({t.low}..{t.high})"
    if isinstance(t, ArrayType):
        return f"{t.bounds}{_type_text(t.element)}"
    if isinstance(t, StructType):
        return f"({','.join(f'{f.offset}{_type_text(f.type)}' for f in _members(t))})"
    assert isinstance(t, Elementary)
    return t.name
