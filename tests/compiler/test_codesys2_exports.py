"""Exports of CODESYS 2.3: the sections beside the units, comments that do not nest, diagrams."""

from __future__ import annotations

from pathlib import Path

import pytest

from plctool.compiler import compile_sources, load_sources
from plctool.compiler.front import check_sources
from plctool.compiler.syntax.diagnostics import Diagnostic
from plctool.sim import Simulator

HEADER = (
    "(* @NESTEDCOMMENTS := 'Yes' *)\n(* @PATH := '' *)\n(* @OBJECTFLAGS := '0, 8' *)\n(* @SYMFILEFLAGS := '2048' *)\n"
)
PROGRAM = f"""{HEADER}PROGRAM PLC_PRG
VAR
    n : INT;
END_VAR
(* @END_DECLARATION := '0' *)
n := n + 1;
END_PROGRAM

ACTION Twice:
(* @TEXT_IMPLEMENTATION := 'ST' *)
n := n * 2;
END_ACTION
"""
LIBRARY = f"""
{HEADER}LIBRARY
STANDARD.LIB 5.6.98 12:03:02
(* @LIBRARYSYMFILEINFO := '0' *)
NumOfPOUs: 2
ASCIIBYTE_TO_STRING: 0
CONCAT: 0
NumOfGVLs: 0
END_LIBRARY
"""
VISUALISATION = f"""
{HEADER}VISUALISATION Overview
_SIMPLE : 1
_ORIGINPOINT : 0,0
_OBJECTTEXT : 'it$'s (* fine'
END_VISUALISATION
"""
TASKS = f"""
{HEADER}RESOURCE
TASK Quick (INTERVAL := T#5ms , PRIORITY := 1)
    PLC_PRG();
TASK Slow (PRIORITY := 9, INTERVAL := T#40ms)
    Other();
END_RESOURCE
"""
OTHER = "PROGRAM Other\nVAR\n    m : INT;\nEND_VAR\nm := m + 1;\nEND_PROGRAM\n"
HARDWARE = f"""
{HEADER}PLC_CONFIGURATION
_GLOBAL
_VERSION: 3
_AUTOADR: 0
_END_GLOBAL

_MODULE: '3S'
_SECTION_NAME: 'Root'
_INDEX_IN_PARENT: '-1'
_IECIN: %IB0

_CHANNEL
_SECTION_NAME: 'BOOLOnX_I'
_INDEX_IN_PARENT: '1'
_SYMBOLIC_NAME: 'Button'
_COMMENT: ''
_CHANNEL_MODE: 'I'
_IECADR: %IX2.3
_END_CHANNEL

_CHANNEL
_SECTION_NAME: 'WordOutput'
_SYMBOLIC_NAME: 'Speed'
_CHANNEL_MODE: 'Q'
_IECADR: %QW4
_END_CHANNEL

_CHANNEL
_SECTION_NAME: 'FloatInput'
_SYMBOLIC_NAME: 'Level'
_CHANNEL_MODE: 'I'
_IECADR: %ID3
_END_CHANNEL

_CHANNEL
_SYMBOLIC_NAME: ''
_IECADR: %QW6
_END_CHANNEL
_END_MODULE
PLC_END
"""
SETTINGS = """
_ALARMCONFIG
_ALARMCONFIGNEXTTEXTID : 10002
_ALARMCLASSLIST : 1
_ALARMCLASSID : 0
END_ALARMCONFIG

_WORKSPACE
_GLOBALVISUALSETTINGS
_VISUALSETTINGSFLAGS : '',0,'',''
_END_GLOBALVISUALSETTINGS
_END_WORKSPACE
"""


def found(folder: Path, text: str) -> list[Diagnostic]:
    """What is said of an export."""
    (folder / "plant.EXP").write_text(text, "latin-1", newline="\r\n")
    return check_sources(load_sources([folder])).diagnostics


def started(folder: Path) -> Simulator:
    """Its program, ready to run."""
    built = compile_sources([folder])
    return Simulator(built.image, built.symbols)


def test_a_whole_project_runs_and_what_is_left_out_is_named(tmp_path: Path) -> None:
    text = LIBRARY + PROGRAM + VISUALISATION + OTHER + HARDWARE + TASKS + SETTINGS
    (only,) = found(
        tmp_path, text.replace("n := n + 1;", "n := n + 1;\nIF Button THEN\n    Speed := REAL_TO_WORD(Level);\nEND_IF;")
    )
    assert (only.severity, only.code) == ("warning", "left-out")
    assert only.message == "left out: the library STANDARD.LIB, VISUALISATION Overview, _ALARMCONFIG, _WORKSPACE"
    with started(tmp_path) as plc:
        plc.write({"Button": True})
        plc.write({"Level": 7.0})
        plc.run_cycles(1)
        assert plc.read("PLC_PRG.n") == 1
        assert plc.read("Speed") in (7, "16#0007")


def test_tasks_run_their_programs(tmp_path: Path) -> None:
    (tmp_path / "x").mkdir()
    assert not found(tmp_path, PROGRAM + OTHER + TASKS)
    program = check_sources(load_sources([tmp_path])).program
    assert program is not None
    assert [(t.name, t.interval_us, t.priority, [p.name for p in t.programs]) for t in program.tasks] == [
        ("Quick", 5000, 1, ["PLC_PRG"]),
        ("Slow", 40000, 9, ["Other"]),
    ]


@pytest.mark.parametrize("section", [LIBRARY, VISUALISATION, SETTINGS, HARDWARE, LIBRARY.replace("END_LIBRARY\n", "")])
def test_a_section_moves_no_line(tmp_path: Path, section: str) -> None:
    text = section + PROGRAM.replace("n + 1", "n + k")
    (error,) = [d for d in found(tmp_path, text) if d.severity == "error"]
    assert error.message == "unknown name k"
    line = text.splitlines()[error.line - 1]
    assert line[error.column - 1 :] == "k;"


def test_a_section_in_a_file_of_its_own_is_no_error(tmp_path: Path) -> None:
    (tmp_path / "lib.exp").write_text(LIBRARY)
    (tmp_path / "hardware.exp").write_text(HARDWARE)
    diagnostics = found(tmp_path, PROGRAM.replace("n + 1", "n + Speed"))
    assert [d for d in diagnostics if d.severity == "error" and d.code != "type"] == []


def test_comments_that_do_not_nest(tmp_path: Path) -> None:
    text = PROGRAM.replace("'Yes'", "'No'").replace("n := n + 1;", "(* a (* it's *)\nn := n + 1;")
    assert not found(tmp_path, text)
    assert found(tmp_path, text.replace("'No'", "'Yes'"))


def test_a_mark_in_a_comment_of_a_section_that_is_left_out_moves_nothing(tmp_path: Path) -> None:
    library = LIBRARY.replace("'Yes'", "'No'").replace("CONCAT: 0", "(* a (* b *)\nCONCAT: 0")
    (error,) = [d for d in found(tmp_path, library + PROGRAM.replace("n + 1", "n + k")) if d.severity == "error"]
    assert (library + PROGRAM).splitlines()[error.line - 1] == "n := n + 1;"


def test_a_section_for_tasks_without_any_is_left_out(tmp_path: Path) -> None:
    (only,) = found(tmp_path, PROGRAM + f"{HEADER}RESOURCE\nEND_RESOURCE\n")
    assert only.message == "left out: RESOURCE"


@pytest.mark.parametrize("language", ["CFC", "SFC"])
def test_a_diagram_is_refused_by_name_and_the_rest_is_checked(tmp_path: Path, language: str) -> None:
    drawn = PROGRAM.replace(
        "n := n + 1;", f"_{language}_BODY\n_NETWORKS : 1\n_NETWORK\n_COMMENT\n''\n_END_COMMENT\n==>x"
    )
    text = drawn + OTHER.replace("m + 1", "m + k")
    errors = [d for d in found(tmp_path, text) if d.severity == "error"]
    assert [d.message for d in errors] == [
        f"PLC_PRG is written in {language}; only Structured Text can be compiled",
        "unknown name k",
    ]
    assert [text.splitlines()[d.line - 1] for d in errors] == [f"_{language}_BODY", "m := m + k;"]


@pytest.mark.parametrize("first", ["LD\tn", "ldn n", "again:\nLD n", "(* LD *)\nCAL t(IN := x)"])
def test_a_list_of_instructions_with_an_error_is_named_and_the_rest_is_checked(tmp_path: Path, first: str) -> None:
    listed = PROGRAM.replace("n := n + 1;", f"{first}\nADD 1\nCAL t(PT := T#1s)\nST")
    text = listed + OTHER.replace("m + 1", "m + k")
    errors = [d for d in found(tmp_path, text) if d.severity == "error"]
    assert [d.message for d in errors] == ["ST needs an operand; write ST and a name", "unknown name k"]
    assert text.splitlines()[errors[0].line - 1] == "ST"


def test_lists_of_instructions_run_with_comments_that_do_not_nest(tmp_path: Path) -> None:
    text = PROGRAM.replace("'Yes'", "'No'").replace("    n : INT;", "    n : INT;\n    s : STRING := 'a';")
    text = text.replace("n := n + 1;", "LD s (* (* *)\nCONCAT '(* b'\nST s\nLD n\nADD 1\nST n")
    (tmp_path / "plc.EXP").write_text(text.replace("n := n * 2;", "LD\tn\nMUL 2\nST\tn"))
    with started(tmp_path) as plc:
        plc.run_cycles(2)
        assert (plc.read("PLC_PRG.n"), plc.read("PLC_PRG.s")) == (2, "a(* b(* b")


@pytest.mark.parametrize("statement", ["LD := n;", "LD(n);", "LD; CAL := n;"])
def test_a_name_like_an_instruction_is_a_name(tmp_path: Path, statement: str) -> None:
    text = PROGRAM.replace("n := n + 1;", statement)
    assert [d.message for d in found(tmp_path, text) if " IL" in d.message] == []


def test_what_a_person_misspelt_is_still_an_error(tmp_path: Path) -> None:
    errors = found(tmp_path, PROGRAM.replace("PROGRAM PLC_PRG", "PROGRM PLC_PRG"))
    assert any("PROGRM" in d.message for d in errors)


def test_a_function_block_may_be_written_in_one_word(tmp_path: Path) -> None:
    block = "FUNCTIONBLOCK Pulse\nVAR_OUTPUT\n\tn: INT;\nEND_VAR\nn := n + 1;\nEND_FUNCTION_BLOCK\n"
    main = "PROGRAM PLC_PRG\nVAR\n\tp: Pulse;\nEND_VAR\np();\nEND_PROGRAM\n"
    (tmp_path / "plc.EXP").write_text(block + main)
    with started(tmp_path) as plc:
        plc.run_cycles(2)
        assert plc.read("PLC_PRG.p.n") == 2
