"""Online changes on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

PROGRAM = "PROGRAM Main\nVAR x : DINT; END_VAR\nx := x + 1;\nEND_PROGRAM\n"


@pytest.fixture(autouse=True)
def source(scratch: Path, tool: Any) -> None:
    (scratch / "main.st").write_text(PROGRAM)
    assert tool("build", "main.st", "-o", "old.cdl").status == 0


def edit(scratch: Path, before: str, after: str) -> None:
    (scratch / "main.st").write_text(PROGRAM.replace(before, after))


def test_plan_of_a_change_is_printed_and_nothing_is_written(tool: Any, scratch: Path) -> None:
    edit(scratch, "x : DINT;", "y : INT := 4; x : DINT;")
    done = tool("build", "main.st", "-o", "new.cdl", "--base", "old.cdl", "--dry-run")
    assert done.status == 0
    assert "1 variable kept, 1 new, 0 removed; 2 bytes are written\n  new: Main.y" in done.out
    assert not (scratch / "new.cdl").exists()


def test_image_of_a_change_names_the_image_that_it_replaces(tool: Any, scratch: Path) -> None:
    crc = tool("info", "old.cdl", "--json").json["crc"]
    edit(scratch, "x + 1", "x + 2")
    document = tool("build", "main.st", "-o", "new.cdl", "--base", "old.cdl", "--json").json
    assert document["change"]["base"] == crc == tool("info", "new.cdl", "--json").json["replaces"]


def test_impossible_change_is_refused_in_words(tool: Any, scratch: Path) -> None:
    edit(scratch, "DINT", "REAL")
    done = tool("build", "main.st", "-o", "new.cdl", "--base", "old.cdl")
    assert done.status == 2
    assert "No online change: Main.x was DINT, is REAL. Undo that, or download the program" in done.err
    assert not (scratch / "new.cdl").exists()
    assert tool("build", "main.st", "--base", "old.cdl", "--dry-run", "--json").json["problems"]


def test_base_that_is_no_image_is_refused(tool: Any) -> None:
    assert "is not a valid application image" in tool("build", "main.st", "--base", "main.st").err
    assert "--dry-run needs --base" in tool("build", "main.st", "--dry-run").err
