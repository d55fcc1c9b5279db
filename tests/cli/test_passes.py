"""The passes of the code generator, and groups of warnings, on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

PROGRAM = """PROGRAM Main
VAR t : TON; x, spare : INT; END_VAR
t(IN := x > 3, PT := T#1s);
x := x + 1;
END_PROGRAM
"""


@pytest.fixture(autouse=True)
def source(scratch: Path) -> None:
    (scratch / "main.st").write_text(PROGRAM)
    (scratch / "plc.toml").write_text('sources = ["main.st"]\ntarget = "cortex-m3"\n')


def test_what_a_pass_leaves_is_printed_before_what_was_built(tool: Any) -> None:
    first, *_, last = tool("build", "--dump-after", "closed").out.splitlines()
    assert first == "TON: returns Q, gets the context"
    assert last.startswith("app.cdl: ")


def test_what_a_pass_leaves_is_a_list_of_lines_for_programs(tool: Any) -> None:
    assert tool("build", "--dump-after", "registers", "--json").json["dump"] == ["TON: IN, PT"]
    assert "define" in "".join(tool("build", "--dump-after", "memory", "--json").json["dump"])
    assert "dump" not in tool("build", "--json").json


def test_image_without_a_pass_is_another_one_and_is_built_again_without_the_option(tool: Any) -> None:
    usual = tool("build", "--json").json["crc"]
    other = tool("build", "--no-pass", "optimise", "--json").json["crc"]
    assert usual != other
    assert tool("info", "app.cdl", "--json").json["crc"] == other
    assert tool("build", "--json").json["crc"] == usual


def test_unknown_pass_is_refused_with_the_name_that_was_meant(tool: Any) -> None:
    done = tool("build", "--no-pass", "closd")
    assert done.status == 2
    assert "There is no pass 'closd' of the code generator; did you mean closed?" in done.err


def test_group_of_warnings_is_turned_off_by_option_and_by_project(tool: Any, scratch: Path) -> None:
    assert [d["code"] for d in tool("check", "--json").json["diagnostics"]] == ["unused"]
    assert tool("check", "--json", "--no-warn", "dead-code").json["diagnostics"] == []
    with (scratch / "plc.toml").open("a") as project:
        project.write('[options]\nno-warn = ["dead-code"]\n')
    assert tool("check", "--json").json["diagnostics"] == []
