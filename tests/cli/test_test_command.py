"""`plctool test`: what it runs, what it says, how it ends."""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from conftest import Done, Tool

from plctool.sim import Simulator

ROOT = Path(__file__).parents[2]
PASSING = sorted((ROOT / "tests" / "st_unit").glob("*.st"))
EXAMPLES = sorted({path.parent for path in (ROOT / "examples").rglob("tests.st")})

COUNTER = """
FUNCTION_BLOCK Counter
VAR_OUTPUT value : INT; END_VAR
value := value + 1;
END_FUNCTION_BLOCK
"""


def write(text: str, name: str = "program.st") -> Path:
    path = Path(name)
    path.write_text(text, "utf-8")
    return path


def failure(tool: Tool, body: str, before: str = "") -> dict[str, object]:
    """How a test with this body fails. Its first line is line 2 of the file when nothing is before it."""
    done = tool("test", str(write(f"{before}TEST 't'\n{body}\nEND_TEST\n")), "--json")
    assert done.status == 1, done
    (test,) = done.json["tests"]
    assert not test["passed"]
    found: dict[str, object] = test["failure"]
    return found


def diagnoses(tool: Tool, text: str) -> Done:
    done = tool("test", str(write(text)))
    assert done.status == 2
    return done


# ---- what passes -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", PASSING, ids=lambda p: p.stem)
def test_every_test_of_the_notation_passes(tool: Tool, path: Path) -> None:
    done = tool("test", str(path))
    assert done.status == 0, done.out + done.err
    assert "FAIL" not in done.out


@pytest.mark.parametrize("path", PASSING, ids=lambda p: p.stem)
def test_optimised_code_gives_the_same_results(tool: Tool, path: Path) -> None:
    assert tool("test", str(path), "-O2").status == 0


@pytest.mark.parametrize("folder", EXAMPLES, ids=lambda p: p.name)
def test_examples_pass_their_own_tests(tool: Tool, folder: Path) -> None:
    done = tool("test", str(folder))
    assert done.status == 0, done.out + done.err


@pytest.mark.parametrize("folder", EXAMPLES, ids=lambda p: p.name)
def test_tests_leave_no_trace_in_the_image(tool: Tool, folder: Path) -> None:
    shutil.copytree(folder, "with/app")
    shutil.copytree(folder, "without/app")
    Path("without/app/tests.st").unlink()
    crcs = [tool("build", f"{name}/app", "-o", f"{name}.cdl", "--json").json["crc"] for name in ("with", "without")]
    assert crcs[0] == crcs[1]


def test_several_programs_need_no_configuration(tool: Tool) -> None:
    programs = "PROGRAM A VAR n : INT; END_VAR n := 1; END_PROGRAM PROGRAM B VAR n : INT; END_VAR n := 2; END_PROGRAM"
    path = write(f"{programs}\nTEST 't' VAR a : A; b : B; END_VAR a(); b(); ASSERT_EQ(a.n + b.n, 3); END_TEST")
    assert tool("test", str(path)).status == 0


def test_tests_may_stand_in_a_file_of_their_own(tool: Tool) -> None:
    write(COUNTER, "counter.st")
    write("TEST 't' VAR c : Counter; END_VAR c(); ASSERT_EQ(c.value, 1); END_TEST", "test_counter.st")
    assert tool("test", "counter.st", "test_counter.st").status == 0


# ---- what fails ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("statement", "text", "actual", "expected"),
    [
        ("ASSERT_EQ(i, 5)", "expected 5, got 4", 4, 5),
        ("ASSERT_EQ(5, i)", "expected 4, got 5", 5, 4),
        ("ASSERT_NEQ(i, 4)", "expected anything but 4", 4, 4),
        ("ASSERT_GT(i, 4)", "expected > 4, got 4", 4, 4),
        ("ASSERT_GE(i, 5)", "expected >= 5, got 4", 4, 5),
        ("ASSERT_LT(i, 4)", "expected < 4, got 4", 4, 4),
        ("ASSERT_LE(i, 3)", "expected <= 3, got 4", 4, 3),
        ("ASSERT_NEAR(r, 2.0, 0.25)", "expected 2.0 +- 0.25, got 1.5", 1.5, 2.0),
        ("ASSERT_NEAR(u, 5, 1)", "expected 5 +- 1, got 3", 3, 5),
        ("ASSERT_TRUE(i = 5)", "expected TRUE, got FALSE", False, True),
        ("ASSERT_FALSE(i = 4)", "expected FALSE, got TRUE", True, False),
        ("ASSERT_EQ(w, 16#F1)", "expected 16#00F1, got 16#00F0", 0xF0, 0xF1),
        ("ASSERT_EQ(t, T#2s)", "expected T#2s, got T#1s500ms", "T#1s500ms", "T#2s"),
        ("ASSERT_EQ(s, 'b$'c')", "expected 'b$'c', got 'text'", "text", "b'c"),
        ("ASSERT_EQ(m, Mode.Busy)", "expected Busy, got Idle", "Idle", "Busy"),
        ("ASSERT_EQ(q, 0.1)", "expected 0.1, got 0.2", 0.2, 0.1),
        ("ASSERT_EQ(1, 2)", "expected 2, got 1", 1, 2),
    ],
)
def test_a_failing_assert_shows_both_values(
    tool: Tool, statement: str, text: str, actual: object, expected: object
) -> None:
    variables = (
        "VAR i : INT := 4; r : LREAL := 1.5; q : REAL := 0.2; u : UINT := 3; w : WORD := 16#F0; t : TIME := T#1500ms; "
        "s : STRING := 'text'; m : Mode; END_VAR"
    )
    found = failure(tool, f"{variables}\n{statement};", "TYPE Mode : (Idle, Busy); END_TYPE ")
    assert (found["text"], found["actual"], found["expected"]) == (text, actual, expected)
    assert (found["kind"], found["file"], found["line"]) == (statement.partition("(")[0], "program.st", 3)


def test_operands_are_evaluated_once(tool: Tool) -> None:
    counting = "FUNCTION Next : INT\ntotal := total + 1; Next := total;\nEND_FUNCTION\n"
    found = failure(tool, "ASSERT_EQ(Next(), 7);", f"VAR_GLOBAL total : INT; END_VAR\n{counting}")
    assert found["actual"] == 1


def test_the_message_is_reported(tool: Tool) -> None:
    assert failure(tool, "ASSERT_EQ(1, 2, 'one is not two');")["message"] == "one is not two"


def test_the_message_may_be_calculated(tool: Tool) -> None:
    found = failure(tool, "VAR i : INT := 12; END_VAR\nASSERT_TRUE(i < 10, CONCAT('i is ', INT_TO_STRING(i)));")
    assert found["message"] == "i is 12"


def test_a_failing_assert_ends_its_test_only(tool: Tool) -> None:
    path = write("TEST 'a' ASSERT_EQ(1, 2); ASSERT_EQ(3, 4); END_TEST\nTEST 'b' ASSERT_EQ(1, 1); END_TEST")
    done = tool("test", str(path), "--json")
    assert [test["passed"] for test in done.json["tests"]] == [False, True]
    assert done.json["tests"][0]["failure"]["expected"] == 2
    assert (done.json["passed"], done.json["failed"], done.status) == (1, 1, 1)


@pytest.mark.parametrize("level", range(4))
@pytest.mark.parametrize(
    ("statement", "kind"),
    [
        ("i := 10 / i;", "DIVIDEBYZERO"),
        ("i := a[i + 9];", "ARRAYBOUNDS"),
        ("i := p^;", "ACCESS_VIOLATION"),
    ],
)
def test_run_time_exceptions_are_reported_with_their_line(tool: Tool, statement: str, kind: str, level: int) -> None:
    variables = "VAR i : INT; a : ARRAY[0..3] OF INT; p : REF_TO INT; END_VAR"
    path = write(f"TEST 'a'\n{variables}\n{statement}\nASSERT_EQ(i, 77);\nEND_TEST\nTEST 'b'\nEND_TEST")
    tests = tool("test", str(path), "--json", f"-O{level}").json["tests"]
    found = tests[0]["failure"]
    assert (found["kind"], found["line"], found["is_exception"]) == (kind, 3, True)
    assert tests[1]["passed"]


def test_an_exception_in_what_is_tested_names_its_own_line(tool: Tool) -> None:
    before = "FUNCTION Half : INT\nVAR_INPUT x : INT; END_VAR\nHalf := 10 / x;\nEND_FUNCTION\n"
    assert failure(tool, "ASSERT_EQ(Half(0), 1);", before)["line"] == 3


@pytest.fixture
def limit_s(monkeypatch: pytest.MonkeyPatch) -> float:
    """Seconds after which a test is taken for an endless loop: less than 10, but more than a cycle may take."""
    monkeypatch.setattr("plctool.st_tests.run.LIMIT_MS", 3000)
    return 3.0


def test_an_endless_loop_ends(tool: Tool, limit_s: float) -> None:
    begin = time.monotonic()
    found = failure(tool, "VAR i : INT; END_VAR\nWHILE TRUE DO i := i + 1; END_WHILE")
    assert (found["kind"], found["line"]) == ("WATCHDOG", 3)
    assert time.monotonic() - begin > limit_s, "a test has more time than a cycle"


def test_teardown_runs_after_an_exception_on_the_variables_as_they_are(tool: Tool, monkeypatch: Any) -> None:
    text = (
        "VAR_GLOBAL seen : INT; END_VAR\n"
        "SETUP VAR x : INT; END_VAR END_SETUP\nTEARDOWN seen := x + 1; END_TEARDOWN\n"
        "TEST 't' x := 41; x := x / seen; END_TEST"
    )
    found: list[int] = []
    close = Simulator.close
    monkeypatch.setattr(Simulator, "close", lambda plc: (found.append(plc.read("seen")), close(plc)))
    assert tool("test", str(write(text))).status == 1
    assert found == [42]


def test_an_endless_loop_in_teardown_ends_too(tool: Tool, limit_s: float) -> None:
    before = "TEARDOWN WHILE TRUE DO ; END_WHILE END_TEARDOWN\n"
    assert failure(tool, "VAR i : INT; END_VAR i := 1 / i;", before)["kind"] == "DIVIDEBYZERO"


def test_an_exception_tells_the_unit_it_happened_in(tool: Tool) -> None:
    before = "FUNCTION_BLOCK B\nMETHOD m : INT\nm := 1 / m;\nEND_METHOD\nEND_FUNCTION_BLOCK\n"
    found = failure(tool, "VAR b : B; i : INT; END_VAR\ni := b.m();", before)
    assert (found["pou"], found["line"], found["text"]) == ("B.m", 3, "division by zero in B.m")


@pytest.mark.parametrize("level", range(4))
def test_an_exception_tells_the_calls_from_the_test_to_it(tool: Tool, level: int) -> None:
    path = write(
        "FUNCTION Half : INT\nVAR_INPUT x : INT; END_VAR\nHalf := 10 / x;\nEND_FUNCTION\n"
        "FUNCTION_BLOCK B\nVAR_INPUT x : INT; END_VAR\nx := Half(x) + 1;\nEND_FUNCTION_BLOCK\n"
        "TEST 't'\nVAR b : B; END_VAR\nb(x := 0);\nASSERT_EQ(b.x, 1);\nEND_TEST\n"
    )
    (outcome,) = tool("test", str(path), f"-O{level}", "--json").json["tests"]
    calls = outcome["failure"]["calls"]
    assert [call["line"] for call in calls] == [7, 11]
    assert calls[0]["pou"] == "B"
    lines = tool("test", str(path), f"-O{level}").out.splitlines()
    assert lines[4:6] == [f"        called from B, {path}:7", f"        called from {path}:11"]


def test_an_exception_in_the_test_itself_has_no_caller(tool: Tool) -> None:
    assert failure(tool, "VAR i : INT; END_VAR i := 1 / i;")["calls"] == []


def test_a_failing_setup_keeps_the_test_from_running(tool: Tool) -> None:
    before = "SETUP\nASSERT_TRUE(FALSE, 'setup');\nEND_SETUP\n"
    assert failure(tool, "ASSERT_TRUE(FALSE, 'test');", before)["message"] == "setup"


def test_teardown_runs_after_a_failure_which_stays_the_one_that_counts(tool: Tool) -> None:
    before = "TEARDOWN\nASSERT_TRUE(FALSE, 'teardown');\nEND_TEARDOWN\n"
    assert failure(tool, "ASSERT_TRUE(FALSE, 'test');", before)["message"] == "test"
    assert failure(tool, "", before)["message"] == "teardown"


def test_each_test_starts_on_fresh_variables_whatever_is_kept_on_a_device(tool: Tool) -> None:
    kept = "VAR_GLOBAL PERSISTENT p : INT := 1; END_VAR VAR_GLOBAL RETAIN r : INT := 2; END_VAR\n"
    same = "ASSERT_EQ(p, 1); ASSERT_EQ(r, 2); p := 5; r := 6;"
    path = write(f"{kept}TEST 'first'\n{same}\nEND_TEST\nTEST 'second'\n{same}\nEND_TEST\n")
    done = tool("test", str(path))
    assert done.status == 0, done.out


def test_setup_belongs_to_its_file(tool: Tool) -> None:
    write("SETUP VAR x : INT; END_VAR END_SETUP TEST 'a' ASSERT_EQ(x, 0); END_TEST", "a.st")
    write("TEST 'b' ASSERT_EQ(x, 0); END_TEST", "b.st")
    done = tool("test", "a.st", "b.st")
    assert done.status == 2
    assert "b.st:1:20: error: unknown name x" in done.err


def test_a_function_that_only_a_device_has_fails_the_test_that_calls_it(tool: Tool) -> None:
    before = "{attribute 'external' := 'of_a_device'}\nFUNCTION OfADevice : INT\nEND_FUNCTION\n"
    found = failure(tool, "ASSERT_EQ(OfADevice(), 1);", before)
    assert "MOCK_FUNCTION" in str(found["text"])


def test_a_block_that_was_not_called_is_reported(tool: Tool) -> None:
    found = failure(tool, "VAR c : Counter; END_VAR\nMOCK c;\nMOCK_VERIFY_CALLED(c);", COUNTER)
    assert found["text"] == "expected a call, got none"
    found = failure(tool, "VAR c : Counter; END_VAR\nMOCK c; c();\nMOCK_VERIFY_CALL_COUNT(c, 2);", COUNTER)
    assert found["text"] == "expected 2 calls, got 1"


# ---- what is not a program -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("ASSERT_EQ(1);", "ASSERT_EQ takes 2 arguments and perhaps a message, not 1"),
        ("ASSERT_TRUE(TRUE, 'a', 'b');", "ASSERT_TRUE takes 1 argument and perhaps a message, not 3"),
        ("ASSERT_EQ(1, 'a');", "cannot compare"),
        ("ASSERT_EQ(1, 1, 5);", "the message of an assert is a STRING"),
        ("ASSERT_TRUE(5);", "BOOL"),
        ("ASSERT_NEAR(1.0, 2.0);", "ASSERT_NEAR takes 3 arguments"),
        ("ASSERT_NEAR('a', 'b', 'c');", "cannot combine"),
        ("ASSERT_EQ(actual := 1, expected := 1);", "have no names"),
        ("ADVANCE_TIME('5');", "a duration such as T#10ms"),
        ("ADVANCE_TIME(-T#5s);", "time does not go back"),
        ("ASSERT_EQ(x, 1);", "unknown name x"),
        ("FORCE(i);", "FORCE takes 2 arguments, not 1"),
        ("FORCE(variable := i, value := 1);", "the arguments of FORCE have no names"),
        ("FORCE(5, 1);", "FORCE needs a variable"),
        ("FORCE(i, 'a');", "STRING"),
        ("FORCE(t, 1);", "FORCE takes a number, BOOL, TIME or enumeration, not TON"),
        ("FORCE(b, b);", "FORCE takes a number, BOOL, TIME or enumeration, not B"),
        ("FORCE(text, 'a');", "FORCE takes a number, BOOL, TIME or enumeration, not STRING"),
        ("FORCE(list[i], 1);", "FORCE needs a variable with constant indices"),
        ("FORCE(LIMIT, 1);", "LIMIT is a constant and cannot be forced"),
        ("UNFORCE(i);", "this is not forced; write FORCE before UNFORCE"),
        ("FORCE(list[1], 1); UNFORCE(list[2]);", "this is not forced"),
        ("UNFORCE(i, i);", "UNFORCE takes 1 argument, not 2"),
        ("MOCK i;", "MOCK needs an instance of a function block"),
        ("MOCK_FUNCTION t.Q RETURNS 1;", "a method of an instance"),
        ("MOCK b.m;", "for a method write MOCK_FUNCTION"),
        ("MOCK_FUNCTION Missing RETURNS 1;", "there is no function Missing"),
        ("MOCK_FUNCTION F GIVES 1;", "expected RETURNS"),
        ("MOCK_FUNCTION F RETURNS 'a';", "STRING"),
        ("i := 5", "expected ;"),
        ("IF i = 5 THEN i := 6;", "END_IF missing"),
    ],
)
def test_mistakes_in_tests_are_compile_errors(tool: Tool, body: str, words: str) -> None:
    before = "FUNCTION F : INT END_FUNCTION\nFUNCTION_BLOCK B METHOD m : INT m := 1; END_METHOD END_FUNCTION_BLOCK\n"
    variables = "VAR i : INT; t : TON; b : B; text : STRING; list : ARRAY[1..3] OF INT; END_VAR "
    constant = "VAR CONSTANT LIMIT : INT := 3; END_VAR"
    done = diagnoses(tool, f"{before}TEST 't'\n{variables}{constant}\n{body}\nEND_TEST")
    assert words in done.err
    assert "program.st:5:" in done.err or "program.st:6:" in done.err


def test_check_finds_them_too(tool: Tool) -> None:
    done = tool("check", str(write("TEST 't' ASSERT_EQ(x, 1); END_TEST")), "--json")
    assert done.status == 2
    assert [d["message"] for d in done.json["diagnostics"]] == ["unknown name x"]


def test_errors_of_program_and_test_are_reported_once(tool: Tool) -> None:
    text = "PROGRAM Main VAR i : INT; END_VAR i := x; END_PROGRAM TEST 't' VAR m : Main; END_VAR m(); END_TEST"
    done = tool("check", str(write(text)), "--json")
    assert [d["message"] for d in done.json["diagnostics"]] == ["unknown name x"]


@pytest.mark.parametrize("keyword", ["SETUP", "TEARDOWN"])
def test_a_file_has_one_setup_and_one_teardown(tool: Tool, keyword: str) -> None:
    done = diagnoses(tool, f"{keyword} END_{keyword} {keyword} END_{keyword} TEST 't' END_TEST")
    assert f"there is a {keyword} in this file already" in done.err


def test_tests_of_a_file_have_different_names(tool: Tool) -> None:
    done = diagnoses(tool, "TEST 'a' END_TEST TEST 'b' END_TEST TEST 'a' END_TEST")
    assert "1:37: error: there is a TEST 'a' in this file already" in done.err


@pytest.mark.parametrize("statement", ["ASSERT_EQ(1, 1)", "FORCE(n, 1)"])
def test_statements_of_tests_are_for_tests_only(tool: Tool, statement: str) -> None:
    done = tool("check", str(write(f"PROGRAM Main VAR n : INT; END_VAR {statement}; END_PROGRAM")))
    assert done.status == 2
    assert statement.partition("(")[0] in done.out + done.err


def test_an_unclosed_test_is_reported(tool: Tool) -> None:
    assert "END_TEST missing for the TEST in line 1" in diagnoses(tool, "TEST 'a'\nTEST 'b'\nEND_TEST").err


def test_no_tests_is_wrong_use(tool: Tool) -> None:
    done = tool("test", str(write("PROGRAM Main END_PROGRAM")), "--json")
    assert (done.status, done.json["error"]["code"]) == (2, "no-tests")


# ---- reports ---------------------------------------------------------------------------------------------------------

TWO = "TEST 'good'\nEND_TEST\nTEST 'bad <&> $07'\nASSERT_EQ(1, 2, 'why');\nEND_TEST\n"


def test_people_see_files_tests_places_and_the_sum(tool: Tool) -> None:
    done = tool("test", str(write(TWO)))
    lines = done.out.splitlines()
    assert lines[:2] == ["program.st", "  pass  good"]
    assert lines[2].startswith("  FAIL  bad")
    assert lines[3] == "        program.st:4: ASSERT_EQ: expected 2, got 1 (why)"
    assert lines[4] == "            ASSERT_EQ(1, 2, 'why');"
    assert lines[-1].startswith("2 tests, 1 passed, 1 failed (")
    assert "\033" not in done.out


def test_filter_chooses_by_name(tool: Tool) -> None:
    done = tool("test", str(write(TWO)), "--filter", "GO*", "--json")
    assert [test["name"] for test in done.json["tests"]] == ["good"]
    assert done.status == 0
    assert tool("test", "program.st", "--filter", "nothing").status == 2


def test_brackets_in_a_pattern_are_those_of_the_name(tool: Tool) -> None:
    path = str(write("".join(f"TEST '{name}'\nEND_TEST\n" for name in ("x[1]", "x[2]", "x1"))))
    for pattern, names in (("x[1]", ["x[1]"]), ("x[*]", ["x[1]", "x[2]"]), ("[2", ["x[2]"])):
        done = tool("test", path, "-k", pattern, "--json")
        assert [test["name"] for test in done.json["tests"]] == names


def test_a_filter_without_wildcards_is_a_part_of_the_name(tool: Tool) -> None:
    done = tool("test", str(write(TWO)), "-k", "OO", "--json")
    assert [test["name"] for test in done.json["tests"]] == ["good"]


def test_warnings_are_reported(tool: Tool) -> None:
    path = str(write("TEST 't' VAR unneeded : INT; END_VAR END_TEST"))
    done = tool("test", path)
    assert "program.st:1:14: warning: unneeded is never used" in done.err
    assert [w["code"] for w in tool("test", path, "--json").json["warnings"]] == ["unused"]


def test_what_only_a_test_looks_at_is_used(tool: Tool) -> None:
    units = "FUNCTION_BLOCK F VAR k, unneeded : INT; END_VAR END_FUNCTION_BLOCK "
    units += "PROGRAM Main VAR r : INT; END_VAR END_PROGRAM "
    body = "x(); m.r := 3; m(); ASSERT_EQ(x.k, 0); ASSERT_EQ(m.r, 3);"
    path = str(write(f"{units}TEST 't' VAR x : F; m : Main; END_VAR {body} END_TEST"))
    for command in ("check", "test", "build"):
        warnings = tool(command, path, "--json").json["warnings" if command != "check" else "diagnostics"]
        assert [w["message"] for w in warnings if w["code"] == "unused"] == ["unneeded is never used"]


def test_junit_report_holds_every_test(tool: Tool) -> None:
    text = TWO + "TEST 'stops' VAR i : INT; END_VAR i := 1 / i; END_TEST"
    assert tool("test", str(write(text)), "--junit", "report.xml").status == 1
    root = ElementTree.parse("report.xml").getroot()
    assert (root.get("tests"), root.get("failures"), root.get("errors")) == ("3", "1", "1")
    good, bad, stops = root.iter("testcase")
    assert (good.get("name"), good.get("file"), good.get("line"), len(good)) == ("good", "program.st", "1", 0)
    assert bad.get("name") == "bad <&> ?"
    assert bad[0].get("message") == "ASSERT_EQ: expected 2, got 1"
    assert "program.st:4" in str(bad[0].text)
    assert stops[0].tag == "error"


def test_a_report_that_cannot_be_written_is_reported(tool: Tool) -> None:
    assert tool("test", str(write(TWO)), "--junit", "nowhere/report.xml").status == 2


def test_a_report_takes_the_place_of_no_source(tool: Tool) -> None:
    path = write(TWO)
    done = tool("test", str(path), "--junit", str(path))
    assert done.status == 2
    assert "--junit report.xml" in done.err
    assert path.read_text() == TWO


def test_hundreds_of_tests_take_seconds(tool: Tool) -> None:
    test = (
        "TEST 'number %d'\nVAR c : Counter; END_VAR\nc(); ADVANCE_TIME(T#1s); c();\nASSERT_EQ(c.value, 2);\nEND_TEST\n"
    )
    path = write(COUNTER + "".join(test % n for n in range(300)))
    begin = time.process_time()  # ours alone, whatever else the machine does
    assert tool("test", str(path)).status == 0
    assert time.process_time() - begin < 10
