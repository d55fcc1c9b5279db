"""Kinds of relocations have the numbers that pyelftools has for their names."""

from __future__ import annotations

import re
from enum import IntEnum

import pytest
from elftools.elf import enums

from plctool.compiler.codegen.relocations import ABSOLUTE, APPLY, X86, AArch64, Arm, RiscV
from plctool.image.targets import Machine

KNOWN = {
    X86: enums.ENUM_RELOC_TYPE_x64,
    Arm: enums.ENUM_RELOC_TYPE_ARM,
    AArch64: enums.ENUM_RELOC_TYPE_AARCH64,
}
ADDED = {"R_AARCH64_LDST128_ABS_LO12_NC"}  # in the ELF supplement, not in pyelftools
KINDS = {
    Machine.X86_64: X86, Machine.THUMB: Arm, Machine.THUMB_V6M: Arm, Machine.AARCH64: AArch64, Machine.RISCV32: RiscV,
}  # fmt: skip


@pytest.mark.parametrize("kinds", KNOWN, ids=lambda kinds: kinds.__name__)
def test_a_name_has_its_number(kinds: type[IntEnum]) -> None:
    known = KNOWN[kinds]
    wrong = {kind.name: (kind.value, known.get(kind.name)) for kind in kinds if known.get(kind.name) != kind.value}
    assert set(wrong) <= ADDED, wrong


@pytest.mark.parametrize("machine", Machine, ids=lambda machine: machine.name)
def test_the_tables_of_a_machine_hold_its_own_kinds(machine: Machine) -> None:
    foreign = [kind for kind in (*APPLY[machine], *ABSOLUTE[machine]) if not isinstance(kind, KINDS[machine])]
    assert foreign == []
    assert all(re.match(r"R_(X86_64|ARM|AARCH64|RISCV)_", kind.name) for kind in KINDS[machine])
