"""docs/security.md names tests that exist, and a CVE for each that the runtime was checked against."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RULES = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in (ROOT / "docs" / "security.md").read_text().partition("## Rules")[2].splitlines()
    if line.startswith("| ") and "`" in line
]


CHECKLIST = """
2022-30791 2018-20026 2021-29242 2019-5105 2019-9009 2021-33485 2018-20025 2022-22517 2022-30792 2020-7052 2019-9012
2020-15806 2019-9010 2022-47379 2022-47380 2022-47381 2022-47382 2022-47383 2022-47384 2022-47385 2022-47386 2022-47387
2022-47388 2022-47389 2022-47390 2022-47391 2022-47392 2022-47393 2023-37545 2023-37546 2023-37547 2023-37548 2023-37549
2023-37550 2025-41691 2021-29241 2018-10612 2019-9013 2022-22514 2023-37551 2022-22515 2022-4046 2026-3509
"""


def numbers_of(cell: str) -> set[str]:
    """The CVEs in the column `elsewhere`, with all of a range."""
    found = set()
    for year, first, last in re.findall(r"CVE-(\d+)-(\d+)(?: to (\d+))?", cell):
        found |= {f"{year}-{number}" for number in range(int(first), int(last or first) + 1)}
    return found


def named_tests(cell: str) -> list[tuple[str, str]]:
    """(file, test) in the order of the cell: a file is followed by its tests."""
    file, found = "", []
    for name in re.findall(r"`([^`]+)`", cell):
        if name.endswith(".c"):
            file = name
        elif file.startswith("test_"):
            found.append((file, name))
    return found


@pytest.mark.parametrize(("file", "name"), [pair for _, _, cell in RULES for pair in named_tests(cell)])
def test_the_test_is_run(file: str, name: str) -> None:
    assert f"RUN({name});" in (ROOT / "tests" / "c" / file).read_text()


def test_every_rule_names_a_test() -> None:
    assert len(RULES) >= 22
    for rule, _, cell in RULES:
        assert named_tests(cell) or "tests/fuzz" in cell, rule


def test_every_cve_of_the_checklist_has_a_rule() -> None:
    assert set(CHECKLIST.split()) == {number for _, elsewhere, _ in RULES for number in numbers_of(elsewhere)}
