"""Flash and RAM of each component of the firmware, from the linked programs, held against a budget.

    size.py BUDGET.toml CONFIG=FILE.elf ...             prints the table; exit status 1 when a budget is exceeded
    size.py BUDGET.toml CONFIG=FILE.elf CONFIG-without-WING=FILE.elf ...    also what WING takes of CONFIG
    size.py --update BUDGET.toml CONFIG=FILE.elf ...    makes the present figures the budget of the components
    size.py --without-budget CONFIG=FILE.elf ...        prints the table

The sections say how much there is, the debugging information which component each function and variable is of: the
program is optimised as a whole, so the linker does not know any more. A function that was inlined counts where it went.

Flash counts what is stored there, initial values of variables included. RAM counts variables and the main stack; what
belongs to the application alone (its areas, the stacks of its tasks) is printed apart and has no budget: the device's
maker chooses it.
"""

from __future__ import annotations

import argparse
import re
import sys
import tomllib
from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path, PurePosixPath

from elftools.dwarf.dwarfinfo import DWARFInfo
from elftools.dwarf.lineprogram import LineProgram
from elftools.elf.constants import SH_FLAGS
from elftools.elf.elffile import ELFFile

FLASH_SECTIONS = {".vectors", ".text", ".ARM.exidx", ".data"}
STACK_SECTION = ".stack"
RAM_SECTIONS = {".data", ".bss", ".noinit", STACK_SECTION}
APPLICATION_SECTION = ".iec_stack"
SLACK = 1.04  # the budget of a component is what it takes now, and four per cent
ROUND = 16
TOTAL = "total"
BUDGET = Path(__file__).resolve().parents[2] / "firmware/size-budget.toml"

LIBRARIES = "libraries"  # of the C compiler, perhaps without debugging information
REST = "strings, padding"  # what has no symbol
WITHOUT = "-without-"  # in the name of a configuration
ADDRESS_OF = 3  # DW_OP_addr


@dataclass
class Usage:
    """Bytes of one component."""

    flash: int = 0
    ram: int = 0
    application: int = 0


@dataclass
class Part:
    """Some components together, in one configuration, and what they may take; `why`: what is between the two."""

    config: str
    components: list[str]
    flash: int
    ram: int
    why: str = ""


@dataclass
class Wing:
    """A function of the firmware that many components contribute to: the flash it may take; `why` it takes more."""

    flash: int
    why: str = ""


@dataclass
class Budget:
    """The budget file: the compiler that its figures are of, names of variables that are the application's, goals for
    the totals, for parts and for wings, limits of the components and of their total as [flash, RAM]; all in bytes."""

    compiler: str
    application: set[str]
    goal: dict[str, dict[str, int]]
    part: dict[str, Part] = field(default_factory=dict)
    wing: dict[str, Wing] = field(default_factory=dict)
    limit: dict[str, dict[str, list[int]]] = field(default_factory=dict)


@dataclass(frozen=True)
class Piece:
    """A line of a function, a variable, or the part of a section that is neither: section, symbol, component, bytes."""

    section: str
    name: str
    owner: str
    size: int


def _component(path: PurePosixPath) -> str:
    return path.stem if "firmware" in path.parts else LIBRARIES


def variable_owners(dwarf: DWARFInfo) -> dict[int, str]:
    """The component of each variable by its address."""
    found: dict[int, str] = {}
    for die in (die for unit in dwarf.iter_CUs() for die in unit.iter_DIEs() if die.tag == "DW_TAG_variable"):
        place = die.attributes.get("DW_AT_location")
        if place and place.form == "DW_FORM_exprloc" and place.value[0] == ADDRESS_OF and len(place.value) == 5:
            while "DW_AT_abstract_origin" in die.attributes:
                die = die.get_DIE_from_attribute("DW_AT_abstract_origin")
            source = die.cu.get_top_DIE().attributes["DW_AT_name"].value.decode()
            found[int.from_bytes(place.value[1:], "little")] = _component(PurePosixPath(source))
    return found


def _line_components(program: LineProgram) -> list[str]:
    """The component of each source file that a line program names by its number, from 1 on before DWARF 5."""
    old = program["version"] < 5
    folders = [b""] * old + list(program["include_directory"])
    paths = (PurePosixPath(folders[f.dir_index].decode(), f.name.decode()) for f in program["file_entry"])
    return [LIBRARIES] * old + [_component(path) for path in paths]


def line_owners(dwarf: DWARFInfo, functions: set[int]) -> dict[int, str]:
    """The component of each line of code by its address. Functions that were not linked still have lines, at 0."""
    found: dict[int, str] = {}
    for unit in dwarf.iter_CUs():
        program = dwarf.line_program_for_CU(unit)
        if program is None:
            continue
        components = _line_components(program)
        sequence: dict[int, str] = {}
        for state in (entry.state for entry in program.get_entries() if entry.state is not None):
            if not state.end_sequence:
                sequence[state.address] = components[state.file]
                continue
            if next(iter(sequence), None) in functions:
                found |= sequence
            sequence = {}
    return found


def pieces(elf: ELFFile) -> Iterator[Piece]:
    """Everything in the sections that take flash or RAM."""
    sections = [section for section in elf.iter_sections() if section["sh_flags"] & SH_FLAGS.SHF_ALLOC]
    rest = {section.name: section["sh_size"] for section in sections}
    symbols = {s["st_value"]: s for s in elf.get_section_by_name(".symtab").iter_symbols() if s["st_size"]}
    functions = {address & ~1 for address, s in symbols.items() if s["st_info"]["type"] == "STT_FUNC"}
    dwarf = elf.get_dwarf_info()
    variables, lines = variable_owners(dwarf), line_owners(dwarf, functions)
    starts = sorted(lines)
    for address, symbol in symbols.items():
        section, size = elf.get_section(symbol["st_shndx"]).name, symbol["st_size"]
        if section not in rest:
            continue  # board_facts
        rest[section] -= size
        if symbol["st_info"]["type"] != "STT_FUNC":
            yield Piece(section, symbol.name, variables.get(address, LIBRARIES), size)
            continue
        begin, end = address & ~1, (address & ~1) + size
        bounds = [begin, *starts[bisect_right(starts, begin) : bisect_left(starts, end)], end]
        for start, stop in pairwise(bounds):
            yield Piece(section, symbol.name, lines.get(start, LIBRARIES), stop - start)
    for section, size in rest.items():
        yield Piece(section, "", REST, size)


def measure(program: Path, application: set[str]) -> dict[str, Usage]:
    """Usage by component, of one program."""
    usage: dict[str, Usage] = defaultdict(Usage)
    with program.open("rb") as file:
        for piece in pieces(ELFFile(file)):
            mine = usage["main stack" if piece.section == STACK_SECTION else piece.owner]
            if piece.section in FLASH_SECTIONS:
                mine.flash += piece.size
            if piece.section == APPLICATION_SECTION or piece.name in application:
                mine.application += piece.size
            elif piece.section in RAM_SECTIONS:
                mine.ram += piece.size
    return {name: u for name, u in usage.items() if u.flash or u.ram or u.application}


def total(usage: dict[str, Usage]) -> Usage:
    """The sum over all components."""
    return Usage(*(sum(getattr(u, name) for u in usage.values()) for name in ("flash", "ram", "application")))


def compiler_of(program: Path) -> str:
    """The compiler of the firmware, such as gcc 12: another one lays out and inlines in its own way."""
    with program.open("rb") as file:
        for unit in ELFFile(file).get_dwarf_info().iter_CUs():
            attributes = unit.get_top_DIE().attributes
            producer = attributes["DW_AT_producer"].value.decode()
            if "firmware" in PurePosixPath(attributes["DW_AT_name"].value.decode()).parts:
                name, version = re.match(r"(\D+?)[ C\d]* (\d+)\.", producer).groups()
                return f"{name.replace('GNU', 'gcc')} {version}"
    return "unknown"


def exceeded(config: str, usage: dict[str, Usage], budget: Budget, compiler: str) -> list[str]:
    """A sentence for each limit that is exceeded. Those of components hold for the compiler they are of."""
    found = []
    limits = budget.limit.get(config, {})
    components = sorted(usage.items()) if compiler == budget.compiler else []
    for name, used in [*components, (TOTAL, total(usage))]:
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


def print_parts(measured: dict[str, dict[str, Usage]], parts: dict[str, Part]) -> None:
    """Each part beside its goal, and why it is not reached."""
    known = {name: part for name, part in parts.items() if part.config in measured}
    if not known:
        return
    print(f"\n{'parts':<36}{'configuration':>14}{'flash':>8}{'goal':>8}{'RAM':>8}{'goal':>8}")
    for name, part in known.items():
        used = total({c: u for c, u in measured[part.config].items() if c in part.components})
        print(f"{name:<36}{part.config:>14}{used.flash:>8}{part.flash:>8}{used.ram:>8}{part.ram:>8}")
        if part.why and (used.flash > part.flash or used.ram > part.ram):
            print(f"  {part.why}")


def print_wings(
    measured: dict[str, dict[str, Usage]], without: dict[str, dict[str, Usage]], wings: dict[str, Wing]
) -> None:
    """What each wing takes: the difference between a configuration and the same one without the wing."""
    if not without:
        return
    print(f"\n{'wings, by builds without them':<36}{'configuration':>14}{'flash':>8}{'goal':>8}{'RAM':>8}")
    for name, usage in without.items():
        config, wing = name.split(WITHOUT)
        whole, rest, wanted = total(measured[config]), total(usage), wings[wing]
        print(f"{wing:<36}{config:>14}{whole.flash - rest.flash:>8}{wanted.flash:>8}{whole.ram - rest.ram:>8}")
        if wanted.why and whole.flash - rest.flash > wanted.flash:
            print(f"  {wanted.why}")


def read_budget(path: Path) -> Budget:
    """The budget file; see firmware/size-budget.toml."""
    data = tomllib.loads(path.read_text())
    parts = {name: Part(**part) for name, part in data.get("part", {}).items()}
    wings = {name: Wing(**wing) for name, wing in data.get("wing", {}).items()}
    return Budget(data["compiler"], set(data["application"]), data["goal"], parts, wings, data.get("limit", {}))


def with_slack(size: int) -> int:
    """The budget for what takes `size` bytes now."""
    return -(-int(size * SLACK) // ROUND) * ROUND


def total_limit(usage: dict[str, Usage], goal: dict[str, int]) -> tuple[int, int]:
    """The budget of a total: a goal that is reached is not given up again."""
    used = total(usage)
    pairs = ((used.flash, goal.get("flash", 0)), (used.ram, goal.get("ram", 0)))
    flash, ram = (min(with_slack(size), wanted) if size <= wanted else with_slack(size) for size, wanted in pairs)
    return flash, ram


def update(path: Path, measured: dict[str, dict[str, Usage]], budget: Budget, compiler: str) -> None:
    """Replaces the compiler, and the limits at the end of the file; what else stands before them is kept as it is."""
    head = path.read_text().split("[limit.", 1)[0].rstrip()
    head = re.sub(r"^compiler = .*$", f'compiler = "{compiler}"', head, flags=re.MULTILINE)
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
    parser.add_argument("--without-budget", action="store_true", help="there is none for these programs")
    parser.add_argument("files", nargs="+", metavar="BUDGET.toml CONFIG=FILE.elf")
    args = parser.parse_args()
    path = BUDGET if args.without_budget else Path(args.files.pop(0))
    budget = read_budget(path)
    programs = {config: Path(file) for config, file in (text.split("=", 1) for text in args.files)}
    everything = {config: measure(file, budget.application) for config, file in programs.items()}
    without = {config: usage for config, usage in everything.items() if WITHOUT in config}
    measured = {config: usage for config, usage in everything.items() if WITHOUT not in config}
    if args.without_budget:
        print_table(measured)
        return 0
    compiler = compiler_of(next(iter(programs.values())))
    if args.update:
        update(path, measured, budget, compiler)
        budget = read_budget(path)
    print_table(measured)
    print_parts(measured, budget.part)
    print_wings(measured, without, budget.wing)
    complaints = [text for config, usage in measured.items() for text in exceeded(config, usage, budget, compiler)]
    goals = [text for config, usage in measured.items() for text in missed_goals(config, usage, budget)]
    if compiler != budget.compiler:
        print(f"\nThis is {compiler}: of the budgets, which are those of {budget.compiler}, the totals count.")
    print("", *goals, *complaints, sep="\n")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
