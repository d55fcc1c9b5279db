"""After a syntax error in one unit the others are checked; what may follow from it is not said."""

from __future__ import annotations

from pathlib import Path

import pytest
from front_support import messages

from plctool.compiler import load_sources
from plctool.compiler.front import check_sources

BROKEN = "FUNCTION_BLOCK Broken\nVAR_OUTPUT level INT; END_VAR\nlevel := 1;\nEND_FUNCTION_BLOCK\n"
OTHER = "PROGRAM Main\nVAR n : INT; b : Broken; END_VAR\nn := wrong;\nn := TRUE;\n{more}END_PROGRAM\n"
SAID = ["2:17: expected : before INT", "7:6: unknown name wrong", "8:6: BOOL does not fit INT; write BOOL_TO_INT(...)"]


def test_errors_of_other_units_are_said_with_it() -> None:
    assert messages(BROKEN + OTHER.format(more="")) == SAID


@pytest.mark.parametrize(
    "line", ["b();", "n := b.level;", "n := b.level + wrong2;", "n := level;", "b.level := TRUE;", "b(level => n);"]
)
def test_what_may_follow_from_it_is_not(line: str) -> None:
    found = messages(BROKEN + OTHER.format(more=line + "\n"))
    assert [m for m in found if "wrong2" not in m] == SAID


def test_globals_and_types_that_were_not_read_are_not_missing() -> None:
    text = "VAR_GLOBAL\ng-h : INT;\nEND_VAR\nTYPE Color : (red, green;\nEND_TYPE\n"
    main = "PROGRAM Main VAR c : Color; d : Colour; END_VAR\nc := red;\ng := 1;\nx := 2;\nEND_PROGRAM\n"
    found = messages(text + main)
    assert [m for m in found[2:] if "red" in m or ": g" in m] == []
    assert any("Colour" in m for m in found) and any("unknown name x" in m for m in found)


def test_the_unit_before_the_place_of_the_error_may_be_the_broken_one() -> None:
    text = "FUNCTION_BLOCK A\nVAR_OUTPUT q : INT; END_VAR\nq := 0;\n"
    main = (
        "PROGRAM Main VAR a : A; n : INT; END_VAR\nn := a.q;\nEND_PROGRAM\nPROGRAM P VAR m : INT; END_VAR\nm := 'x';\n"
    )
    found = messages(text + main + "END_PROGRAM\n")
    assert found[0] == "4:1: END_FUNCTION_BLOCK missing for the FUNCTION_BLOCK in line 1"
    assert [m.partition(":")[0] for m in found[1:]] == ["8"]


def test_program_with_an_error_in_its_own_xml_file_is_not_missing_for_its_task(tmp_path: Path) -> None:
    declaration = "PROGRAM MAIN\nVAR\n    a b : INT;\nEND_VAR\n"
    body = "<Implementation><ST><![CDATA[a := 1;]]></ST></Implementation>"
    pou = f'<POU Name="MAIN">\n<Declaration><![CDATA[{declaration}]]></Declaration>\n{body}</POU>'
    task = (
        '<Task Name="T"><CycleTime>10000</CycleTime><Priority>20</Priority><PouCall><Name>MAIN</Name></PouCall></Task>'
    )
    for name, inside in (("MAIN.TcPOU", pou), ("T.TcTTO", task)):
        (tmp_path / name).write_text(f'<?xml version="1.0"?>\n<TcPlcObject>\n{inside}\n</TcPlcObject>\n')
    files = "".join(f'<Compile Include="{name}"/>' for name in ("MAIN.TcPOU", "T.TcTTO"))
    (tmp_path / "p.plcproj").write_text(f"<Project><ItemGroup>{files}</ItemGroup></Project>")
    found = check_sources(load_sources([tmp_path])).diagnostics
    assert [(d.file.endswith("MAIN.TcPOU"), d.line) for d in found if d.severity == "error"] == [(True, 6)]
