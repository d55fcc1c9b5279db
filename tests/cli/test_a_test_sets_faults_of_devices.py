"""{attribute 'fault' := 'Tank=absent@T#5s'} before a TEST: the devices work in it, and fail when that says so."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_pytest_plugin import run_pytest

from plctool.st_tests import run_tests

PROGRAM = """\
TYPE Field : STRUCT level : INT; END_STRUCT END_TYPE
VAR_GLOBAL field : Field; shared : INT; END_VAR
PROGRAM Main
VAR start, motor, alarm : BOOL; flow, spare : INT; lost : TON; END_VAR
lost(IN := NOT Tank.ok, PT := T#2s);
alarm := lost.Q;
motor := start AND Bench.ok AND field.level < 900;
END_PROGRAM
CONFIGURATION Plc
TASK Slow(INTERVAL := T#100ms, PRIORITY := 9);
TASK Fast(INTERVAL := T#10ms, PRIORITY := 1);
PROGRAM Main WITH Fast : Main;
END_CONFIGURATION
"""
DESCRIPTION = """\
[[modbus.rs485]]
name = "Bus"
port = "/dev/ttyS1"
[[modbus.rs485.device]]
name = "Tank"
unit = 1
timeout = "T#50ms"
[[modbus.rs485.device.read]]
function = 4
address = 30001
every = "T#100ms"
var = "Main.flow"
[modbus.server.tcp]
name = "Server"
[modbus.server.tcp.holding]
40001 = "shared"
[[sim]]
name = "Bench"
task = "Slow"
in = { start = "Main.start", level = { var = "field.level", on_error = "zero" } }
out = { motor = "Main.motor" }
[[sim]]
name = "Spare"
enabled = false
in = { x = "Main.spare" }
"""
LOST_AND_BACK = """\
{attribute 'fault' := 'Tank=absent@T#5s'}
{attribute 'fault' := 'Tank=absent:0@T#8s'}
TEST 'a lost tank is an alarm until it is back'
ADVANCE_TIME(T#4s);
Main();
ASSERT_TRUE(Tank.ok);
ADVANCE_TIME(T#2s);
Main();
ASSERT_FALSE(Tank.ok);
ASSERT_FALSE(Main.alarm, 'it waits for 2 s');
ADVANCE_TIME(T#2s);
Main();
ASSERT_TRUE(Main.alarm);
ADVANCE_TIME(T#62s);
Main();
ASSERT_TRUE(Tank.ok);
ASSERT_FALSE(Main.alarm);
END_TEST
"""


@pytest.fixture(autouse=True)
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("main.st").write_text(PROGRAM)
    Path("main.io.toml").write_text(DESCRIPTION)


def failures(tests: str, level: int = 0) -> list[str]:
    """Of TEST blocks, the lines of those that fail."""
    Path("tests.st").write_text(tests)
    report = run_tests([Path()], level=level)
    return [f"{o.failure.line}: {o.failure.text}" for o in report.outcomes if o.failure is not None]


@pytest.mark.parametrize("level", [0, 2])
def test_a_test_sees_the_loss_of_a_device_and_its_return(level: int) -> None:
    assert failures(LOST_AND_BACK, level) == []


def test_an_assert_that_does_not_hold_fails_at_its_line() -> None:
    assert failures(LOST_AND_BACK.replace("5s", "3s")) == ["6: expected TRUE, got FALSE"]


def test_a_fault_ends_with_its_test_and_the_next_one_has_new_devices() -> None:
    always = "{attribute 'fault' := 'Bench=absent'}\nTEST 'lost'\nfield.level := 7;\nADVANCE_TIME(T#1s);\n"
    others = (
        "TEST 'as ever'\nADVANCE_TIME(T#1s);\nASSERT_TRUE(Bench.ok);\nASSERT_EQ(Bench.errors, 0);\nEND_TEST\n"
        "{attribute 'fault' := 'Tank=late:1'}\nTEST 'another'\nADVANCE_TIME(T#1s);\nASSERT_TRUE(Bench.ok);\n"
        "ASSERT_EQ(field.level, 0);\nASSERT_EQ(Bench.errors, 0);\nEND_TEST\n"
    )
    assert failures(f"{always}ASSERT_FALSE(Bench.ok);\nEND_TEST\n{others}") == []
    assert failures(f"{always}ASSERT_TRUE(Bench.ok);\nEND_TEST\n{others}") == ["5: expected TRUE, got FALSE"]


def test_what_the_test_writes_to_an_input_its_device_measures() -> None:
    tests = """\
    {attribute 'fault' := 'Bench=absent@T#2s'}
    {attribute 'fault' := 'Bench=absent:0@T#3s'}
    TEST 'the level comes back'
    Main.start := TRUE;
    field.level := 20;
    ADVANCE_TIME(T#1s);
    Main();
    ASSERT_TRUE(Main.motor);
    ASSERT_EQ(field.level, 20);
    ADVANCE_TIME(T#1s500ms);
    ASSERT_EQ(field.level, 0, 'on_error');
    ADVANCE_TIME(T#1s);
    ASSERT_EQ(field.level, 20);
    ASSERT_TRUE(Main.start);
    END_TEST
    """
    assert failures(tests) == []


def test_time_counts_from_the_first_statement_of_the_test() -> None:
    tests = """\
    SETUP
    ADVANCE_TIME(T#10s);
    END_SETUP
    {attribute 'fault' := 'Bench=absent@T#1s'}
    TEST 'after a second'
    ASSERT_TRUE(Bench.ok);
    ADVANCE_TIME(T#900ms);
    ASSERT_TRUE(Bench.ok);
    ADVANCE_TIME(T#110ms);
    ASSERT_FALSE(Bench.ok);
    END_TEST
    """
    assert failures(tests) == []


def test_in_tests_without_faults_the_devices_do_nothing() -> None:
    tests = LOST_AND_BACK + "TEST 'by hand'\nTank.ok := TRUE;\nfield.level := 3;\nADVANCE_TIME(T#1s);\n"
    assert failures(f"{tests}ASSERT_TRUE(Tank.ok);\nASSERT_EQ(field.level, 3);\nEND_TEST\n") == []


def test_an_exception_fails_the_test_and_teardown_still_runs() -> None:
    tests = """\
    TEARDOWN
    ADVANCE_TIME(T#1s);
    ASSERT_FALSE(Bench.ok);
    END_TEARDOWN
    {attribute 'fault' := 'Bench=absent'}
    TEST 'stops'
    VAR zero : INT; END_VAR
    ADVANCE_TIME(T#1s);
    field.level := 1 / zero;
    END_TEST
    """
    assert failures(tests) == ["9: division by zero"]


def test_a_test_that_takes_too_long_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("plctool.st_tests.run.LIMIT_MS", 200)
    found = failures("{attribute 'fault' := 'Bench=absent'}\nTEST 'years'\nADVANCE_TIME(LTIME#100000d);\nEND_TEST\n")
    assert found == ["3: the test takes too long, perhaps in an endless loop"]


def test_all_that_fails_can_be_set() -> None:
    tests = "".join(
        f"{{attribute 'fault' := '{fault}@T#1s'}}\nTEST '{fault}'\nADVANCE_TIME(T#1s);\nASSERT_TRUE(Tank.ok);\n"
        "ADVANCE_TIME(T#2s);\nASSERT_FALSE(Tank.ok);\nEND_TEST\n"
        for fault in ("Tank=absent", "Tank=late:60", "Tank=type", "Tank=answers:100", "Tank=cut:100", "Bus=absent")
    )
    assert failures(tests) == []


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("Tank", "'Tank' is not DEVICE=FAULT; write for example Tank=absent"),
        ("", "'' is not DEVICE=FAULT"),
        ("Tank=late:x", "is not DEVICE=FAULT"),
        ("Tank=broken", "there is no fault 'broken'; choose one of absent, late"),
        ("Tank=absent@soon", "write a duration such as T#1s500ms"),
        ("Tank=absent@T#-1s", "so it is not negative"),
        ("Tnak=absent", "there is no device Tnak in the description; did you mean Tank?"),
        ("Pump=absent", "there are Bus, Tank, Server, Bench, Spare"),
        ("Bus=late:5", "Bus cannot be 'late'; it can only be absent"),
        ("Server=absent", "Server cannot be 'absent'"),
        ("Spare=absent", "is not enabled; take enabled = false out"),
    ],
)
@pytest.mark.parametrize("command", ["test", "check"])
def test_a_fault_that_cannot_be_is_reported_at_its_line(tool, command: str, fault: str, reason: str) -> None:  # type: ignore[no-untyped-def]
    good = "{attribute 'fault' := 'Tank=absent'}"
    Path("tests.st").write_text(f"{good}\n{{attribute 'fault' := '{fault}'}}\nTEST 'a'\nMain();\nEND_TEST\n")
    done = tool(command, ".")
    assert done.status == 2
    assert "tests.st:2:1: error:" in done.err + done.out
    assert reason in done.err + done.out


def test_without_a_description_there_is_no_device(tool) -> None:  # type: ignore[no-untyped-def]
    Path("main.io.toml").unlink()
    Path("main.st").write_text("PROGRAM Main\nEND_PROGRAM\n{attribute 'fault' := 'T=absent'}\nTEST 'a'\nEND_TEST\n")
    done = tool("test", ".")
    assert "main.st:3:1: error: there is no device T, as there is no description of inputs and outputs" in done.err
    assert "NAME.io.toml" in done.err


@pytest.mark.parametrize("before", ["PROGRAM Other\nEND_PROGRAM\n", "SETUP\nEND_SETUP\n", "TYPE T : INT; END_TYPE\n"])
def test_before_something_else_it_has_no_effect(tool, before: str) -> None:  # type: ignore[no-untyped-def]
    test = "TEST 'a'\nMain();\nEND_TEST\n"
    Path("tests.st").write_text(f"{{attribute 'fault' := 'Tank=absent'}}\n{before}{test}")
    done = tool("test", ".")
    assert "has no effect here: it is written before a TEST" in done.err
    assert "tests.st:2:1: warning" in done.err


def test_pytest_runs_such_tests() -> None:
    Path("tests.st").write_text(LOST_AND_BACK + LOST_AND_BACK.replace("5s", "3s").replace("back'", "back too soon'"))
    done = run_pytest(Path.cwd())
    assert "1 failed, 1 passed" in done.stdout, done.stdout
    assert "tests.st:24: ASSERT_TRUE" in done.stdout
