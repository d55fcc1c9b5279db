"""docs/security.md names tests that exist, and a CVE for each that the runtime was checked against."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RULES = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in (ROOT / "docs" / "security.md").read_text().splitlines()
    if line.startswith("| ") and "`" in line
]


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
