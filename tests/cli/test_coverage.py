"""`plctool test --coverage`: which lines the tests run."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from conftest import Tool

ROOT = Path(__file__).parents[2]
SUITES = sorted((ROOT / "tests" / "st_unit").glob("*.st"))

PROGRAM = """FUNCTION Sign : INT
VAR_INPUT x : INT; END_VAR
IF x > 0 THEN
    Sign := 1;
ELSIF x < 0 THEN
    Sign := -1; // not run
ELSE
    Sign := 0; // not run
END_IF
END_FUNCTION

FUNCTION_BLOCK Pump
VAR_INPUT mode, divisor : INT; END_VAR
VAR i, sum, quotient : INT; END_VAR
CASE mode OF
    1: sum := 1;
    2: FOR i := 1 TO 3 DO
            sum := sum + i; IF sum > 100 THEN EXIT; END_IF
        END_FOR
    3: sum :=
            3; // not run, and the line above
ELSE
    WHILE sum < 10 DO
        sum := sum + 1; // not run, and the line above
    END_WHILE
END_CASE
IF divisor = 9 THEN
    JMP over;
END_IF
quotient := 100 / divisor;
sum := 0; // not run: a division by zero
over:
sum := sum + 1;

METHOD Open : BOOL
    Open := TRUE;
END_METHOD
METHOD Shut : BOOL
    Shut := TRUE; // not run
END_METHOD
PROPERTY Level : INT
    GET
        Level := 5;
    END_GET
    SET
        sum := Level; // not run
    END_SET
END_PROPERTY
END_FUNCTION_BLOCK
"""
TESTS = """
TEST 'positive'
VAR p : Pump; END_VAR
ASSERT_EQ(Sign(5), 1);
ASSERT_TRUE(p.Open());
ASSERT_EQ(p.Level, 5);
p(mode := 1, divisor := 9);
END_TEST
TEST 'divides by zero'
VAR p : Pump; END_VAR
p(mode := 2, divisor := 0);
END_TEST
"""


def not_run() -> list[int]:
    """What the comments in the program say."""
    lines = PROGRAM.splitlines()
    marked = [number for number, line in enumerate(lines, 1) if "not run" in line]
    split = [number for number in marked if "the line above" in lines[number - 1]]
    starts = {number for number in marked if lines[number - 1].strip() != "3; // not run, and the line above"}
    return sorted(starts | {number - 1 for number in split})


@pytest.mark.parametrize("level", ["0", "2"])
def test_lines_of_every_kind_of_statement(tool: Tool, level: str) -> None:
    """Also those before an exception, at which the test ends."""
    Path("pump.st").write_text(PROGRAM)
    Path("tests.st").write_text(TESTS)
    done = tool("test", "pump.st", "tests.st", "--coverage", "out", "-O", level, "--json")
    assert done.status == 1, done
    (file,) = done.json["coverage"]["files"]
    assert (file["file"], file["missing"]) == ("pump.st", not_run())
    assert done.json["coverage"]["percent"] == 100 * file["run"] // file["lines"]


def test_chosen_tests_count_only(tool: Tool) -> None:
    Path("pump.st").write_text(PROGRAM + TESTS)
    done = tool("test", "pump.st", "--coverage", "out", "-k", "positive")
    assert done.status == 0, done
    assert "not run: 6, 8, 17-18, 20, 23-24, 30-31, 39, 46" in done.out
    assert "coverage: " in done.out


def test_the_reports_have_the_same_lines(tool: Tool) -> None:
    Path("pump.st").write_text(PROGRAM + TESTS)
    done = tool("test", "pump.st", "--coverage", "deep/out", "--json")
    root = ElementTree.parse("deep/out/cobertura.xml").getroot()
    lines = {int(line.get("number", "0")): line.get("hits") for line in root.iter("line")}
    assert [number for number, hits in lines.items() if hits == "0"] == not_run()
    assert len(lines) == done.json["coverage"]["files"][0]["lines"]
    assert "pump.st" in Path("deep/out/index.html").read_text()
    (page,) = Path("deep/out").glob("*pump_st.html")
    assert "Sign" in page.read_text()


@pytest.mark.parametrize("source", ["../pump.st", "../link/pump.st"])
def test_sources_of_other_folders_are_in_the_reports(
    tool: Tool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, source: str
) -> None:
    Path("pump.st").write_text(PROGRAM + TESTS)
    Path("link").symlink_to(tmp_path)
    Path("here").mkdir()
    monkeypatch.chdir("here")
    assert tool("test", source, "--coverage", "out").status == 1  # one of the tests fails
    (found,) = ElementTree.parse("out/cobertura.xml").getroot().iter("class")
    assert found.get("filename", "").endswith("pump.st")
    assert len(list(Path("out").glob("*pump_st.html"))) == 1


def test_a_program_without_statements_has_no_report(tool: Tool) -> None:
    Path("empty.st").write_text("PROGRAM Main END_PROGRAM\nTEST 'a' ASSERT_TRUE(TRUE); END_TEST\n")
    done = tool("test", "empty.st", "--coverage", "out")
    assert done.status == 0 and "no statements" in done.out, done
    assert not Path("out").exists()


def test_a_project_in_one_file_is_listed_once(tool: Tool) -> None:
    """Each unit of it is a source; the lines are those of the file."""
    body = "<ST><xhtml xmlns='http://www.w3.org/1999/xhtml'>\nn := n + 1;\n</xhtml></ST>"
    declared = "<localVars><variable name='n'><type><INT/></type></variable></localVars>"
    pous = "".join(
        f"<pou name='P{n}' pouType='functionBlock'><interface>{declared}</interface><body>{body}</body></pou>\n"
        for n in range(2)
    )
    Path("plant.xml").write_text(
        "<project xmlns='http://www.plcopen.org/xml/tc6_0201'><types><dataTypes/><pous>"
        f"{pous}</pous></types><instances><configurations/></instances></project>"
    )
    Path("tests.st").write_text("TEST 'a' VAR p : P0; END_VAR p(); END_TEST\n")
    done = tool("test", "plant.xml", "tests.st", "--coverage", "out", "--json")
    assert done.status == 0, done
    assert [(file["file"], file["lines"], file["run"]) for file in done.json["coverage"]["files"]] == [
        ("plant.xml", 2, 1)
    ]


def test_exceptions_are_followed(tool: Tool) -> None:
    """Through the bodies of a __TRY."""
    Path("tries.st").write_text(
        "FUNCTION F : INT VAR_INPUT by : INT; END_VAR VAR exc : __SYSTEM.ExceptionCode; END_VAR\n"
        "__TRY\nF := 1 / by;\nF := 2;\n__CATCH(exc)\nF := 3;\n__FINALLY\nF := F + 10;\n__ENDTRY\nEND_FUNCTION\n"
        "TEST 'a' ASSERT_EQ(F(0), 13); END_TEST\n"
    )
    done = tool("test", "tries.st", "--coverage", "out", "--json")
    assert done.status == 0, done
    assert done.json["coverage"]["files"][0]["missing"] == [4]


def test_without_it_nothing_is_marked(tool: Tool) -> None:
    Path("pump.st").write_text(PROGRAM + TESTS)
    assert tool("test", "pump.st", "--json").json["coverage"] is None


@pytest.mark.parametrize("path", SUITES, ids=lambda path: path.stem)
def test_marks_change_no_result(tool: Tool, path: Path) -> None:
    plain, marked = (tool("test", str(path), "--json", *more).json for more in ((), ("--coverage", "out")))
    assert [(t["name"], t["failure"]) for t in plain["tests"]] == [(t["name"], t["failure"]) for t in marked["tests"]]


def test_a_source_is_not_overwritten(tool: Tool) -> None:
    Path("cobertura.xml").write_text("<project/>")
    done = tool("test", "cobertura.xml", "--coverage", ".")
    assert done.status == 2
    assert "cobertura.xml" in done.err and Path("cobertura.xml").read_text() == "<project/>"


def test_a_file_in_place_of_the_folder(tool: Tool) -> None:
    Path("pump.st").write_text(PROGRAM + TESTS)
    Path("out").write_text("mine")
    done = tool("test", "pump.st", "--coverage", "out")
    assert done.status == 2 and "out cannot be used" in done.err
    assert Path("out").read_text() == "mine"
