"""README.md names tests that exist, and has a row for each case of CiA 405."""

from __future__ import annotations

import re
from pathlib import Path

TESTS = Path(__file__).parents[1]
README = (TESTS / "canopen/README.md").read_text()


def test_each_test_exists() -> None:
    named = re.findall(r"`([\w/]+\.(?:py|c|st))(?:::(\w+))?`", README)
    assert len(named) > 50
    for path, function in named:
        text = (TESTS / path).read_text() if "/" in path else README
        assert re.search(rf"\b{function}\(", text) or not function, f"{path}::{function}"


def test_each_case_has_a_row() -> None:
    rows = re.findall(r"^\| C405-(\d\d)(?: to C405-(\d\d))?", README, re.MULTILINE)
    assert [n for first, last in rows for n in range(int(first), int(last or first) + 1)] == list(range(1, 41))
