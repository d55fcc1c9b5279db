"""[information] of plc.toml in the program: GetTitle() and others are constants, mistakes have their hints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from plctool import Simulator

INFORMATION = """sources = ["main.st"]
[information]
name = "pump"
title = "Pump station"
company = "Waterworks"
version = "1.2"
author = "A. N. Other"
description = "two pumps"
profile = "small"
[information.properties]
serial = "A-17"
poles = 4
gain = 1.5
tested = true
hardware = { version = "2.0.1" }
empty = ""
"""


def program(folder: Path, variables: str, body: str, before: str = "", information: str = INFORMATION) -> Path:
    (folder / "plc.toml").write_text(information)
    (folder / "main.st").write_text(f"{before}PROGRAM Main\nVAR\n{variables}\nEND_VAR\n{body}\nEND_PROGRAM\n")
    return folder


@pytest.mark.parametrize(
    ("call", "declared", "value"),
    [
        ("GetTitle()", "STRING", "Pump station"),
        ("GETCOMPANY()", "STRING", "Waterworks"),
        ("GetVersion()", "STRING", "1.2"),
        ("GetAuthor()", "STRING", "A. N. Other"),
        ("GetDescription()", "STRING", "two pumps"),
        ("F_getProjectName()", "STRING", "pump"),
        ("GetTextProperty('serial')", "STRING", "A-17"),
        ("GetTextProperty('empty')", "STRING", ""),
        ("GetNumberProperty('poles')", "SINT", 4),
        ("GetNumberProperty('poles')", "LREAL", 4.0),
        ("GetNumberProperty('gain')", "REAL", 1.5),
        ("GetBooleanProperty('tested')", "BOOL", True),
        ("GetVersionProperty('hardware')", "STRING", "2.0.1.0"),
        ("CONCAT(GetTitle(), GetVersion())", "STRING", "Pump station1.2"),
        ("LEN(GetTextProperty(key))", "INT", 4),
    ],
)
def test_program_gets_what_plc_toml_says(scratch: Path, call: str, declared: str, value: object) -> None:
    body = f"assigned := {call};"
    constant = "END_VAR\nVAR CONSTANT\nkey : STRING := 'serial';"
    with Simulator.from_sources(program(scratch, f"assigned : {declared};\n{constant}", body)) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.assigned") == value


def test_value_may_be_a_bound_and_an_initial_value(scratch: Path) -> None:
    variables = "a : ARRAY[1..GetNumberProperty('poles')] OF INT;\ntitle : STRING := GetTitle();"
    with Simulator.from_sources(program(scratch, variables, "a[4] := 7;")) as plc:
        plc.run_cycles(1)
        assert (plc.read("Main.a"), plc.read("Main.title")) == ([0, 0, 0, 7], "Pump station")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("GetTextProperty('seral')", "[information.properties] has no text 'seral'; did you mean serial?"),
        ("GetTextProperty('zzzz')", "[information.properties] has no text 'zzzz'; it has 'serial' and 'empty'"),
        ("GetTextProperty('poles')", "'poles' is a number, not a text; call GetNumberProperty"),
        ("GetTextProperty(s)", "the key of GetTextProperty is a constant text, such as 'serial'"),
        ("GetTextProperty(5)", "the key of GetTextProperty is a constant text, such as 'serial'"),
        ("GetTextProperty()", "GetTextProperty takes 1 argument: the key of a property, such as 'serial'"),
        ("GetTextProperty('serial', 'serial')", "GetTextProperty takes 1 argument"),
        ("GetTextProperty(nowhere)", "unknown name nowhere"),
        ("GetTitle(1)", "GetTitle takes no arguments"),
        ("GetTitel()", "unknown function GetTitel; did you mean GetTitle?"),
    ],
)
def test_mistake_in_a_call_is_an_error_with_a_hint(tool: Any, scratch: Path, call: str, message: str) -> None:
    program(scratch, "s : STRING;", f"s := {call};")
    done = tool("check")
    assert done.status == 2 and message in done.out


def test_key_that_is_missing_is_an_error_that_says_what_to_write(tool: Any, scratch: Path) -> None:
    program(scratch, "s : STRING; b : BOOL;", "s := GetTitle(); b := GetBooleanProperty('x');", information="")
    done = tool("check")
    assert '[information] of plc.toml has no title; write for example title = "..."' in done.out
    assert "[information.properties] has no bool 'x'; write there for example key = true" in done.out


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("p = [1]", "2:5: error: p can be a text, a number, true or false, or { version = "),
        ("p = 2020-01-01", "2:5: error: p can be a text, a number"),
        ("p = inf", "2:5: error: p can be a text, a number"),
        ('p = "a\\nb"', "2:5: error: p has a line break"),
        ('p = { version = "1.x" }', "error: p has the version '1.x'; a version is one to four numbers up to 65535"),
        ('p = { version = "1.2.3.4.5" }', "error: p has the version"),
        ('p = { version = "65536" }', "error: p has the version"),
        ("p = { version = 1 }", "error: version is a number; it has to be a text in quotes"),
        ('p = { versoin = "1" }', "error: there is no 'versoin' here; did you mean version?"),
        ("p = {}", "needs version: write for example version = "),
        ('"" = 1', "2:1: error: the key of a property has ASCII characters"),
    ],
)
def test_property_that_cannot_be_is_reported_with_its_line(tool: Any, scratch: Path, line: str, found: str) -> None:
    program(scratch, "n : INT;", "n := 1;", information=f"[information.properties]\n{line}\n")
    done = tool("check")
    assert done.status == 2 and found in done.err, done.err


def test_names_of_the_program_and_its_libraries_go_before_the_functions(tool: Any, scratch: Path) -> None:
    library = scratch / "Lib"
    library.mkdir()
    (library / "library.toml").write_text('name = "Lib"\nversion = "1.0"\n')
    (library / "lib.st").write_text("FUNCTION GetVersion : INT\nGetVersion := 7;\nEND_FUNCTION\n")
    before = "FUNCTION GetTitle : INT\nGetTitle := 5;\nEND_FUNCTION\n"
    program(scratch, "n, v : INT; GetCompany : INT;", "n := GetTitle(); v := GetVersion(); GetCompany := n;", before)
    (scratch / "plc.toml").write_text('libraries = ["Lib"]\n' + INFORMATION)
    out = tool("run", "--cycles", "1", "--get", "Main.*").out
    assert "Main.n = 5" in out and "Main.v = 7" in out and "Main.GetCompany = 5" in out


def test_tests_of_a_project_see_its_information(tool: Any, scratch: Path) -> None:
    test = "TEST 'title'\nASSERT_EQ(GetTitle(), 'Pump station');\nEND_TEST\n"
    program(scratch, "n : INT;", "n := 1;", test)
    assert tool("test").status == 0
    assert tool("check").status == 0


def test_changed_property_makes_the_image_stale(tool: Any, scratch: Path) -> None:
    program(scratch, "n : INT;", "n := GetNumberProperty('poles');")
    first = tool("info", "--json").json["crc"]
    assert tool("info", "--json").json["crc"] == first
    program(scratch, "n : INT;", "n := GetNumberProperty('poles');", information=INFORMATION.replace("4", "6"))
    assert tool("info", "--json").json["crc"] != first


def test_profile_is_in_the_image(tool: Any, scratch: Path) -> None:
    program(scratch, "n : INT;", "n := 1;")
    assert tool("info", "--json").json["info"]["profile"] == "small"
