"""How each instruction set encodes a distance: the PC-relative relocations LLVM emits for position independent code.

All offsets are in the linked block. A relocation writes "target + addend - place", as the ELF supplement of the
processor defines it; what is not in these tables is not position independent and is refused by the linker.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from plctool.image.targets import Machine


class X86(IntEnum):
    """Kinds of relocations by the names of the ELF supplement of each processor."""

    R_X86_64_64 = 1
    R_X86_64_PC32 = 2
    R_X86_64_PLT32 = 4
    R_X86_64_32 = 10


class Arm(IntEnum):
    R_ARM_ABS32 = 2
    R_ARM_REL32 = 3
    R_ARM_THM_CALL = 10
    R_ARM_THM_JUMP24 = 30
    R_ARM_THM_JUMP11 = 102


class AArch64(IntEnum):
    R_AARCH64_ABS64 = 257
    R_AARCH64_ABS32 = 258
    R_AARCH64_PREL32 = 261
    R_AARCH64_ADR_PREL_PG_HI21 = 275
    R_AARCH64_ADD_ABS_LO12_NC = 277
    R_AARCH64_LDST8_ABS_LO12_NC = 278
    R_AARCH64_JUMP26 = 282
    R_AARCH64_CALL26 = 283
    R_AARCH64_LDST16_ABS_LO12_NC = 284
    R_AARCH64_LDST32_ABS_LO12_NC = 285
    R_AARCH64_LDST64_ABS_LO12_NC = 286
    R_AARCH64_LDST128_ABS_LO12_NC = 299


class RiscV(IntEnum):
    R_RISCV_32 = 1
    R_RISCV_CALL_PLT = 19
    R_RISCV_PCREL_HI20 = 23
    R_RISCV_PCREL_LO12_I = 24
    R_RISCV_PCREL_LO12_S = 25
    R_RISCV_ADD32 = 35
    R_RISCV_SUB32 = 39
    R_RISCV_RELAX = 51  # a hint to the linker
    R_RISCV_32_PCREL = 57


@dataclass(frozen=True)
class Relocation:
    """`place`: where it is applied. `target`: offset of the symbol (without Thumb bit). `function`: the symbol is code.
    `paired`: target + addend of the relocation at `target` (RISC-V low parts refer to their high part), else 0."""

    place: int
    target: int
    addend: int
    function: bool = False
    paired: int = 0

    @property
    def distance(self) -> int:
        return self.target + self.addend - self.place


class OutOfReach(Exception):
    """The distance does not fit the instruction."""


Apply = Callable[[bytearray, Relocation], None]


def _fit(value: int, bits: int) -> int:
    """A signed value as `bits` bits."""
    if not -(1 << (bits - 1)) <= value < 1 << (bits - 1):
        raise OutOfReach
    return value & ((1 << bits) - 1)


def _word(code: bytearray, at: int) -> int:
    return int.from_bytes(code[at : at + 4], "little")


def _put_word(code: bytearray, at: int, value: int) -> None:
    code[at : at + 4] = (value & 0xFFFFFFFF).to_bytes(4, "little")


def _relative32(code: bytearray, r: Relocation) -> None:
    _put_word(code, r.place, _fit(r.distance, 32))


# ---- Thumb ----


def _thumb_relative32(code: bytearray, r: Relocation) -> None:
    _put_word(code, r.place, _fit(r.distance, 32) | r.function)


def _thumb_branch(code: bytearray, r: Relocation) -> None:
    """BL and B.W: S:I1:I2:imm10:imm11, the two I bits stored inverted relative to S."""
    offset = _fit(r.distance, 25)
    first, second = struct.unpack_from("<HH", code, r.place)
    sign = offset >> 24
    j1 = ~((offset >> 23) ^ sign) & 1
    j2 = ~((offset >> 22) ^ sign) & 1
    first = (first & 0xF800) | sign << 10 | (offset >> 12 & 0x3FF)
    second = (second & 0xD000) | j1 << 13 | j2 << 11 | (offset >> 1 & 0x7FF)
    struct.pack_into("<HH", code, r.place, first, second)


def _thumb_short_branch(code: bytearray, r: Relocation) -> None:
    offset = _fit(r.distance, 12)
    opcode = struct.unpack_from("<H", code, r.place)[0]
    struct.pack_into("<H", code, r.place, (opcode & 0xF800) | offset >> 1)


def thumb_addend(code: bytes, place: int, kind: int) -> int:
    """The addend that REL sections keep in place."""
    if kind in (Arm.R_ARM_ABS32, Arm.R_ARM_REL32):
        return int.from_bytes(code[place : place + 4], "little", signed=True)
    if kind == Arm.R_ARM_THM_JUMP11:
        value: int = (struct.unpack_from("<H", code, place)[0] & 0x7FF) << 1
        return value - 0x1000 if value & 0x800 else value
    first, second = struct.unpack_from("<HH", code, place)
    sign = first >> 10 & 1
    i1 = ~((second >> 13) ^ sign) & 1
    i2 = ~((second >> 11) ^ sign) & 1
    value = int(sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1)
    return value - (1 << 25) if sign else value


# ---- AArch64 ----


def _adrp(code: bytearray, r: Relocation) -> None:
    """ADRP becomes ADR: the exact address, so the block needs no alignment to pages (see `_low12`)."""
    offset = _fit(r.distance, 21)
    word = _word(code, r.place) & 0x0000001F
    _put_word(code, r.place, 0x10000000 | word | (offset & 3) << 29 | (offset >> 2 & 0x7FFFF) << 5)


def _low12(code: bytearray, r: Relocation) -> None:
    """The part that ADR has added already. The linker has checked that there is an ADRP of the same target."""
    _put_word(code, r.place, _word(code, r.place) & ~(0xFFF << 10))


def _aarch64_branch(code: bytearray, r: Relocation) -> None:
    _put_word(code, r.place, (_word(code, r.place) & 0xFC000000) | _fit(r.distance, 28) >> 2)


# ---- RISC-V ----


def _riscv_call(code: bytearray, r: Relocation) -> None:
    offset = _fit(r.distance, 32)
    _put_word(code, r.place, (_word(code, r.place) & 0xFFF) | (offset + 0x800 & 0xFFFFF000))
    _put_word(code, r.place + 4, (_word(code, r.place + 4) & 0xFFFFF) | (offset & 0xFFF) << 20)


def _riscv_high(code: bytearray, r: Relocation) -> None:
    _put_word(code, r.place, (_word(code, r.place) & 0xFFF) | (_fit(r.distance, 32) + 0x800 & 0xFFFFF000))


def _riscv_low(code: bytearray, r: Relocation) -> None:
    offset = r.paired - r.target
    _put_word(code, r.place, (_word(code, r.place) & 0xFFFFF) | (offset & 0xFFF) << 20)


def _riscv_low_store(code: bytearray, r: Relocation) -> None:
    offset = r.paired - r.target
    word = _word(code, r.place) & 0x01FFF07F
    _put_word(code, r.place, word | (offset >> 5 & 0x7F) << 25 | (offset & 0x1F) << 7)


def _riscv_add(code: bytearray, r: Relocation) -> None:
    """Entries of switch tables are differences: an addition and a subtraction at the same place."""
    _put_word(code, r.place, _word(code, r.place) + r.target + r.addend)


def _riscv_subtract(code: bytearray, r: Relocation) -> None:
    _put_word(code, r.place, _word(code, r.place) - r.target - r.addend)


AARCH64_LOW12 = frozenset(
    (
        AArch64.R_AARCH64_ADD_ABS_LO12_NC,
        AArch64.R_AARCH64_LDST8_ABS_LO12_NC,
        AArch64.R_AARCH64_LDST16_ABS_LO12_NC,
        AArch64.R_AARCH64_LDST32_ABS_LO12_NC,
        AArch64.R_AARCH64_LDST64_ABS_LO12_NC,
        AArch64.R_AARCH64_LDST128_ABS_LO12_NC,
    )
)
RISCV_LOW = frozenset((RiscV.R_RISCV_PCREL_LO12_I, RiscV.R_RISCV_PCREL_LO12_S))

_THUMB: dict[int, Apply] = {
    Arm.R_ARM_REL32: _thumb_relative32,
    Arm.R_ARM_THM_CALL: _thumb_branch,
    Arm.R_ARM_THM_JUMP24: _thumb_branch,
    Arm.R_ARM_THM_JUMP11: _thumb_short_branch,
}

APPLY: dict[Machine, dict[int, Apply]] = {
    Machine.X86_64: {X86.R_X86_64_PC32: _relative32, X86.R_X86_64_PLT32: _relative32},
    Machine.THUMB: _THUMB,
    Machine.THUMB_V6M: _THUMB,
    Machine.AARCH64: {
        AArch64.R_AARCH64_PREL32: _relative32,
        AArch64.R_AARCH64_ADR_PREL_PG_HI21: _adrp,
        AArch64.R_AARCH64_JUMP26: _aarch64_branch,
        AArch64.R_AARCH64_CALL26: _aarch64_branch,
        **dict.fromkeys(AARCH64_LOW12, _low12),
    },
    Machine.RISCV32: {
        RiscV.R_RISCV_CALL_PLT: _riscv_call,
        RiscV.R_RISCV_PCREL_HI20: _riscv_high,
        RiscV.R_RISCV_PCREL_LO12_I: _riscv_low,
        RiscV.R_RISCV_PCREL_LO12_S: _riscv_low_store,
        RiscV.R_RISCV_ADD32: _riscv_add,
        RiscV.R_RISCV_SUB32: _riscv_subtract,
        RiscV.R_RISCV_32_PCREL: _relative32,
    },
}

# Relocations of debugging information: kinds of absolute addresses, and their bytes.
ABSOLUTE: dict[Machine, dict[int, int]] = {
    Machine.X86_64: {X86.R_X86_64_64: 8, X86.R_X86_64_32: 4},
    Machine.THUMB: {Arm.R_ARM_ABS32: 4},
    Machine.THUMB_V6M: {Arm.R_ARM_ABS32: 4},
    Machine.AARCH64: {AArch64.R_AARCH64_ABS64: 8, AArch64.R_AARCH64_ABS32: 4},
    Machine.RISCV32: {RiscV.R_RISCV_32: 4},
}


_SLOTS = {Machine.THUMB: 4096 // 4, Machine.THUMB_V6M: 2 * 128 // 4, Machine.RISCV32: 2048 // 4}  # that a stub reaches


def stub(machine: Machine, slot: int) -> bytes:
    """Jumps to import `slot`; the base of the import table is in r9 (Thumb) or s11 (RISC-V). OutOfReach if there is
    none so far from it."""
    if slot >= _SLOTS[machine]:
        raise OutOfReach
    if machine is Machine.THUMB:  # ldr.w ip, [r9, #4*slot]; bx ip
        return struct.pack("<HHH", 0xF8D9, 0xC000 | 4 * slot, 0x4760)
    if (
        machine is Machine.THUMB_V6M
    ):  # push {r4}; mov r4, r9; adds r4, #128*n; ldr r4, [r4, #..]; mov ip, r4; pop {r4}; bx ip
        far, near = slot // 32, slot % 32
        return struct.pack("<HHHHHHH", 0xB410, 0x464C, 0x3400 | 128 * far, 0x6824 | near << 6, 0x46A4, 0xBC10, 0x4760)
    return struct.pack(
        "<II", 4 * slot << 20 | 27 << 15 | 2 << 12 | 6 << 7 | 0x03, 6 << 15 | 0x67
    )  # lw t1, (s11); jr t1
