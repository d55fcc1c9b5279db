"""The objects that LLVM writes: ELF files of sections, symbols and relocations, all from this process and trusted."""

from __future__ import annotations

import struct

from plctool.compiler.codegen.relocations import thumb_addend
from plctool.image.targets import Target
from plctool.records import dataclass

_WRITABLE, _ALLOCATED, _EXECUTABLE = 1, 2, 4
_DROPPED = (".ARM.exidx", ".ARM.extab", ".eh_frame")
_FUNCTION = 2  # STT_FUNC
_CLASS, _CLASS_64 = 4, 2  # EI_CLASS of an ELF file, ELFCLASS64
_SYMBOL_TABLE, _RELOCATIONS_WITH_ADDENDS, _NO_BITS, _RELOCATIONS = 2, 4, 8, 9  # SHT_SYMTAB, RELA, NOBITS, REL


@dataclass(frozen=True)
class ElfSymbol:
    """`section`: its index among those of all objects; 0 when undefined."""

    name: str
    section: int
    value: int
    size: int
    kind: int
    is_global: bool

    @property
    def is_function(self) -> bool:
        return self.kind == _FUNCTION


@dataclass
class Section:
    """A section, for the linker."""

    name: str
    data: bytes
    flags: int
    align: int
    relocations: list[tuple[int, int, ElfSymbol, int]]  # offset, kind, symbol, addend
    place: int  # in its object
    offset: int = -1  # in the block; -1 when it is not part of it

    @property
    def is_writable(self) -> bool:
        return bool(self.flags & _WRITABLE)

    @property
    def is_allocated(self) -> bool:
        return bool(self.flags & _ALLOCATED)

    @property
    def is_executable(self) -> bool:
        return bool(self.flags & _EXECUTABLE)

    @property
    def is_debug(self) -> bool:
        return self.name.startswith(".debug_")


def code_size(data: bytes) -> int:
    """Bytes of code and constants in an object."""
    headers = _read_section_headers(data, wide=data[_CLASS] == _CLASS_64)
    return sum(h.size for h in headers if h.flags & _ALLOCATED and not h.name.startswith(_DROPPED))


def read_object(data: bytes, target: Target, base: int) -> tuple[list[Section], list[ElfSymbol]]:
    """The sections and symbols of an object for a target. `base`: index of the first section; symbols refer to sections
    by index."""
    wide = target.pointer_size == 8
    headers = _read_section_headers(data, wide)
    bodies = [b"" if h.type == _NO_BITS else data[h.offset : h.offset + h.size] for h in headers]
    sections: list[Section] = []
    symbols: list[ElfSymbol] = []
    for h, body in zip(headers, bodies, strict=True):
        kept = b"" if h.name.startswith(_DROPPED) else body
        sections.append(Section(h.name, kept, h.flags, max(h.alignment, 1), [], h.offset))
    for h, body in zip(headers, bodies, strict=True):
        if h.type == _SYMBOL_TABLE:
            symbols = _read_symbols(body, bodies[h.link], len(sections), base, wide)
    for h, body in zip(headers, bodies, strict=True):
        owner = sections[h.info] if h.type in (_RELOCATIONS, _RELOCATIONS_WITH_ADDENDS) else None
        if owner is not None and owner.data and (owner.flags & _ALLOCATED or owner.is_debug):
            entries = _read_relocations(body, h.type == _RELOCATIONS_WITH_ADDENDS, wide, owner.data)
            owner.relocations = [(offset, kind, symbols[number], addend) for offset, kind, number, addend in entries]
    return sections, symbols


@dataclass(frozen=True)
class _Header:
    """What the section header table says of a section. `offset`, `size` [bytes]: its place in the file; `link`, `info`:
    sections that belong to it, depending on its type."""

    name: str
    type: int
    flags: int
    offset: int
    size: int
    link: int
    info: int
    alignment: int


def _read_section_headers(data: bytes, wide: bool) -> list[_Header]:
    """The section header table of an ELF file, whose place and size are in the file's header."""
    table, entry, count, of_names = struct.unpack_from("<Q10x3H" if wide else "<I10x3H", data, 40 if wide else 32)
    layout = "<IIQ8xQQIIQ" if wide else "<III4xIIIII"
    rows = [struct.unpack_from(layout, data, table + entry * number) for number in range(count)]
    names = rows[of_names][3]
    return [_Header(_name_at(data, names + row[0]), *row[1:]) for row in rows]


def _name_at(data: bytes, place: int) -> str:
    return data[place : data.index(0, place)].decode()


def _read_symbols(data: bytes, names: bytes, section_count: int, base: int, wide: bool) -> list[ElfSymbol]:
    symbols = []
    for fields in struct.iter_unpack("<IBBHQQ" if wide else "<IIIBBH", data):
        if wide:
            name, info, _, section, value, size = fields
        else:
            name, value, size, info, _, section = fields
        index = base + section if 0 < section < section_count else 0
        symbols.append(ElfSymbol(_name_at(names, name), index, value, size, info & 15, info >> 4 == 1))
    return symbols


def _read_relocations(data: bytes, explicit: bool, wide: bool, body: bytes) -> list[tuple[int, int, int, int]]:
    """(offset, kind, symbol, addend) of each entry."""
    if wide:
        return [(o, i & 0xFFFFFFFF, i >> 32, a) for o, i, a in struct.iter_unpack("<QQq", data)]
    if explicit:
        return [(o, i & 0xFF, i >> 8, a) for o, i, a in struct.iter_unpack("<IIi", data)]
    return [(o, i & 0xFF, i >> 8, thumb_addend(body, o, i & 0xFF)) for o, i in struct.iter_unpack("<II", data)]
