"""docs/manual-map.md: what it names exists, and each section of the manuals is listed once."""

from __future__ import annotations

import argparse
import re
from collections import Counter
from functools import cache

import pytest
from prose import ROOT
from test_internals import file_exists, files, function_exists

from plctool.cli.command_line import parser

MAP = ROOT / "docs" / "manual-map.md"
MISSING = "-"
STATES = ("works", "in part", "not taken", "not yet")
# The numbers of subsections that the tables of contents of the manuals have, for what is listed.
CONTENTS = {
    "CODESYS Control V3 Manual": {
        "1": 2, "2": 10, "2.3": 1, "2.7": 5, "2.8": 2, "2.10": 4,
        "3": 17, "3.1": 3, "3.3": 10, "3.4": 1, "3.5": 3, "3.6": 4, "3.8": 2, "3.9": 2, "3.10": 21, "3.13": 1,
        "4": 4, "4.4": 9, "5": 12, "5.3": 4, "5.4": 4, "5.5": 4, "5.8": 5, "5.10": 3, "6": 4,
        "7": 6, "7.3": 3, "7.4": 8, "8": 12, "8.2": 3, "8.8": 4, "8.12": 3, "9": 6,
        "10": 6, "10.2": 7, "10.3": 4, "10.4": 8, "10.5": 5, "11": 11,
    },
    "Application Handling": {"1.3.3": 9},
    "CoDeSys SP RTE": {"1": 2, "2": 2, "3": 12, "4": 2, "5": 1, "6": 5, "7": 9, "9": 1},
    "MK905, CoDeSys 2.3": {"2": 6, "3": 8, "4": 3, "5": 12, "6": 7, "7": 7, "8": 3, "9": 4, "10": 4, "11": 5},
}  # fmt: skip
UNDIVIDED = {"CODESYS Control V3 Manual": {"A", "B"}, "CoDeSys SP RTE": {"8"}}
NUMBER = r"[\dAB][\d.]*"


def rows() -> list[tuple[str, list[str]]]:
    """Each row of the tables of sections: the manual, and the cells."""
    manual, found = "", []
    for line in MAP.read_text().splitlines():
        if line.startswith("## "):
            manual = line[3:]
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if manual in CONTENTS and line.startswith("|") and re.match(NUMBER, cells[0]):
            found.append((manual, cells))
    return found


def state(cells: list[str]) -> str:
    """How far the subject of a row is here."""
    _, place, difference = cells
    if place == MISSING:
        return "not yet" if "not yet" in difference else "not taken"
    return "in part" if re.search(r"\b(no|not|none|only)\b", difference, re.IGNORECASE) else "works"


def sections(cell: str) -> list[str]:
    """The numbers that a first cell begins with: `2.7 Title`, or `2.7.1 to 2.7.5 Title`."""
    several = re.match(rf"({NUMBER}) to ({NUMBER}) ", cell)
    if several is None:
        return [cell.split()[0]]
    parent, _, first = several[1].rpartition(".")
    other, _, last = several[2].rpartition(".")
    assert parent == other, f"{cell}: from one section to the other, of one chapter"
    return [f"{parent}.{number}" for number in range(int(first), int(last) + 1)]


def names(column: int) -> list[str]:
    """What stands between backticks in a column."""
    return sorted({name for _, cells in rows() for name in re.findall(r"`([^`]+)`", cells[column])})


def links() -> list[str]:
    return sorted(set(re.findall(r"\]\(([^)]+)\)", MAP.read_text())))


def anchors(text: str) -> set[str]:
    """Of the headings of a page, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@cache
def commands() -> set[str]:
    """Each command of plctool with its subcommands: `io map`."""
    found: set[str] = set()

    def collect(of: argparse.ArgumentParser, before: str) -> None:
        for action in of._actions:
            if isinstance(action, argparse._SubParsersAction):
                for name, child in action.choices.items():
                    found.add(before + name)
                    collect(child, f"{before}{name} ")

    collect(parser(), "")
    return found


@cache
def all_sources() -> str:
    return "\n".join(text for name, text in files().items() if name.startswith(("firmware/", "host/")))


def plcrt_options() -> set[str]:
    return set(re.findall(r'"(?:  )?(--[a-z-]+)', (ROOT / "firmware/port/linux/main.c").read_text()))


def exists(name: str) -> bool:
    """True if a command, an option of plcrt, a function, a file or an identifier of the sources has this name."""
    if name.startswith("plctool "):
        return name.removeprefix("plctool ") in commands() or name == "plctool --version"
    if name.startswith("plcrt "):
        return name.removeprefix("plcrt ") in plcrt_options()
    if name.endswith("()"):
        return function_exists("", name[:-2])
    if re.search(r"\.[ch]$", name):
        return file_exists(name)
    return re.search(rf"(?<!\w){re.escape(name)}(?!\w)", all_sources()) is not None


@pytest.mark.parametrize("name", names(1))
def test_what_is_here_exists(name: str) -> None:
    assert exists(name), f"manual-map.md: {name} is not in the project"


@pytest.mark.parametrize("name", [n for n in names(2) if re.match(r"plctool |plcrt |\w+\.[ch]$|\w+\(\)$", n)])
def test_what_a_difference_names_exists(name: str) -> None:
    assert exists(name), f"manual-map.md: {name} is not in the project"


@pytest.mark.parametrize("link", links())
def test_every_page_and_heading_exists(link: str) -> None:
    page, _, anchor = link.partition("#")
    path = (MAP.parent / page).resolve() if page else MAP
    assert path.is_file(), f"{page}: there is no such page"
    assert not anchor or anchor in anchors(path.read_text()), f"{link}: there is no such heading"


@pytest.mark.parametrize("manual", CONTENTS)
def test_every_section_is_listed_once_and_in_order(manual: str) -> None:
    def order(number: str) -> list[int]:
        return [int(part) if part.isdigit() else ord(part) for part in number.split(".")]

    listed = [number for m, cells in rows() if m == manual for number in sections(cells[0])]
    wanted = {f"{parent}.{n}" for parent, count in CONTENTS[manual].items() for n in range(1, count + 1)}
    assert listed == sorted(wanted | UNDIVIDED.get(manual, set()), key=order)


@pytest.mark.parametrize("manual", CONTENTS)
def test_the_table_at_the_head_counts_the_rows(manual: str) -> None:
    found = Counter(state(cells) for m, cells in rows() if m == manual)
    line = f"| {manual} | {' | '.join(str(found[name]) for name in STATES)} |"
    assert line in MAP.read_text(), f"docs/manual-map.md: write {line}"


@pytest.mark.parametrize("row", rows(), ids=lambda row: row[1][0])
def test_what_is_missing_says_why(row: tuple[str, list[str]]) -> None:
    _, cells = row
    assert len(cells) == 3
    assert cells[1] and (cells[1] != MISSING or cells[2])
