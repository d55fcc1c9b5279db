"""What a program needs and nothing declares: all of it, by library, without the errors that follow from it."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.cli.commands.programs import check
from plctool.cli.projects import Settings
from plctool.compiler import program_files
from plctool.compiler.base.missing_names import library_of
from plctool.compiler.base.source import Source
from plctool.compiler.front import check_sources
from plctool.compiler.syntax.warnings import ALL_WARNINGS


def errors(text: str) -> list[str]:
    """The messages of all errors."""
    return [d.message for d in check_sources([Source("f.st", text)]).diagnostics if d.severity == "error"]


AXIS = """FUNCTION_BLOCK Drive
VAR_IN_OUT axis : AXIS_REF; END_VAR
VAR_INPUT go : BOOL; END_VAR
VAR power : MC_Power; END_VAR
power(Axis := axis, Enable := go);
axis.Status := power.Error OR (power.ErrorID > 0);
END_FUNCTION_BLOCK
"""


def test_the_use_of_a_parameter_of_an_unknown_type_is_no_second_error() -> None:
    use = "d(axis := a, go := TRUE);\na := d.power.Done;"
    text = f"{AXIS}PROGRAM Main\nVAR d : Drive; a : BOOL; END_VAR\n{use}\nEND_PROGRAM"
    assert errors(text) == ["unknown type AXIS_REF", "unknown type MC_Power"]


def test_what_may_be_inherited_from_an_unknown_block_is_no_second_error() -> None:
    text = """FUNCTION_BLOCK Own EXTENDS Nowhere
METHOD Work : BOOL
SUPER^.Work();
Work := inherited > 3;
other(1);
END_METHOD
END_FUNCTION_BLOCK
PROGRAM Main
VAR o : Own; b : BOOL; END_VAR
o.Work();
o.Start();
b := o.ready;
END_PROGRAM
"""
    assert errors(text) == ["unknown function block Nowhere"]


def test_errors_that_follow_from_nothing_stay() -> None:
    text = AXIS.replace("AXIS_REF", "BOOL").replace("VAR power : MC_Power; END_VAR", "").partition("power(")[0]
    text += "END_FUNCTION_BLOCK\nPROGRAM Main\nVAR d : Drive; a : BOOL; END_VAR\n"
    text += "d(axsi := a);\na := d.nothing;\nEND_PROGRAM"
    assert errors(text) == ["Drive has no parameter axsi; did you mean axis?", "Drive has no variable nothing"]


def test_unknown_names_do_not_hide_other_errors() -> None:
    unknown = "".join(f"x{i}zq : Missing{i}Qq;\n" for i in range(50))
    text = f"PROGRAM Main\nVAR\n{unknown}n : INT;\nEND_VAR\nn := 'text';\nEND_PROGRAM"
    found = errors(text)
    assert len(found) == 51
    assert any("STRING" in message for message in found)


def test_many_missing_names_are_one_line_for_each_library(tmp_path: Path) -> None:
    calls = "".join(f"MC_Thing{i}(a);\n" for i in range(30)) + "ADSREADEX(a);\nADSREADEX(a);\nWxyz(a);\n"
    (tmp_path / "main.st").write_text(f"PROGRAM Main\nVAR a : INT; END_VAR\n{calls}a := 'x';\nEND_PROGRAM\n")
    document, texts = check(Settings(program_files([tmp_path]), ALL_WARNINGS))
    assert "STRING" in texts[0]
    assert texts[-5:-1] == [
        "The program uses 32 names that nothing declares, in 33 places:",
        "  Tc2_MC2 or SM3_Basic (motion): MC_Thing0 (1), MC_Thing1 (1), MC_Thing10 (1), MC_Thing11 (1), "
        "MC_Thing12 (1), MC_Thing13 (1), MC_Thing14 (1), MC_Thing15 (1), and 22 more; "
        f"first at {tmp_path}/main.st:3",
        f"  Tc2_System: ADSREADEX (2); first at {tmp_path}/main.st:33",
        f"  no library known here: Wxyz (1); first at {tmp_path}/main.st:35",
    ]
    assert [m["count"] for m in document["missing"] if m["name"] == "ADSREADEX"] == [2]
    assert len(document["diagnostics"]) == 34


def test_few_missing_names_are_shown_where_they_are(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text("PROGRAM Main\nADSREADEX(1);\nEND_PROGRAM\n")
    _, texts = check(Settings(program_files([tmp_path]), ALL_WARNINGS))
    assert texts[0].endswith("main.st:2:1: error: unknown function ADSREADEX\nADSREADEX(1);\n^")


def test_a_few_names_of_one_library_are_one_line_after_everything_else(tmp_path: Path) -> None:
    """Variables that nothing else uses are not mentioned before it, but remain in the document."""
    declared = "a : AXIS_REF; p : MC_Power; q : MC_Stop; x : Wxyz; u : INT;"
    (tmp_path / "main.st").write_text(f"PROGRAM Main\nVAR {declared} END_VAR\np();\nq();\nEND_PROGRAM\n")
    document, texts = check(Settings(program_files([tmp_path]), ALL_WARNINGS))
    assert [text.splitlines()[0].partition("error: ")[2] for text in texts[:-3]] == ["unknown type Wxyz"]
    assert texts[-3:] == [
        "The program uses 3 names that nothing declares, in 3 places:",
        f"  Tc2_MC2 or SM3_Basic (motion): AXIS_REF (1), MC_Power (1), MC_Stop (1); first at {tmp_path}/main.st:2",
        "Give the sources of these libraries with the program, or declare the names.",
    ]
    assert "unused" in {d["code"] for d in document["diagnostics"]}


def test_unused_variables_are_told_when_no_table_follows(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(
        "PROGRAM Main\nVAR a : AXIS_REF; p : MC_Power; u : INT; END_VAR\np();\nEND_PROGRAM\n"
    )
    _, texts = check(Settings(program_files([tmp_path]), ALL_WARNINGS))
    assert any("u is never used" in text for text in texts)
    assert sum("unknown type" in text for text in texts) == 2


@pytest.mark.parametrize(
    ("name", "library"),
    [
        ("mc_power", "Tc2_MC2 or SM3_Basic (motion)"),
        ("T_AmsNetId", "Tc2_System"),
        ("FB_FormatString2", "Tc2_Utilities"),
        ("SysFile.SysFileOpen", "Sys libraries of CODESYS"),
        ("F_Mine", ""),
        ("PressStation", ""),
    ],
)
def test_a_library_is_known_by_the_names_in_it(name: str, library: str) -> None:
    assert library_of(name) == library


def test_a_syntax_error_in_one_file_hides_no_name_that_another_needs() -> None:
    broken = Source("broken.st", "FUNCTION_BLOCK Mine\nVAR_OUTPUT a : INT; END_VAR\na := := 1;\nEND_FUNCTION_BLOCK")
    whole = Source("whole.st", "PROGRAM Main\nVAR m : Mine; p : MC_Power; END_VAR\nm();\nm.b := 'x';\nEND_PROGRAM")
    found = [(d.file, d.message) for d in check_sources([broken, whole]).diagnostics if d.severity == "error"]
    assert found == [
        ("broken.st", "expected a value before :="),
        ("whole.st", "unknown type MC_Power"),
    ]
