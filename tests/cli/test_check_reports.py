"""`check --sarif` and `--junit`: what CI systems show of a check."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

SOURCE = "PROGRAM Main\nVAR n : INT; unused : INT; END_VAR\nn := nonsense;\nEND_PROGRAM\n"


@pytest.fixture
def program(scratch: Path) -> str:
    (scratch / "my program").mkdir()
    (scratch / "my program" / "main.st").write_text(SOURCE)
    (scratch / "my program" / "good.st").write_text("FUNCTION Good : INT\nGood := 1;\nEND_FUNCTION\n")
    return "my program"


def test_sarif_has_a_result_for_each_diagnostic(tool: Any, program: str, scratch: Path) -> None:
    found = tool("check", program, "--json").json["diagnostics"]
    assert tool("check", program, "--sarif", "check.sarif").status == 2
    document = json.loads((scratch / "check.sarif").read_text())
    assert document["version"] == "2.1.0"
    (run,) = document["runs"]
    assert [r["message"]["text"] for r in run["results"]] == [d["message"] for d in found]
    assert {r["level"] for r in run["results"]} == {d["severity"] for d in found}
    rules = {rule["id"] for rule in run["tool"]["driver"]["rules"]}
    assert {r["ruleId"] for r in run["results"]} == rules
    first = run["results"][-1]["locations"][0]["physicalLocation"]
    assert first["artifactLocation"]["uri"] == "my%20program/main.st"
    assert first["region"]["startLine"] == 3


def test_junit_has_a_case_for_each_file(tool: Any, program: str, scratch: Path) -> None:
    assert tool("check", program, "--junit", "check.xml").status == 2
    suite = ElementTree.parse(scratch / "check.xml").getroot().find("testsuite")
    assert suite is not None
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
    cases = {case.get("name"): case for case in suite}
    failure = cases["my program/main.st"].find("failure")
    assert failure is not None
    assert "my program/main.st:3:6: error:" in str(failure.get("message"))
    assert len(cases["my program/good.st"]) == 0


def test_warnings_do_not_fail_a_case(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text("PROGRAM Main\nVAR unused : INT; END_VAR\nEND_PROGRAM\n")
    assert tool("check", "main.st", "--junit", "a.xml").status == 0
    report = (scratch / "a.xml").read_text()
    assert 'failures="0"' in report
    assert "main.st:2:5: warning: " in report


def test_a_clean_program_gives_reports_without_findings(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text("PROGRAM Main\nVAR n : INT; END_VAR\nn := n + 1;\nEND_PROGRAM\n")
    assert tool("check", "main.st", "--sarif", "a.sarif", "--junit", "a.xml").status == 0
    assert json.loads((scratch / "a.sarif").read_text())["runs"][0]["results"] == []
    assert 'failures="0"' in (scratch / "a.xml").read_text()


@pytest.mark.parametrize("option", ["--sarif", "--junit"])
@pytest.mark.parametrize("name", ["my program/main.st", "plc.toml"])
def test_a_report_does_not_replace_a_source(tool: Any, program: str, scratch: Path, option: str, name: str) -> None:
    done = tool("check", program, option, name)
    assert done.status == 2
    assert (scratch / "my program" / "main.st").read_text() == SOURCE
    assert not (scratch / "plc.toml").exists()
