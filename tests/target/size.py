"""Flash and RAM of each component of the firmware, from the map files of the linker, held against a budget.

    size.py BUDGET.toml CONFIG=FILE.map ...             prints the table; exit status 1 when a budget is exceeded
    size.py --update BUDGET.toml CONFIG=FILE.map ...    makes the present figures the budget of the components

Flash counts what is stored there, initial values of variables included. RAM counts variables and the main stack; what
belongs to the application alone (its areas, the stacks of its tasks) is printed apart and has no budget: the device's
maker chooses it.
"""

from __future__ import annotations

import argparse
import re
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

FLASH_SECTIONS = {".vectors", ".text", ".ARM.exidx", ".data"}
STACK_SECTION = ".stack"
RAM_SECTIONS = {".data", ".bss", ".noinit", STACK_SECTION}
APPLICATION_SECTION = ".iec_stack"
SLACK = 1.04  # the budget of a component is what it takes now, and four per cent
ROUND = 16
TOTAL = "total"

_OUTPUT = re.compile(r"^(\.\S+)")
_NAME = re.compile(r"^ (\.\S+|COMMON)")
_PLACED = re.compile(r"\s0x[0-9a-f]+\s+0x([0-9a-f]+) (\S.*)$")
_FILL = re.compile(r"^ \*fill\*\s+0x[0-9a-f]+\s+0x([0-9a-f]+)")
_OWNER = re.compile(r"(cmp_list|[A-Za-z0-9]+)\.c\.o(?:bj)?$")
_LIBRARY = re.compile(r"(lib\w+)\.a\(")


@dataclass
class Usage:
    """Bytes of one component."""

    flash: int = 0
    ram: int = 0
    application: int = 0


@dataclass
class Budget:
    """The budget file: names of variables that are the application's, goals for the totals, limits of the components
    and of their total as [flash, RAM]; all in bytes, by configuration."""

    application: set[str]
    goal: dict[str, dict[str, int]]
    limit: dict[str, dict[str, list[int]]] = field(default_factory=dict)


@dataclass(frozen=True)
class Piece:
    """One input section: where it went, what it is called, whose it is, bytes."""

    output: str
    name: str
    owner: str
    size: int


def pieces(map_text: str) -> Iterator[Piece]:
    """The input sections that were linked, and the gaps between them."""
    _, _, body = map_text.partition("Linker script and memory map")
    output = name = ""
    for line in body.splitlines():
        if match := _OUTPUT.match(line):
            output = match[1]
        elif match := _FILL.match(line):
            yield Piece(output, "", "alignment", int(match[1], 16))
        else:
            if match := _NAME.match(line):
                name = match[1]
            if match := _PLACED.search(line):
                owner = "main stack" if output == STACK_SECTION else _owner(match[2])
                yield Piece(output, name, owner, int(match[1], 16))


def _owner(path: str) -> str:
    """The component an object file belongs to: the name of its source file, or of its library."""
    match = _LIBRARY.search(path) or _OWNER.search(path)
    return match[1] if match else "start-up"


def measure(map_file: Path, application: set[str]) -> dict[str, Usage]:
    """Usage by component, from one map file."""
    usage: dict[str, Usage] = defaultdict(Usage)
    for piece in pieces(map_file.read_text()):
        mine = usage[piece.owner]
        if piece.output in FLASH_SECTIONS:
            mine.flash += piece.size
        if piece.output == APPLICATION_SECTION or piece.name in application:
            mine.application += piece.size
        elif piece.output in RAM_SECTIONS:
            mine.ram += piece.size
    return {name: u for name, u in usage.items() if u.flash or u.ram or u.application}


def total(usage: dict[str, Usage]) -> Usage:
    """The sum over all components."""
    return Usage(*(sum(getattr(u, name) for u in usage.values()) for name in ("flash", "ram", "application")))


def exceeded(config: str, usage: dict[str, Usage], budget: Budget) -> list[str]:
    """A sentence for each limit that is exceeded."""
    found = []
    limits = budget.limit.get(config, {})
    for name, used in [*sorted(usage.items()), (TOTAL, total(usage))]:
        flash, ram = limits.get(name, (0, 0))
        for what, size, limit in (("flash", used.flash, flash), ("RAM", used.ram, ram)):
            if size > limit:
                found.append(f"{config}: {name} takes {size} bytes of {what}, its budget is {limit}.")
    return found


def missed_goals(config: str, usage: dict[str, Usage], budget: Budget) -> list[str]:
    """A sentence for each goal that is not reached yet."""
    used = total(usage)
    sizes = {"flash": used.flash, "ram": used.ram}
    return [
        f"{config}: {sizes[what] - goal} bytes of {what} above the goal of {goal}."
        for what, goal in budget.goal.get(config, {}).items()
        if sizes[what] > goal
    ]


def print_table(measured: dict[str, dict[str, Usage]]) -> None:
    """Components by size, one pair of columns for each configuration."""
    configs = list(measured)
    names = {name for usage in measured.values() for name in usage}
    order = sorted(names, key=lambda n: -max(u[n].flash + u[n].ram for u in measured.values() if n in u))
    print(f"{'bytes':<28}" + "".join(f"{config:>20}" for config in configs))
    print(f"{'':<28}" + f"{'flash':>12}{'RAM':>8}" * len(configs))
    for name in order:
        row = (measured[config].get(name) for config in configs)
        print(f"{name:<28}" + "".join(f"{u.flash:>12}{u.ram:>8}" if u else f"{'-':>12}{'-':>8}" for u in row))
    sums = [total(measured[config]) for config in configs]
    print(f"{TOTAL:<28}" + "".join(f"{u.flash:>12}{u.ram:>8}" for u in sums))
    print(f"{'RAM of the application':<28}" + "".join(f"{u.application:>20}" for u in sums))


def read_budget(path: Path) -> Budget:
    """The budget file; see firmware/size-budget.toml."""
    data = tomllib.loads(path.read_text())
    return Budget(set(data["application"]), data["goal"], data.get("limit", {}))


def with_slack(size: int) -> int:
    """The budget for what takes `size` bytes now."""
    return -(-int(size * SLACK) // ROUND) * ROUND


def total_limit(usage: dict[str, Usage], goal: dict[str, int]) -> tuple[int, int]:
    """The budget of a total: a goal that is reached is not given up again."""
    used = total(usage)
    pairs = ((used.flash, goal.get("flash", 0)), (used.ram, goal.get("ram", 0)))
    flash, ram = (min(with_slack(size), wanted) if size <= wanted else with_slack(size) for size, wanted in pairs)
    return flash, ram


def update(path: Path, measured: dict[str, dict[str, Usage]], budget: Budget) -> None:
    """Replaces the limits at the end of the file; what stands before them is kept as it is."""
    head = path.read_text().split("[limit.", 1)[0].rstrip()
    tables = []
    for config, usage in measured.items():
        flash, ram = total_limit(usage, budget.goal.get(config, {}))
        lines = [f'"{name}" = [{with_slack(u.flash)}, {with_slack(u.ram)}]' for name, u in sorted(usage.items())]
        lines.append(f'"{TOTAL}" = [{flash}, {ram}]')
        tables.append(f"[limit.{config}]\n" + "\n".join(lines))
    path.write_text(head + "\n\n" + "\n\n".join(tables) + "\n")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--update", action="store_true", help="make the present figures the budget")
    parser.add_argument("budget", type=Path)
    parser.add_argument("maps", nargs="+", metavar="CONFIG=FILE.map")
    args = parser.parse_args()
    budget = read_budget(args.budget)
    maps = (text.split("=", 1) for text in args.maps)
    measured = {config: measure(Path(file), budget.application) for config, file in maps}
    if args.update:
        update(args.budget, measured, budget)
        budget = read_budget(args.budget)
    print_table(measured)
    complaints = [text for config, usage in measured.items() for text in exceeded(config, usage, budget)]
    goals = [text for config, usage in measured.items() for text in missed_goals(config, usage, budget)]
    print("", *goals, *complaints, sep="\n")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
