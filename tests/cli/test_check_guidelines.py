"""`plctool check --guidelines`: what plc.toml sets, what reports say, mistakes in [guidelines]."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

MAIN = """// what runs
PROGRAM Main
VAR
    Count : INT;
    x : REAL;
END_VAR
Count := 1;
IF x = 1.0 THEN x := 0.0; END_IF
END_PROGRAM
"""


@pytest.fixture(autouse=True)
def project(scratch: Path) -> Path:
    (scratch / "main.st").write_text(MAIN)
    (scratch / "plc.toml").write_text('[guidelines.names]\nlocal = "camelCase"\n')
    return scratch


def codes(done: Any) -> list[str]:
    return [d["code"] for d in done.json["diagnostics"]]


def test_they_are_checked_when_they_are_asked_for(tool: Any) -> None:
    assert codes(tool("check", "--json")) == []
    done = tool("check", "--guidelines", "--json")
    assert (done.status, codes(done)) == (0, ["n2", "l17", "cp8"])
    assert codes(tool("check", "--guidelines", "--no-warn", "l17,cp8", "--json")) == ["n2"]
    assert codes(tool("check", "--guidelines", "--no-warn", "guidelines", "--json")) == []
    assert tool("check", "--guidelines", "--werror").status == 2


def test_sources_without_a_project_are_held_to_what_is_proposed(tool: Any, project: Path) -> None:
    (project / "plc.toml").unlink()
    assert codes(tool("check", "--guidelines", "main.st", "--json")) == ["l17", "cp8"]


def test_reports_have_the_rules_with_their_meaning(tool: Any, project: Path) -> None:
    tool("check", "--guidelines", "--sarif", "check.sarif")
    (run,) = json.loads((project / "check.sarif").read_text())["runs"]
    rules = {rule["id"]: rule["shortDescription"]["text"] for rule in run["tool"]["driver"]["rules"]}
    assert rules["cp8"] == "REAL or LREAL values are compared with = or <>"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('names = { local = "(a+)+" }', "plc.toml:2:19: error: '(a+)+' is no form of a name; it has UPPER_CASE, "),
        ('names = { locals = "*" }', "plc.toml:2:11: error: there is no 'locals' here; did you mean local?"),
        ("branches = 0", "branches is 0; it can be 1 to 10000"),
        ("longest = 3", "there is no 'longest' here; did you mean longest-name?"),
        ("avoid = 3", "avoid"),
    ],
)
def test_a_mistake_has_its_line(tool: Any, project: Path, text: str, message: str) -> None:
    (project / "plc.toml").write_text(f"[guidelines]\n{text}\n")
    done = tool("check", "--guidelines")
    assert done.status == 2 and message in done.err
