"""Which function of the linked block calls which, by its instructions.

Calls within one section leave no relocation, and what LLVM has inlined is no call any more. Data between instructions
may look like a call; one counts only if it leads to exactly where a function begins.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator, Set
from dataclasses import dataclass

from plctool.compiler.codegen.relocations import Arm, thumb_addend
from plctool.image.targets import Machine


@dataclass(frozen=True)
class Branch:
    """At `place` to `target`. `returns`: a call; else a jump, for which the caller has given its frame back."""

    place: int
    target: int
    returns: bool


def branches(code: bytes, machine: Machine, entries: Set[int]) -> Iterator[Branch]:
    """All that lead to one of `entries`, offsets of functions."""
    return (branch for branch in _READ[machine](code, entries) if branch.target in entries)


# CALL, JMP and conditional jumps with 4 bytes of distance; jumps with one.
_X86_FAR = re.compile(rb"(?s)(?=(\xe8|\xe9|\x0f[\x80-\x8f])(....))")
_X86_NEAR = re.compile(rb"(?s)(?=(?:\xeb|[\x70-\x7f])(.))")
# BL and B.W; B.
_THUMB_FAR = re.compile(rb"(?s)(?=.[\xf0-\xf7].[\x90-\x9f\xb0-\xbf\xd0-\xdf\xf0-\xff])")
_THUMB_NEAR = re.compile(rb"(?s)(?=.[\xe0-\xe7])")


def _x86(code: bytes, _: Set[int]) -> Iterator[Branch]:
    for match in _X86_FAR.finditer(code):
        distance = int.from_bytes(match[2], "little", signed=True)
        yield Branch(match.start(), match.end(2) + distance, match[1] == b"\xe8")
    for match in _X86_NEAR.finditer(code):
        yield Branch(match.start(), match.end(1) + _signed(match[1][0], 8), False)


def _thumb(code: bytes, _: Set[int]) -> Iterator[Branch]:
    for match in _THUMB_FAR.finditer(code):
        place = match.start()
        if place % 2 == 0:
            distance = thumb_addend(code, place, Arm.R_ARM_THM_CALL)
            yield Branch(place, place + 4 + distance, bool(code[place + 3] & 0x40))
    for match in _THUMB_NEAR.finditer(code):
        place = match.start()
        if place % 2 == 0:
            yield Branch(place, place + 4 + thumb_addend(code, place, Arm.R_ARM_THM_JUMP11), False)


def _aarch64(code: bytes, _: Set[int]) -> Iterator[Branch]:
    for place, (word,) in zip(range(0, len(code), 4), struct.iter_unpack("<I", _whole(code)), strict=False):
        if word & 0x7C00_0000 == 0x1400_0000:
            yield Branch(place, place + 4 * _signed(word & 0x03FF_FFFF, 26), bool(word >> 31))


def _riscv(code: bytes, entries: Set[int]) -> Iterator[Branch]:
    """AUIPC with JALR, JAL, C.JAL and C.J. The link register is x1; a jump has none."""
    for place in _riscv_instructions(code, entries):
        half = int.from_bytes(code[place : place + 2], "little")
        word = int.from_bytes(code[place : place + 4], "little")
        following = int.from_bytes(code[place + 4 : place + 8], "little")
        if word & 0x7F == 0x17 and following & 0x7F == 0x67 and following >> 15 & 31 == word >> 7 & 31:
            distance = _signed(word & 0xFFFF_F000, 32) + _signed(following >> 20, 12)
            yield Branch(place, place + distance, following >> 7 & 31 == 1)
        elif word & 0x7F == 0x6F:
            distance = word >> 31 << 20 | (word >> 12 & 0xFF) << 12 | (word >> 20 & 1) << 11 | (word >> 21 & 0x3FF) << 1
            yield Branch(place, place + _signed(distance, 21), word >> 7 & 31 == 1)
        elif half & 0x6003 == 0x2001:
            bits = half >> 2
            distance = (
                (bits & 1) << 5 | (bits >> 1 & 7) << 1 | (bits >> 4 & 1) << 7 | (bits >> 5 & 1) << 6
                | (bits >> 6 & 1) << 10 | (bits >> 7 & 3) << 8 | (bits >> 9 & 1) << 4 | (bits >> 10 & 1) << 11
            )  # fmt: skip
            yield Branch(place, place + _signed(distance, 12), not half & 0x8000)


def _riscv_instructions(code: bytes, entries: Set[int]) -> Iterator[int]:
    """Yields where instructions begin. Each function begins one, whatever stands before it; none has data within."""
    place = 0
    while place + 2 <= len(code):
        yield place
        is_long = code[place] & 3 == 3
        place += 4 if is_long and place + 2 not in entries else 2


def _signed(value: int, bits: int) -> int:
    return value - (1 << bits) if value >> (bits - 1) & 1 else value


def _whole(code: bytes) -> bytes:
    return code + bytes(-len(code) % 4)


def calls_by_pointer(code: bytes, machine: Machine) -> bool:
    """Whether code of a 32-bit processor, without data in it, calls or jumps to what a register or a constant in memory
    says. On RISC-V a jump to one of many cases looks the same."""
    is_riscv = machine is Machine.RISCV32
    at = 0
    while at + 2 <= len(code):
        half, next_half = (int.from_bytes(code[i : i + 2], "little") for i in (at, at + 2))
        if is_riscv:
            is_long = half & 3 == 3
            found = half & 0xE07F == 0x8002 and half not in _RISCV_OTHERS  # C.JR, C.JALR
        else:
            is_long = half >> 11 in (0x1D, 0x1E, 0x1F)
            found = half & 0xFF07 == 0x4700 and half != 0x4770  # BX and BLX, but BX LR
            found |= half & 0xFF7F == 0xF85F and next_half >> 12 == 15  # LDR PC, [PC, ...] of what the linker inserts
        if found:
            return True
        at += 4 if is_long else 2
    return False


_RISCV_OTHERS = (0x8082, 0x8282, 0x9002)  # C.JR ra and t0, which return, and C.EBREAK


_READ: dict[Machine, Callable[[bytes, Set[int]], Iterator[Branch]]] = {
    Machine.X86_64: _x86,
    Machine.THUMB: _thumb,
    Machine.THUMB_V6M: _thumb,
    Machine.AARCH64: _aarch64,
    Machine.RISCV32: _riscv,
}
