"""The registers of the processor at the fault that stopped a program, with their names."""

from __future__ import annotations

from dataclasses import dataclass

from plctool.core import lib


def _numbered(prefix: str, first: int, last: int) -> tuple[str, ...]:
    return tuple(f"{prefix}{number}" for number in range(first, last + 1))


# In the order of EXCEPT_REGISTERS_* (SysExcept.h).
_NAMES: dict[int, tuple[str, ...]] = {
    lib.EXCEPT_REGISTERS_ARMV7M: (*_numbered("r", 0, 12), "sp", "lr", "pc", "xpsr", "cfsr", "fault_address"),
    lib.EXCEPT_REGISTERS_RISCV32: (
        "ra", "sp", *_numbered("t", 0, 6), *_numbered("a", 0, 7), *_numbered("s", 0, 11), "pc", "mcause", "mtval",
    ),
    lib.EXCEPT_REGISTERS_X86_64: (
        "rax", "rbx", "rcx", "rdx", "rsi", "rdi", "rbp", "rsp", *_numbered("r", 8, 15), "rip", "eflags",
        "fault_address",
    ),
    lib.EXCEPT_REGISTERS_AARCH64: (*_numbered("x", 0, 30), "sp", "pc", "pstate", "fault_address"),
    lib.EXCEPT_REGISTERS_ARM: (*_numbered("r", 0, 12), "sp", "lr", "pc", "cpsr", "fault_address"),
}  # fmt: skip


@dataclass(frozen=True)
class Registers:
    """`kind`: EXCEPT_REGISTERS_*; `values`: in their order; `size`: bytes of each."""

    kind: int
    values: tuple[int, ...]
    size: int

    @staticmethod
    def of_words(content: bytes, size: int) -> Registers | None:
        """From TAG_APP_REGISTERS with words of `size` bytes. None if the names of the registers are not known."""
        kind, words = int.from_bytes(content[:4], "little"), content[4:]
        values = (int.from_bytes(words[i : i + size], "little") for i in range(0, len(words), size))
        return Registers.checked(kind, tuple(values), size)

    @staticmethod
    def checked(kind: int, values: tuple[int, ...], size: int) -> Registers | None:
        """The same of numbers from elsewhere."""
        return Registers(kind, values, size) if len(_NAMES.get(kind, ())) == len(values) > 0 else None

    def named(self) -> dict[str, int]:
        return dict(zip(_NAMES[self.kind], self.values, strict=True))

    def lines(self) -> list[str]:
        """A table, four registers in a line."""
        cells = [f"{name:>6} {value:0{2 * self.size}x}" for name, value in self.named().items()]
        return ["  " + "".join(cells[i : i + 4]) for i in range(0, len(cells), 4)]
