"""Reads the DWARF 4 line table that LLVM writes: which code offset belongs to which source line."""

from __future__ import annotations

import struct
from dataclasses import dataclass

_SET_ADDRESS, _END_SEQUENCE = 2, 1


@dataclass(frozen=True)
class Line:
    """Code from `address` up to the next entry belongs to `line` of `file`; line 0 is code without a source line."""

    address: int
    file: str
    line: int


class _Reader:
    def __init__(self, data: bytes, at: int = 0) -> None:
        self.data = data
        self.at = at

    def number(self, code: str) -> int:
        value: int = struct.unpack_from("<" + code, self.data, self.at)[0]
        self.at += struct.calcsize(code)
        return value

    def uleb(self) -> int:
        value = shift = 0
        while True:
            byte = self.data[self.at]
            self.at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    def sleb(self) -> int:
        start = self.at
        value = self.uleb()
        bits = 7 * (self.at - start)
        return value - (1 << bits) if value >> (bits - 1) else value

    def text(self) -> str:
        end = self.data.index(0, self.at)
        text = self.data[self.at : end].decode()
        self.at = end + 1
        return text


def read_line_table(data: bytes) -> list[Line]:
    """The entries of a relocated .debug_line section, in its order."""
    rows: list[Line] = []
    at = 0
    while at < len(data):
        length = struct.unpack_from("<I", data, at)[0]
        rows += _read_unit(data[at + 4 : at + 4 + length])
        at += 4 + length
    return rows


def in_order(rows: list[Line]) -> list[Line]:
    """Sorted by address, one entry per change of file or line."""
    kept: list[Line] = []
    for row in sorted(rows, key=lambda row: (row.address, row.file != "")):  # the end of one piece before the next
        if kept and kept[-1].address == row.address:
            kept.pop()
        if not kept or (kept[-1].file, kept[-1].line) != (row.file, row.line):
            kept.append(row)
    return kept


def _read_unit(data: bytes) -> list[Line]:
    reader = _Reader(data)
    version = reader.number("H")
    if version != 4:
        raise ValueError(f"line table of DWARF version {version}")
    program = reader.number("I") + reader.at
    minimum = reader.number("B")
    reader.at += 2  # operations per instruction, default of is_stmt
    base, span, first_special = reader.number("b"), reader.number("B"), reader.number("B")
    operands = [reader.number("B") for _ in range(first_special - 1)]
    directories = [""]
    while name := reader.text():
        directories.append(name)
    files = [""]
    while name := reader.text():
        directory = directories[reader.uleb()]
        reader.uleb()
        reader.uleb()
        files.append(f"{directory}/{name}" if directory else name)
    reader.at = program
    return _run(reader, files, minimum, base, span, first_special, operands)


def _run(
    reader: _Reader, files: list[str], minimum: int, base: int, span: int, first_special: int, operands: list[int]
) -> list[Line]:
    rows: list[Line] = []
    data, end = reader.data, len(reader.data)
    address, file, line = 0, 1, 1
    while reader.at < end:
        opcode = data[reader.at]
        reader.at += 1
        if opcode >= first_special:
            step = opcode - first_special
            address += step // span * minimum
            line += base + step % span
            rows.append(Line(address, files[file], line))
        elif opcode == 0:
            length = reader.uleb()
            kind = data[reader.at]
            if kind == _SET_ADDRESS:
                address = int.from_bytes(data[reader.at + 1 : reader.at + length], "little")
            elif kind == _END_SEQUENCE:
                rows.append(Line(address, "", 0))
                address, file, line = 0, 1, 1
            reader.at += length
        elif opcode == 1:
            rows.append(Line(address, files[file], line))
        elif opcode == 2:
            address += reader.uleb() * minimum
        elif opcode == 3:
            line += reader.sleb()
        elif opcode == 4:
            file = reader.uleb()
        elif opcode == 8:
            address += (255 - first_special) // span * minimum
        elif opcode == 9:
            address += reader.number("H")
        else:
            for _ in range(operands[opcode - 1]):
                reader.uleb()
    return rows
