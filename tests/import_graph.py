"""Which modules of plctool import which, and the picture of it; as a program: draws the pictures in docs/internals.md.

A block of code that begins with "```imports PACKAGE" has a row and a column for each room of the package, from the
ground up: the row of a room says from how many of its modules imports lead to the room of the column. A room is
on the floor above the highest that it imports; a number right of the diagonal would be an import upwards.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import plctool

ROOT = Path(plctool.__file__).parent
INTERNALS = Path(__file__).resolve().parents[1] / "docs" / "internals.md"
_BLOCK = re.compile(r"^```imports ([a-z_.]+)\n.*?^```$", re.MULTILINE | re.DOTALL)


def _module(path: Path) -> str:
    """The name of a module below plctool; of a package that of its folder."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix("__init__").removesuffix(".")


MODULES = {_module(path): path for path in ROOT.rglob("*.py")}


@cache
def imports(module: str) -> frozenset[str]:
    """The modules of plctool that a module imports."""
    return frozenset(i for i in named_in(MODULES[module].read_text()) if i != module)


def named_in(source: str) -> Iterator[str]:
    """What a source imports of plctool, wherever it does."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute here"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            if name.split(".")[0] == "plctool":
                yield _found(name.removeprefix("plctool").removeprefix("."))


def _found(name: str) -> str:
    """The module that a dotted name below plctool means, or that it is a name in."""
    return name if name in MODULES else name.rpartition(".")[0]


# ---- the picture ----


def room_of(module: str, package: str) -> str | None:
    """The package or module directly in `package` that a module is in; None if it is elsewhere."""
    inside = module.removeprefix(f"{package}.")
    return None if inside == module else inside.partition(".")[0]


def arrows(package: str) -> dict[str, dict[str, int]]:
    """For each room of a package the rooms that it imports, each with the number of its modules that do."""
    found: dict[str, dict[str, int]] = {}
    for module in MODULES:
        room = room_of(module, package)
        if room is None:
            continue
        row = found.setdefault(room, {})
        for other in {room_of(i, package) for i in imports(module)} - {None, room}:
            assert other is not None
            row[other] = row.get(other, 0) + 1
    return found


def floors(rooms: dict[str, dict[str, int]]) -> dict[str, int]:
    """The floor of each room, from 1. Raises RecursionError if they import each other in a circle."""

    @cache
    def floor(room: str) -> int:
        return 1 + max(map(floor, rooms[room]), default=0)

    return {room: floor(room) for room in rooms}


def picture(package: str) -> str:
    """The rows of a package, the highest floor first."""
    rooms = arrows(package)
    level = floors(rooms)
    order = sorted(rooms, key=lambda room: (level[room], room))
    width = max(map(len, order))
    lines = [" " * (width + 10) + "".join(f"{n:>4}" for n in range(1, len(order) + 1))]
    for n, room in reversed(list(enumerate(order, 1))):
        cells = "".join(f"{rooms[room].get(other, '·'):>4}" for other in order[: n - 1])
        above = "".join(f"{rooms[room].get(other, ''):>4}" for other in order[n:])
        lines.append(f"{f'floor {level[room]}':<8}{n:>2} {room:<{width}}{cells}   ■{above}".rstrip())
    count = sum(len(row) for row in rooms.values())
    lines.append(f"{len(order)} rooms on {max(level.values())} floors, {count} arrows")
    return "\n".join(lines) + "\n"


def drawn(text: str) -> str:
    """The text with all pictures as they should be."""
    return _BLOCK.sub(lambda block: f"```imports {block[1]}\n{picture(block[1])}```", text)


if __name__ == "__main__":
    INTERNALS.write_text(drawn(INTERNALS.read_text()))
