"""The processors plctool compiles for. A target is one entry of this table; other code does not depend on its name."""

from __future__ import annotations

import platform
import struct
import sys
from dataclasses import dataclass
from enum import Enum

from plctool.errors import UsageError

_ARMV7_POINTER = 4  # bytes
FASTEST = 3  # the level of optimisation that is for speed only


class Machine(Enum):
    """Instruction sets, as far as the linker distinguishes them."""

    X86_64 = "x86_64"
    AARCH64 = "aarch64"
    THUMB = "thumb"
    THUMB_V6M = "thumb-v6m"
    RISCV32 = "riscv32"


@dataclass(frozen=True)
class Target:
    """What the compiler has to know about a processor.

    `device_id` names a TARGET_ID_* of CompactDownload.h. `stubs`: undefined compiler calls (soft float, 64-bit
    division) go through the import table, whose base is in a reserved register. `unaligned`: loads and stores of any
    size work at any address. `vectors`: 16-byte vector compares are cheap. `registers`: that carry arguments inside the
    image, for addresses and integers, and for reals (0: reals are like integers). `probes`: a function that is entered
    touches each page of its frame, so that a large one does not pass over the guard at the end of the stack.
    `hosted`: programs run in a process of Linux or Windows, with memory in plenty. `divides`: an instruction divides
    words.
    `features_for_speed`: those of level 3 besides. A processor that executes one instruction after the other gains
    nothing from their order, and the search for a good one costs registers.
    """

    name: str
    triple: str
    cpu: str
    features: str
    machine: Machine
    device_id: str
    pointer_size: int
    registers: tuple[int, int]
    stubs: bool
    unaligned: bool
    vectors: bool = False
    abi: str = ""
    probes: bool = False
    hosted: bool = False
    divides: bool = True
    external_convention: str = ""  # LLVM calling convention of C functions; "" is the default
    features_for_speed: str = ""

    @property
    def exchanges(self) -> bool:
        """Whether the processor compares and exchanges a word in one step, as tasks that interrupt each other need."""
        return self.machine is not Machine.THUMB_V6M

    @property
    def has_fpu(self) -> bool:
        """Whether the processor has registers for REAL."""
        return self.registers[1] > 0

    @property
    def small_flash(self) -> bool:
        """Whether programs are in a small flash."""
        return not self.hosted

    @property
    def shortens(self) -> bool:
        """Whether instructions are of different length, and the short ones reach only some of the registers."""
        return self.small_flash and self.machine is not Machine.THUMB_V6M

    @property
    def divides_words(self) -> bool:
        """Whether words are as easy to divide by constants as smaller numbers are, or easier."""
        return self.machine in (Machine.THUMB, Machine.RISCV32) and self.divides

    def saves_room(self, opt_level: int) -> bool:
        """Whether code for a small flash is to stay small, at that level of optimisation."""
        return self.small_flash and opt_level < FASTEST


TARGETS: dict[str, Target] = {
    t.name: t
    for t in (
        Target(
            "x86_64-linux", "x86_64-unknown-linux-gnu", "x86-64", "", Machine.X86_64, "TARGET_ID_X86_64_LINUX",
            pointer_size=8, registers=(6, 8), stubs=False, unaligned=True, vectors=True, probes=True, hosted=True,
        ),
        Target(  # x18 is the system's on macOS, where the simulator runs the same code
            "aarch64-linux", "aarch64-unknown-linux-gnu", "generic", "+reserve-x18", Machine.AARCH64,
            "TARGET_ID_AARCH64_LINUX",
            pointer_size=8, registers=(8, 8), stubs=False, unaligned=True, probes=True, hosted=True,
        ),
        Target(  # of the simulator on Windows: as on Linux in all but the C functions that programs call
            "x86_64-windows", "x86_64-unknown-linux-gnu", "x86-64", "", Machine.X86_64, "TARGET_ID_X86_64_WINDOWS",
            pointer_size=8, registers=(6, 8), stubs=False, unaligned=True, vectors=True, probes=True, hosted=True,
            external_convention="win64cc",
        ),
        Target(  # what Debian's armhf runs on: a Cortex-A8 neither divides nor has all of the others' registers
            "armv7-linux", "thumbv7a-none-unknown", "generic", "+reserve-r9,-neon,-d32", Machine.THUMB,
            "TARGET_ID_ARMV7_LINUX", pointer_size=4, registers=(4, 8), stubs=True, unaligned=True, hosted=True,
            divides=False, external_convention="arm_aapcs_vfpcc",
        ),
        Target(
            "cortex-m0", "thumbv6m-none-unknown", "cortex-m0", "+reserve-r9", Machine.THUMB_V6M, "TARGET_ID_CORTEX_M0",
            pointer_size=4, registers=(4, 0), stubs=True, unaligned=False, divides=False,
        ),
        Target(
            "cortex-m3", "thumbv7m-none-unknown", "cortex-m3", "+reserve-r9", Machine.THUMB, "TARGET_ID_CORTEX_M3",
            pointer_size=4, registers=(4, 0), stubs=True, unaligned=True, features_for_speed="-use-misched",
        ),
        Target(
            "cortex-m4f", "thumbv7em-none-unknown", "cortex-m4", "+reserve-r9", Machine.THUMB, "TARGET_ID_CORTEX_M4F",
            pointer_size=4, registers=(4, 8), stubs=True, unaligned=True,
            external_convention="arm_aapcs_vfpcc", features_for_speed="-use-misched",
        ),
        Target(
            "cortex-m7", "thumbv7em-none-unknown", "cortex-m7", "+reserve-r9,-fp64", Machine.THUMB,
            "TARGET_ID_CORTEX_M7", pointer_size=4, registers=(4, 8), stubs=True, unaligned=True,
            external_convention="arm_aapcs_vfpcc",
        ),
        Target(
            "rv32imac", "riscv32-unknown-unknown", "generic-rv32", "+m,+a,+c,-relax,+reserve-x27", Machine.RISCV32,
            "TARGET_ID_RV32IMAC", pointer_size=4, registers=(8, 0), stubs=True, unaligned=False, abi="ilp32",
        ),
    )
}  # fmt: skip

DEFAULT_TARGET = "x86_64-linux"


def host_target() -> str:
    """The target whose programs run in this process."""
    machine = platform.machine()
    if sys.platform == "win32":
        return "x86_64-windows"
    if struct.calcsize("P") == _ARMV7_POINTER and machine.startswith(("arm", "aarch64")):
        machine = "armv7"  # also a process of 32 bits on a kernel of 64
    elif machine == "arm64":
        machine = "aarch64"  # as macOS names it
    here = f"{machine}-linux"
    return here if here in TARGETS else DEFAULT_TARGET


def find_target(name: str) -> Target:
    """The table entry of `name`. Raises UsageError listing the known names."""
    target = TARGETS.get(name)
    if target is None:
        raise UsageError(f"There is no target '{name}'; choose one of {', '.join(TARGETS)}.", "unknown-target")
    return target
