"""How much stack the C functions of a firmware take, from its instructions: an upper bound, as if each way through a
function were taken."""

from __future__ import annotations

import re
import subprocess
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from struct import unpack

from elftools.elf.elffile import ELFFile
from environment import ROOT

_FUNCTION = re.compile(r"([0-9a-f]+) <.+>:$")
_INSTRUCTION = re.compile(r"\s*[0-9a-f]+:\s+(\S+)\s*(.*)")
_PLACE = re.compile(r"\b([0-9a-f]+) <[^+>]+>")  # where a function begins
_SAVES = "jal t0,"  # RISC-V: a call of what pushes for its caller
_ENTRY = re.compile(r'\{"(\w+)", (0x[0-9A-F]{8}), \w+, \(RTS_PFN\)')
_VERSION = 0x00010000
_WORD = 4  # bytes


class Stacks:
    """Of a firmware. Functions are addresses."""

    def __init__(self, elf: Path, is_riscv: bool) -> None:
        prefix = "riscv64-unknown-elf-" if is_riscv else "arm-none-eabi-"
        command = [f"{prefix}objdump", "-d", "--no-show-raw-insn", str(elf)]
        text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        self._own: dict[int, int] = {}
        self._called: dict[int, set[int]] = defaultdict(set)
        saving: list[tuple[int, int]] = []
        pushed = _pushed_by_riscv if is_riscv else _pushed_by_arm
        function = 0
        for line in text.splitlines():
            if found := _FUNCTION.match(line):
                function = int(found[1], 16)
                self._own[function] = 0
            elif found := _INSTRUCTION.match(line):
                self._own[function] += pushed(found[1], found[2])
                if place := _PLACE.search(found[2]):
                    target = int(place[1], 16)
                    if f"{found[1]} {found[2]}".startswith(_SAVES):
                        saving.append((function, target))
                    elif target != function:
                        self._called[function].add(target)
        for function, target in saving:
            self._own[function] += self._own[target]

    def deepest(self, function: int, *path: int) -> int:
        """Bytes that a call takes."""
        assert function not in path, f"the function at {function:x} calls itself"
        called = (self.deepest(target, *path, function) for target in self._called[function] if target in self._own)
        return self._own[function] + max(called, default=0)


def _pushed_by_arm(name: str, operands: str) -> int:
    if name.startswith(("push", "vpush")) or (name.startswith("stmdb") and operands.startswith("sp!")):
        return sum(map(_size_of_registers, operands[operands.index("{") + 1 : operands.index("}")].split(",")))
    if name.startswith("sub") and operands.startswith("sp"):
        return int(operands.split("#")[1].split()[0])
    found = re.search(r"\[sp, #-(\d+)\]!", operands)
    return int(found[1]) if found else 0


def _size_of_registers(text: str) -> int:
    """Of a register or a range of them, such as d8-d15."""
    names = text.strip().split("-")
    size = 2 * _WORD if names[0].startswith("d") else _WORD
    return size * (1 if len(names) == 1 else int(names[1][1:]) - int(names[0][1:]) + 1)


def _pushed_by_riscv(name: str, operands: str) -> int:
    found = re.match(r"sp,sp,-(\d+)", operands)
    return int(found[1]) if found and name in ("add", "addi", "c.addi16sp") else 0


def c_functions(elf: Path) -> Iterator[tuple[str, int]]:
    """The functions that a firmware offers, and their addresses: the entries of CMP_EXT_FUNCTION in its sources."""
    sources = (path.read_text() for path in (ROOT / "firmware").rglob("*.c"))
    names = {int(signature, 16): name for text in sources for name, signature in _ENTRY.findall(text)}
    with elf.open("rb") as file:
        pieces = [s.data() for s in ELFFile(file).iter_segments("PT_LOAD")]
    for data in pieces:
        words = unpack(f"<{len(data) // _WORD}I", data[: len(data) // _WORD * _WORD])
        for signature, version, function in zip(words, words[1:], words[2:], strict=False):
            if signature in names and version == _VERSION:
                yield names[signature], function & ~1
