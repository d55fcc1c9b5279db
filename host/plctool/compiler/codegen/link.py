"""The linker: one ELF object becomes one block of position independent code and constants without relocations.

Sections that are reached from the entries are laid out one after the other, PC-relative relocations between them are
applied, everything else (writable data, absolute addresses, undefined symbols) is refused with an error that names it.
"""

from __future__ import annotations

from collections.abc import Sequence

from plctool.compiler.codegen.compiler_calls import COMPILER_CALLS
from plctool.compiler.codegen.elf_object import ElfSymbol, Section, read_object
from plctool.compiler.codegen.line_table import Line, in_order, read_line_table
from plctool.compiler.codegen.lower_unit import import_symbol
from plctool.compiler.codegen.memory_functions import MEMORY_FUNCTIONS, memory_object
from plctool.compiler.codegen.object_cache import ObjectCache
from plctool.compiler.codegen.relocations import (
    AARCH64_LOW12,
    ABSOLUTE,
    APPLY,
    RISCV_LOW,
    AArch64,
    OutOfReach,
    Relocation,
    RiscV,
    stub,
)
from plctool.compiler.codegen.stack import Frames, read_frames
from plctool.compiler.typed.nodes import External
from plctool.errors import UsageError
from plctool.iec.types import align_up
from plctool.image.targets import Machine, Target
from plctool.records import dataclass

_THUMBS = (Machine.THUMB, Machine.THUMB_V6M)
_STUB_ALIGN = 2  # bytes: instructions of the processors with stubs are of 16 bits, or of two such units


@dataclass(frozen=True)
class LinkedSymbol:
    """A function or constant of the block: byte offset (of the instruction, without a Thumb bit) and size."""

    offset: int
    size: int


@dataclass(frozen=True)
class Linked:
    """`code`: the block. `lines`: sorted by address, an address being an offset in the block. `debug`: the objects with
    nothing but their debugging information, in which addresses are such offsets too, or -1 outside of the block.
    `imports`: the C functions of the program and the compiler calls, in the order of their slots. `stubs`: those that
    are called by jumps in the block, by the offset of the jump. `frames`: of the functions."""

    code: bytes
    symbols: dict[str, LinkedSymbol]
    lines: list[Line]
    debug: list[bytes]
    imports: list[External]
    stubs: dict[int, External]
    frames: Frames


def link(
    objects: Sequence[bytes],
    target: Target,
    roots: Sequence[str],
    imports: Sequence[External],
    cache: ObjectCache | None = None,
) -> Linked:
    """Links the objects of one program. `roots`: symbols that have to be in the block. `imports`: C functions that the
    program names, in the order of their slots. `cache`: has the functions that all programs share.

    Raises UsageError naming what cannot be linked.
    """
    return _Linker(objects, target, imports, cache).run(roots)


class _Linker:
    def __init__(
        self, objects: Sequence[bytes], target: Target, imports: Sequence[External], cache: ObjectCache | None
    ) -> None:
        self._target = target
        self._imports = {import_symbol(external.name): external for external in imports}
        self._sections: list[Section] = []
        self._symbols: list[ElfSymbol] = []
        self._objects: list[tuple[list[Section], bytes]] = []
        for data in objects:
            self._read(data)
        if any(not s.section and s.name in MEMORY_FUNCTIONS for s in self._symbols):
            self._read(memory_object(target, cache))
        self._defined = {s.name: s for s in self._symbols if s.section and s.is_global}
        self._stubs: dict[str, int] = {}  # offset in the block, by symbol

    def _read(self, data: bytes) -> None:
        sections, symbols = read_object(data, self._target, len(self._sections))
        self._objects.append((sections, data))
        self._sections += sections
        self._symbols += symbols

    def run(self, roots: Sequence[str]) -> Linked:
        used = self._reach({self._defined[name].section for name in roots})
        code = self._lay_out(used)
        self._add_stubs(code, used)
        for index in used:
            self._apply(code, self._sections[index])
        symbols = {
            s.name: LinkedSymbol(self._address(s), s.size)
            for s in self._symbols
            if s.section in used and s.name and not s.name.startswith((".", "$"))
        }
        stubs = {offset: self._imports[name] for name, offset in self._stubs.items()}
        self._relocate_debug()
        debug = [_only_debug(sections, data) for sections, data in self._objects]
        return Linked(bytes(code), symbols, self._lines(), debug, [*self._imports.values()], stubs, self._frames())

    def _reach(self, start: set[int]) -> list[int]:
        """The sections that the given ones refer to, directly or not, code first."""
        found, todo = set(start), list(start)
        while todo:
            section = self._sections[todo.pop()]
            for _, _, symbol, _ in section.relocations:
                index = self._resolved(symbol).section
                if index and index not in found:
                    found.add(index)
                    todo.append(index)
        for index in found:
            section = self._sections[index]
            if section.is_writable or not section.is_allocated:
                raise UsageError(
                    f"The program needs the writable section {section.name}, which the image has no room for; "
                    "please report this as a bug of plctool.",
                    "link",
                )
        return sorted(found, key=lambda i: (not self._sections[i].is_executable, i))

    def _lay_out(self, used: list[int]) -> bytearray:
        code = bytearray()
        for index in used:
            section = self._sections[index]
            code += bytes(align_up(len(code), section.align) - len(code))
            section.offset = len(code)
            code += section.data
        return code

    def _add_stubs(self, code: bytearray, used: list[int]) -> None:
        """A jump through the import table for every C function and compiler call that is called by its symbol."""
        wanted = (self._resolved(symbol) for i in used for _, _, symbol, _ in self._sections[i].relocations)
        names = sorted({symbol.name for symbol in wanted if not symbol.section})
        calls = [name for name in names if name not in self._imports]
        unknown = [name for name in calls if not self._target.stubs or name not in COMPILER_CALLS]
        if unknown:
            raise UsageError(
                f"The target {self._target.name} has no {', '.join(unknown)}, which the program needs.",
                "undefined-symbol",
            )
        self._imports |= {name: COMPILER_CALLS[name] for name in calls}
        for slot, (name, external) in enumerate(self._imports.items()):
            if name not in names:
                continue
            code += bytes(align_up(len(code), _STUB_ALIGN) - len(code))
            self._stubs[name] = len(code)
            try:
                code += stub(self._target.machine, slot)
            except OutOfReach:
                raise self._too_large(
                    f"its imports and its functions of arithmetic ({external.name}) are too many"
                ) from None

    def _too_large(self, why: str) -> UsageError:
        return UsageError(f"The program is too large for {self._target.name}: {why}.", "too-large")

    def _resolved(self, symbol: ElfSymbol) -> ElfSymbol:
        """The definition, which may be in another object, or the symbol itself when there is none."""
        return symbol if symbol.section else self._defined.get(symbol.name, symbol)

    def _address(self, symbol: ElfSymbol) -> int:
        symbol = self._resolved(symbol)
        if not symbol.section:
            return self._stubs[symbol.name]
        value = symbol.value & ~1 if symbol.is_function and self._target.machine in _THUMBS else symbol.value
        return self._sections[symbol.section].offset + value

    def _apply(self, code: bytearray, section: Section) -> None:
        table = APPLY[self._target.machine]
        high = {
            section.offset + offset: self._address(symbol) + addend
            for offset, kind, symbol, addend in section.relocations
            if kind == RiscV.R_RISCV_PCREL_HI20 and self._target.machine is Machine.RISCV32
        }
        self._check_pages(section)
        for offset, kind, symbol, addend in section.relocations:
            if self._target.machine is Machine.RISCV32 and kind == RiscV.R_RISCV_RELAX:
                continue
            symbol = self._resolved(symbol)
            target = self._address(symbol)
            paired = high[target] if self._target.machine is Machine.RISCV32 and kind in RISCV_LOW else 0
            function = symbol.is_function or not symbol.section
            apply = table.get(kind)
            if apply is None:
                raise UsageError(
                    f"Relocation type {kind} against '{symbol.name}' in {section.name} is not position independent; "
                    "please report this as a bug of plctool.",
                    "link",
                )
            try:
                apply(code, Relocation(section.offset + offset, target, addend, function, paired))
            except OutOfReach:
                raise self._too_large(f"'{symbol.name}' is out of reach of its caller") from None

    def _check_pages(self, section: Section) -> None:
        """AArch64: every low part must have the ADRP of exactly its target, which becomes an ADR."""
        if self._target.machine is not Machine.AARCH64:
            return
        pages = {(r[2], r[3]) for r in section.relocations if r[1] == AArch64.R_AARCH64_ADR_PREL_PG_HI21}
        for _, kind, symbol, addend in section.relocations:
            if kind in AARCH64_LOW12 and (symbol, addend) not in pages:
                raise UsageError(
                    f"A reference to '{symbol.name}' shares its page address with another one; "
                    "please report this as a bug of plctool.",
                    "link",
                )

    def _relocate_debug(self) -> None:
        """Addresses become offsets in the block, -1 for what is no part of it."""
        widths = ABSOLUTE[self._target.machine]
        for section in self._sections:
            if not section.is_debug:
                continue
            data = bytearray(section.data)
            for offset, kind, symbol, addend in section.relocations:
                width = widths.get(kind, 0)
                value = self._debug_address(symbol, addend) & ((1 << 8 * width) - 1)
                data[offset : offset + width] = value.to_bytes(width, "little")
            section.data = bytes(data)

    def _debug_address(self, symbol: ElfSymbol, addend: int) -> int:
        target = self._sections[symbol.section]
        if target.is_debug:
            return symbol.value + addend
        return self._address(symbol) + addend if target.offset >= 0 else -1

    def _frames(self) -> Frames:
        found: Frames = {}
        for section in self._sections:
            if section.name == ".debug_frame":
                found |= read_frames(section.data, self._target.pointer_size)
        return found

    def _lines(self) -> list[Line]:
        """The line tables of the sections in the block."""
        tables = [section.data for section in self._sections if section.name == ".debug_line"]
        return in_order([line for table in tables for line in read_line_table(table) if line.address < 1 << 31])


def _only_debug(sections: list[Section], data: bytes) -> bytes:
    """An object with its debugging information as it is now, without code and relocations; all keeps its place."""
    kept = bytearray(data)
    for section in sections:
        size = len(section.data)
        if section.is_debug:
            kept[section.place : section.place + size] = section.data
        elif section.is_allocated or section.name.startswith(".rel"):
            kept[section.place : section.place + size] = bytes(size)
    return bytes(kept)
