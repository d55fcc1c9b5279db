"""`-o -` writes to the standard output where an output is one file, and is refused where it is not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

MAIN = "PROGRAM Main VAR lamp : BOOL; n : INT; END_VAR n := n + 1; lamp := NOT lamp; END_PROGRAM\n"
CSV = "time_ms,Main.lamp,Main.n\n0,1,1\n"


@pytest.fixture
def program(tool: Any, scratch: Path) -> Path:
    (scratch / "main.st").write_text(MAIN)
    assert tool("build", "main.st").status == 0
    return scratch


def test_repeated_trace_adds_columns(tool: Any, program: Path) -> None:
    assert tool("run", "app.cdl", "--trace", "Main.lamp", "--trace", "Main.n", "-o", "x.csv").status == 0
    assert (program / "x.csv").read_text() == CSV


def test_trace_to_the_standard_output_has_it_alone(tool: Any, program: Path) -> None:
    done = tool("run", "app.cdl", "--trace", "Main.lamp", "Main.n", "--get", "Main.n", "-o", "-")
    assert (done.status, done.out) == (0, CSV)
    assert "Main.n = 1" in done.err and "the values are in" not in done.err
    assert not (program / "-").exists()


def test_trace_and_a_document_do_not_share_the_standard_output(tool: Any, program: Path) -> None:
    done = tool("run", "app.cdl", "--trace", "Main.n", "-o", "-", "--json")
    assert done.status == 2 and "name a file" in done.json["error"]["message"]


@pytest.mark.parametrize("command", [
    "build main.st -o -", "image app.cdl --board plcrt -o -", "test main.st --junit -", "test main.st --coverage -",
    "export main.st -o -", "export-itf main.st -o -", "io init -", "source get -o -",
])  # fmt: skip
def test_what_is_no_single_file_is_not_written_to_the_standard_output(tool: Any, program: Path, command: str) -> None:
    before = sorted(program.rglob("*"))
    done = tool(*command.split())
    assert done.status == 2 and "name a file" in done.err
    assert sorted(program.rglob("*")) == before
