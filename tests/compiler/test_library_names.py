"""Names of libraries that are given as sources: with their namespace in front, and bare where that is clear."""

from __future__ import annotations

from pathlib import Path

import pytest
from library_support import check, library, messages

from plctool import Simulator
from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.image.c_functions import interface_signature
from plctool.image.file import parse_image
from plctool.image.targets import host_target
from plctool.st_tests import run_tests

PUMPS = {
    "pump.st": """TYPE State : (Off, Running, Failed := 7); END_TYPE
INTERFACE IRun
METHOD Go : BOOL
END_METHOD
END_INTERFACE
FUNCTION_BLOCK Base
VAR_OUTPUT n : INT; END_VAR
n := n + Step();
END_FUNCTION_BLOCK
FUNCTION_BLOCK Pump EXTENDS Base IMPLEMENTS IRun
VAR_OUTPUT state : State; END_VAR
METHOD Go : BOOL
state := Running;
Go := TRUE;
END_METHOD
SUPER^();
END_FUNCTION_BLOCK
FUNCTION Twice : INT
VAR_INPUT x : INT; END_VAR
Twice := GVL.factor * x;
END_FUNCTION
""",
    "GVL.st": "VAR_GLOBAL\nfactor : INT := 2;\nEND_VAR\nVAR_GLOBAL CONSTANT\nLIMIT_ : INT := 9;\nEND_VAR\n",
    "sub/Par.st": "{attribute 'qualified_only'}\nVAR_GLOBAL CONSTANT\nMAX_ : INT := 3;\nEND_VAR\n",
    "step.st": "FUNCTION Step : INT\nStep := 1;\nEND_FUNCTION\n",
}


def built(folder: Path, text: str, *libraries: Path) -> BuildResult:
    """A program of one file."""
    (folder / "p").mkdir(exist_ok=True)
    (folder / "p/main.st").write_text(text)
    return compile_sources([folder / "p"], target=host_target(), libraries=libraries)


def values(folder: Path, text: str, names: list[str], *libraries: Path) -> list[object]:
    """What variables have after one cycle."""
    program = built(folder, text, *libraries)
    with Simulator(program.image, program.symbols) as plc:
        plc.run_cycles(1)
        return [plc.read(name) for name in names]


@pytest.mark.parametrize("space", ["Pumps.", "pumps.", ""])
def test_names_are_known_with_and_without_the_namespace(tmp_path: Path, space: str) -> None:
    text = f"""TYPE Pair : STRUCT a, b : {space}Pump; END_STRUCT; END_TYPE
FUNCTION_BLOCK Mine EXTENDS {space}Pump IMPLEMENTS {space}IRun
END_FUNCTION_BLOCK
PROGRAM Main
VAR p : {space}Pump; l : ARRAY[0..{space}Par.MAX_] OF {space}Pump; m : Mine; i : {space}IRun; ok : BOOL; pair : Pair;
    s : {space}State := {space}State.Failed; t : {space}State := {space}State.Running; x, f, g : INT;
END_VAR
p(); l[1](); m(); m.Go(); i := p; ok := i.Go(); pair.b();
x := {space}Twice({space}Twice(x := 5)) + {space}LIMIT_;
{space}GVL.factor := 4;
{space}Twice(1);
f := {space}factor;
g := {space}Par.MAX_;
END_PROGRAM
"""
    home = library(tmp_path, "Pumps", PUMPS)
    assert messages(check(tmp_path, text, home)) == []
    names = ["Main.p.n", "Main.l[1].n", "Main.m.state", "Main.ok", "Main.pair.b.n", "Main.s", "Main.t", "Main.x"]
    found = values(tmp_path, text, [*names, "Main.f", "Main.g"], home)
    assert found == [1, 1, "Running", True, 1, "Failed", "Running", 29, 4, 3]


def test_using_and_bare_values_of_enumerations(tmp_path: Path) -> None:
    home = library(tmp_path, "Pumps", PUMPS)
    text = "USING Pumps;\nPROGRAM Main\nVAR s : State; n : INT; END_VAR\ns := Failed;\nn := Twice(LIMIT_);\nEND_PROGRAM"
    assert messages(check(tmp_path, text, home)) == []


def test_names_of_the_program_come_first(tmp_path: Path) -> None:
    home = library(tmp_path, "Pumps", PUMPS)
    text = """FUNCTION Twice : INT
VAR_INPUT x : INT; END_VAR
Twice := 100;
END_FUNCTION
FUNCTION Step : INT
Step := 50;
END_FUNCTION
TYPE State : (Running, Waiting); END_TYPE
VAR_GLOBAL factor : INT := 30; END_VAR
PROGRAM Main
VAR p : Pump; own, lib : INT; s : State := Running; t : Pumps.State := Pumps.State.Running; END_VAR
p();
own := Twice(1);
lib := Pumps.Twice(1);
END_PROGRAM
"""
    assert messages(check(tmp_path, text, home)) == []
    assert values(tmp_path, text, ["Main.own", "Main.lib", "Main.p.n"], home) == [100, 2, 1]


def test_library_does_not_see_the_program(tmp_path: Path) -> None:
    home = library(tmp_path, "Ask", {"ask.st": "FUNCTION Ask1 : INT\nAsk1 := OfProgram();\nEND_FUNCTION"})
    text = "FUNCTION OfProgram : INT\nOfProgram := 1;\nEND_FUNCTION\nPROGRAM Main\nAsk.Ask1();\nEND_PROGRAM"
    assert messages(check(tmp_path, text, home)) == ["ask.st:2: unknown function OfProgram"]


def test_name_that_two_libraries_have_needs_its_namespace(tmp_path: Path) -> None:
    one, two = (
        library(tmp_path, name, {"f.st": f"FUNCTION Get : INT\nGet := {value};\nEND_FUNCTION\nTYPE T : INT; END_TYPE"})
        for name, value in (("One", 1), ("Two", 2))
    )
    text = "PROGRAM Main\nVAR n : INT; t : T; END_VAR\nn := Get();\nn := One.Get() + Two.Get();\nEND_PROGRAM"
    assert messages(check(tmp_path, text, one, two)) == [
        "main.st:2: unknown type T; write One.T or Two.T",
        "main.st:3: unknown function Get; write One.Get or Two.Get",
    ]
    assert messages(check(tmp_path, text, one)) == ["main.st:4: unknown name Two"]


def test_types_of_one_name_in_two_libraries_are_different(tmp_path: Path) -> None:
    types = "TYPE Mode : ({0}) := {1};\nConfig : STRUCT {2} mode : Mode; limit : INT := {3}; END_STRUCT; END_TYPE"
    one, two = (
        library(tmp_path, name, {"t.st": types.format(*words)})
        for name, words in {
            "One": ("Off, On", "On", "", 10),
            "Two": ("Cold, Warm, Hot", "Hot", "p : LINT;", 20),
        }.items()
    )
    text = "PROGRAM Main\nVAR a : One.Config; b : Two.Config; END_VAR\nEND_PROGRAM"
    names = ["Main.a.limit", "Main.b.limit", "Main.a.mode", "Main.b.mode"]
    assert values(tmp_path, text, names, one, two) == [10, 20, "On", "Hot"]


def test_c_function_has_one_signature_in_a_library_and_in_what_imports_it(tmp_path: Path) -> None:
    text = (
        "TYPE Point : STRUCT x : INT; END_STRUCT; END_TYPE\nFUNCTION_BLOCK Fb\nEND_FUNCTION_BLOCK\n"
        "{attribute 'external' := 'draw'}\nFUNCTION Draw : BOOL\n"
        "VAR_IN_OUT p : Point; l : ARRAY[1..2] OF Point; f : Fb; END_VAR\nEND_FUNCTION\n"
    )
    program = "PROGRAM Main\nVAR p : Point; l : ARRAY[1..2] OF Point; f : Fb; END_VAR\nDraw(p, l, f);\nEND_PROGRAM"
    home = library(tmp_path, "Lib", {"draw.st": text})
    alone, importing = (
        {e.name: e.signature for e in parse_image(built(tmp_path, source, *libraries).image).externals}["draw"]
        for source, libraries in ((text + program, []), (program, [home]))
    )
    assert alone == importing == interface_signature("draw(&POINT,&ARRAY[1..2] OF POINT,&FB):BOOL")


def test_library_uses_what_it_depends_on(tmp_path: Path) -> None:
    library(tmp_path, "Base", {"b.st": "FUNCTION Raw : INT\nRaw := 20;\nEND_FUNCTION"})
    top = library(tmp_path, "Top", {"t.st": "FUNCTION Get : INT\nGet := Raw() + Base.Raw();\nEND_FUNCTION"}, Base="1.0")
    other = library(tmp_path, "Other", {"o.st": "FUNCTION Raw : INT\nRaw := 1;\nEND_FUNCTION"})
    text = "PROGRAM Main\nVAR n : INT; END_VAR\nn := Get();\nEND_PROGRAM"
    assert values(tmp_path, text, ["Main.n"], top, other) == [40]


def test_internal_units_are_for_the_library(tmp_path: Path) -> None:
    inside = "FUNCTION INTERNAL Inside : INT\nInside := 1;\nEND_FUNCTION\n"
    home = library(tmp_path, "Lib", {"i.st": f"{inside}FUNCTION Outside : INT\nOutside := Inside();\nEND_FUNCTION"})
    text = "PROGRAM Main\nVAR n : INT; END_VAR\nn := Outside();\nn := Lib.Inside();\nEND_PROGRAM"
    assert len(messages(check(tmp_path, text, home))) == 1


def test_name_that_the_library_lacks_has_a_suggestion(tmp_path: Path) -> None:
    home = library(tmp_path, "Pumps", PUMPS)
    text = "PROGRAM Main\nVAR p : Pumps.Pum; n : INT; END_VAR\nn := Pumps.Twicee(2);\nn := Twicee(2);\nEND_PROGRAM"
    found = messages(check(tmp_path, text, home))
    assert len(found) == 3
    assert all("did you mean" in message for message in found), found


def test_standard_library_stands_in_where_a_library_has_no_such_name(tmp_path: Path) -> None:
    home = library(tmp_path, "Util", {"u.st": "FUNCTION Own : INT\nOwn := 3;\nEND_FUNCTION"})
    text = "PROGRAM Main\nVAR b : Util.BLINK; c : BLINK; n : INT; END_VAR\nb(); c();\nn := Util.Own();\nEND_PROGRAM"
    assert messages(check(tmp_path, text, home)) == []


def test_library_comes_before_the_standard_library(tmp_path: Path) -> None:
    block = "FUNCTION_BLOCK BLINK\nVAR_OUTPUT own : INT := 8; END_VAR\nEND_FUNCTION_BLOCK"
    home = library(tmp_path, "Util", {"u.st": block})
    text = "PROGRAM Main\nVAR b : BLINK; c : Util.BLINK; n : INT; END_VAR\nn := b.own + c.own;\nEND_PROGRAM"
    assert values(tmp_path, text, ["Main.n"], home) == [16]


def test_tests_programs_and_configurations_of_a_library_are_its_own(tmp_path: Path) -> None:
    more = "PROGRAM Main\nEND_PROGRAM\nTEST 'x'\nASSERT_EQ(Step(), 2);\nEND_TEST\nCONFIGURATION C\nEND_CONFIGURATION\n"
    home = library(tmp_path, "Pumps", {**PUMPS, "more.st": more})
    text = "PROGRAM Main\nVAR n : INT; END_VAR\nn := Step();\nEND_PROGRAM"
    assert messages(check(tmp_path, text, home)) == []
    assert not check(tmp_path, text, home).has_tests


def test_tests_of_a_program_use_and_mock_its_libraries(tmp_path: Path) -> None:
    home = library(tmp_path, "Pumps", PUMPS)
    (tmp_path / "t.st").write_text(
        "TEST 'use'\nASSERT_EQ(Pumps.Twice(3), 6);\nEND_TEST\n"
        "TEST 'block'\nVAR p : Pumps.Pump; END_VAR\np();\nASSERT_TRUE(p.Go());\nASSERT_EQ(p.n, 1);\nEND_TEST\n"
    )
    report = run_tests([tmp_path / "t.st"], libraries=[home])
    assert [outcome.failure for outcome in report.outcomes] == [None, None]


def test_functions_and_blocks_of_a_library_are_mocked(tmp_path: Path) -> None:
    outside = "{attribute 'external' := 'read_it'}\nFUNCTION ReadIt : INT\nEND_FUNCTION\n"
    reads = "FUNCTION Reads : INT\nReads := ReadIt() + 1;\nEND_FUNCTION\n"
    home = library(tmp_path, "Pumps", {**PUMPS, "out.st": outside + reads})
    (tmp_path / "t.st").write_text(
        "TEST 'function'\nMOCK_FUNCTION Twice RETURNS 42;\nASSERT_EQ(Pumps.Twice(3), 42);\nEND_TEST\n"
        "TEST 'block'\nVAR p : Pumps.Pump; END_VAR\nMOCK p;\np();\nASSERT_EQ(p.n, 0);\n"
        "MOCK_VERIFY_CALLED(p);\nEND_TEST\n"
        "TEST 'method'\nVAR p : Pumps.Pump; END_VAR\nMOCK_FUNCTION p.Go RETURNS FALSE;\n"
        "ASSERT_FALSE(p.Go());\nEND_TEST\n"
        "TEST 'in C'\nMOCK_FUNCTION ReadIt RETURNS 6;\nASSERT_EQ(Pumps.Reads(), 7);\nEND_TEST\n"
        "TEST 'in C, not mocked'\nASSERT_EQ(Pumps.Reads(), 7);\nEND_TEST\n"
    )
    report = run_tests([tmp_path / "t.st"], libraries=[home])
    *right, last = [outcome.failure for outcome in report.outcomes]
    assert right == [None] * 4
    assert last is not None and "mock it with MOCK_FUNCTION" in last.text


def test_mistake_in_the_syntax_of_a_library_has_no_further_errors(tmp_path: Path) -> None:
    home = library(tmp_path, "Lib", {"f.st": "FUNCTION Get : INT\nGet := ;\nEND_FUNCTION"})
    found = messages(check(tmp_path, "PROGRAM Main\nVAR n : INT; END_VAR\nn := Get();\nn := 'x';\nEND_PROGRAM", home))
    assert [message[:7] for message in found] == ["f.st:2:"]


def test_project_of_python_has_its_libraries(tmp_path: Path) -> None:
    library(tmp_path, "Pumps", PUMPS)
    (tmp_path / "main.st").write_text("PROGRAM Main\nVAR n : INT; END_VAR\nn := Pumps.Twice(4);\nEND_PROGRAM")
    (tmp_path / "plc.toml").write_text('sources = ["main.st"]\nlibraries = ["Pumps"]')
    with Simulator.from_sources(tmp_path) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.n") == 8
