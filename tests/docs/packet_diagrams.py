"""Diagrams of packets, made from CmpPackets.h; as a program: writes them into docs/protocol.md.

A block of code that begins with "```packet NAME" is the struct NAME, with "```packet NAME + NAME" one after the other.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from plctool.core import ffi

PROTOCOL = Path(__file__).resolve().parents[2] / "docs" / "protocol.md"
_BLOCK = re.compile(r"^```packet ([A-Z0-9_ +]+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_WIDTH = 110


def cells(name: str, at: int = 0) -> Iterator[tuple[int, str]]:
    """Offset and name of each member; of a struct in the struct its members."""
    for member, field in ffi.typeof(name).fields:
        if field.type.kind == "struct":
            yield from cells(field.type.cname, at + field.offset)
        else:
            yield at + field.offset, member


def diagram(names: str) -> str:
    """Rows of boxes with the offsets of their beginnings below."""
    boxes: list[tuple[int, str]] = []
    end = 0
    for name in names.split(" + "):
        boxes += cells(name, end)
        end += ffi.sizeof(name)
    rows, width = [[boxes[0]]], 0
    for box in boxes:
        size = max(len(box[1]), 2) + 3
        if width + size > _WIDTH:
            rows.append([])
            width = 0
        width += size
        if box is not boxes[0]:
            rows[-1].append(box)
    ends = [row[0][0] for row in rows[1:]] + [end]
    return "".join(_row(row, row_end) for row, row_end in zip(rows, ends, strict=True))


def _row(row: list[tuple[int, str]], end: int) -> str:
    widths = [max(len(name), 2) + 2 for _, name in row]
    line = "+" + "+".join("-" * width for width in widths) + "+\n"
    names = "|" + "|".join(f" {name}".ljust(width) for (_, name), width in zip(row, widths, strict=True)) + "|\n"
    offsets = "".join(str(offset).ljust(width + 1) for (offset, _), width in zip(row, widths, strict=True))
    return line + names + line + offsets + f"{end}\n"


def drawn(text: str) -> str:
    """The text with all diagrams as they should be."""
    return _BLOCK.sub(lambda block: f"```packet {block[1]}\n{diagram(block[1])}```", text)


def packets(text: str) -> set[str]:
    """The structs that the text has diagrams of."""
    return {name for block in _BLOCK.finditer(text) for name in block[1].split(" + ")}


if __name__ == "__main__":
    PROTOCOL.write_text(drawn(PROTOCOL.read_text()))
