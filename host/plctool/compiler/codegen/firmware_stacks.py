"""How much stack the C functions of a firmware take, by the frames and the calls in its ELF file. It says so if it was
built with debugging information (-g)."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from elftools.common.exceptions import ELFError
from elftools.elf.constants import SH_FLAGS
from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection

from plctool.compiler.codegen.calls import calls_by_pointer
from plctool.compiler.codegen.stack import CallGraph, Frames, read_frames
from plctool.errors import UsageError
from plctool.image.targets import Machine

_WITHOUT_FRAME = 32  # bytes, more than a routine of a compiler takes that is written in assembler
_ALIGN = 16  # bytes, to which a stack pointer may be rounded before a call
_WORD = 4  # bytes


class FirmwareStacks:
    """Of an ELF file for a 32-bit processor."""

    def __init__(self, path: Path, machine: Machine) -> None:
        """Raises UsageError when the file is damaged."""
        self._machine = machine
        try:
            with path.open("rb") as file:
                elf = ELFFile(file)
                self._memory = [segment.data() for segment in elf.iter_segments("PT_LOAD")]
                self._code = _largest_code(elf)
                section = elf.get_section_by_name(".debug_frame")
                frames = {} if section is None else read_frames(section.data(), _WORD, self._code.address)
        except (ELFError, OSError) as error:
            raise UsageError(f"The firmware {path} cannot be read ({error}); link it again.", "bad-firmware") from None
        known = {begin: frame for begin, frame in frames.items() if self._code.has(begin)}
        self._frames = _with_assembler(known, self._code) if known else {}
        self._graph = CallGraph(self._code.data, machine, self._frames, self._code.functions.keys())

    def of_function(self, signature: int, *, with_pointers: bool = False) -> int | None:
        """Bytes of stack that a call takes, with all that it calls; None if that is not known: the function is not in
        the file, calls itself, or calls by pointer, unless that does not matter (`with_pointers`)."""
        sizes = [self._of_function(function, with_pointers) for function in self._functions(signature)]
        known = [size for size in sizes if size is not None]
        return max(known) if known and len(known) == len(sizes) else None

    def _functions(self, signature: int) -> Iterator[int]:
        """Where tables of components (CMP_EXT_FUNCTION) have a signature: signature, version, address."""
        wanted = signature.to_bytes(_WORD, "little")
        for data in self._memory:
            at = data.find(wanted)
            while at >= 0:
                address = int.from_bytes(data[at + 2 * _WORD : at + 3 * _WORD], "little") & ~1
                offset = address - self._code.address
                function = self._graph.function_at(offset)
                if at % _WORD == 0 and offset in self._code.functions and function is not None:
                    yield function
                at = data.find(wanted, at + 1)

    def _of_function(self, function: int, with_pointers: bool) -> int | None:
        below = self._graph.below(function)
        try:
            TopologicalSorter(below).prepare()
        except CycleError:
            return None
        if any(map(self._graph.leaves, below)) or (not with_pointers and any(map(self._calls_by_pointer, below))):
            return None
        size = sum(frame for _, frame in self._graph.deepest([function]))
        return -(-size // _ALIGN) * _ALIGN

    def _calls_by_pointer(self, function: int) -> bool:
        pieces = self._code.instructions(function, function + self._frames[function][0])
        return any(calls_by_pointer(piece, self._machine) for piece in pieces)


@dataclass(frozen=True)
class _Code:
    """A section with code. By offset: `functions`, also those elsewhere, with their sizes in bytes, and `marks`, where
    instructions (true) or data begin."""

    address: int
    data: bytes
    functions: dict[int, int]
    marks: list[tuple[int, bool]]

    def has(self, offset: int) -> bool:
        """Whether something is in the section."""
        return 0 <= offset < len(self.data)

    def instructions(self, begin: int, end: int) -> Iterator[bytes]:
        """What is between the data."""
        at = bisect_right(self.marks, (begin, True))
        are_instructions = at == 0 or self.marks[at - 1][1]
        for mark, follows in [*self.marks[at:], (end, False)]:
            if are_instructions:
                yield self.data[begin : min(mark, end)]
            if mark >= end:
                break
            begin, are_instructions = mark, follows


def _largest_code(elf: ELFFile) -> _Code:
    """The section with most code."""
    sections = (s for s in elf.iter_sections("SHT_PROGBITS") if s["sh_flags"] & SH_FLAGS.SHF_EXECINSTR)
    section = max(sections, key=lambda s: int(s["sh_size"]), default=None)
    table = elf.get_section_by_name(".symtab")
    if section is None or not isinstance(table, SymbolTableSection):
        return _Code(0, b"", {}, [])
    address = int(section["sh_addr"])
    functions: dict[int, int] = {}
    marks = []
    for symbol in table.iter_symbols():
        offset = (int(symbol["st_value"]) & ~1) - address
        if symbol["st_info"]["type"] == "STT_FUNC":
            functions[offset] = max(functions.get(offset, 0), int(symbol["st_size"]))
        elif symbol.name[:2] in ("$t", "$x", "$d"):  # mapping symbols, as the ABIs of both families call them
            marks.append((offset, symbol.name[1] != "d"))
    return _Code(address, section.data(), functions, sorted(marks))


def _with_assembler(frames: Frames, code: _Code) -> Frames:
    """The frames, and an allowance for functions without, which are written in assembler."""
    starts = sorted(frames)
    found = dict(frames)
    for begin, size in code.functions.items():
        at = bisect_right(starts, begin) - 1
        if code.has(begin) and (at < 0 or begin >= starts[at] + frames[starts[at]][0]):
            found[begin] = (size, _WITHOUT_FRAME)
    return found
