"""What a real plcrt keeps, as the table in docs/language.md says: over a cut of its power, resets and downloads."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "sim"))
from kept_table import CHANGED, INITIAL, KEPT, LOST, program, table

CELLS = {(event, kind): cell for event, kind, cell in table()}
KINDS = {"VAR": "", "RETAIN": "RETAIN", "PERSISTENT": "PERSISTENT"}


def read(tool, plcrt, names: list[str]) -> list:
    return list(tool.ok("read", "--port", plcrt.port, *names)["values"].values())


def change_everything(tool, plcrt) -> None:
    tool.ok("write", "--port", plcrt.port, *(f"{name}={CHANGED}" for name in KEPT + LOST))
    assert set(read(tool, plcrt, KEPT + LOST)) == {CHANGED}


def check(tool, plcrt, event: str, kind: str) -> None:
    expected = {"kept": CHANGED, "initial": INITIAL}[CELLS[event, kind]]
    assert set(read(tool, plcrt, KEPT)) == {expected}, event
    assert set(read(tool, plcrt, LOST)) == {CHANGED if event == "stop, start" else INITIAL}, event


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_controller_keeps(tool, plcrt, eventually, kind):
    first = tool.build("first", program(KINDS[kind]))
    second = tool.build("second", program(KINDS[kind], changed=True))
    tool.ok("flash", "--port", plcrt.port, str(first))
    change_everything(tool, plcrt)
    tool.ok("stop", "--port", plcrt.port)  # saves
    tool.ok("start", "--port", plcrt.port)
    check(tool, plcrt, "stop, start", kind)
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    check(tool, plcrt, "power off and on", kind)
    for option in ("warm", "cold"):
        change_everything(tool, plcrt)
        tool.ok("reset", option, "--port", plcrt.port)
        check(tool, plcrt, f"reset {option}", kind)
    change_everything(tool, plcrt)
    tool.ok("flash", "--port", plcrt.port, str(second))
    check(tool, plcrt, "download", kind)
    plcrt.stop(signal.SIGKILL)  # what was taken over is in flash
    plcrt.start()
    check(tool, plcrt, "download", kind)
    change_everything(tool, plcrt)
    tool.ok("reset", "origin", "--port", plcrt.port)
    tool.ok("flash", "--port", plcrt.port, str(first))
    check(tool, plcrt, "reset origin", kind)


BEFORE = "PROGRAM Main VAR PERSISTENT hours, parts : DINT; name : STRING[20]; END_VAR END_PROGRAM"
AFTER = "PROGRAM Main VAR PERSISTENT hours : DINT; parts : LINT; more : INT; END_VAR END_PROGRAM"


def test_flash_names_the_values_that_are_lost_and_the_log_counts_them(tool, plcrt):
    tool.ok("flash", "--port", plcrt.port, str(tool.build("before", BEFORE)))
    tool.ok("write", "--port", plcrt.port, "Main.hours=17", "Main.parts=4")
    after = tool.build("after", AFTER)
    said = tool("flash", "--port", plcrt.port, str(after)).out
    assert "PERSISTENT value lost: Main.parts was DINT, is LINT" in said
    assert "PERSISTENT value lost: Main.name is not there any more" in said
    assert "PERSISTENT value new: Main.more" in said
    assert "hours" not in said
    entries = tool.ok("log", "--port", plcrt.port)["entries"]
    assert "PERSISTENT values: 1 taken over, 2 dropped" in [e["text"] for e in entries]
    assert tool.ok("read", "--port", plcrt.port, "Main.hours", "Main.parts")["values"] == {
        "Main.hours": 17,
        "Main.parts": 0,
    }
    document = tool.ok("flash", "--port", plcrt.port, str(after), "--force")
    assert document["persistent"]["kept"] == ["Main.hours", "Main.parts", "Main.more"]


STRESS = """
{tasks}
CONFIGURATION Plant
VAR_GLOBAL RETAIN
    list : ARRAY[0..3] OF ARRAY[1..500] OF UDINT;
END_VAR
{declarations}
END_CONFIGURATION
"""
TASK = """
PROGRAM Fill{n}
VAR i, round, turns, restored : UDINT; again, torn : BOOL; END_VAR
IF NOT again THEN
    again := TRUE;
    restored := list[{n}][1];
    FOR i := 2 TO 500 DO torn := torn OR list[{n}][i] <> restored; END_FOR
END_IF
round := round + 1;
FOR i := 1 TO 500 DO
    list[{n}][i] := round;
    FOR turns := 1 TO 400 DO ; END_FOR
END_FOR
END_PROGRAM
"""


@pytest.fixture(scope="module")
def stress() -> str:
    """Four tasks of 1 ms whose cycles take longer than that: they never pause together."""
    tasks = "".join(TASK.format(n=n) for n in range(4))
    lines = "".join(f"TASK T{n}(INTERVAL := T#1ms, PRIORITY := {n + 1}); PROGRAM P{n} WITH T{n} : Fill{n};\n"
                    for n in range(4))  # fmt: skip
    return STRESS.format(tasks=tasks, declarations=lines)


def test_what_is_saved_is_of_one_moment_though_tasks_never_pause_together(tool, plcrt, eventually, stress):
    tool.ok("flash", "--port", plcrt.port, str(tool.build("stress", stress)))
    programs = [f"P{n}" for n in range(4)]
    for _ in range(6):
        ran = read(tool, plcrt, ["P0.round"])[0]
        eventually(lambda before=ran: read(tool, plcrt, ["P0.round"])[0] > before + 2000)  # some seconds: it was saved
        plcrt.stop(signal.SIGKILL)
        plcrt.start()
        eventually(lambda: all(read(tool, plcrt, [f"{p}.again" for p in programs])))
        assert min(read(tool, plcrt, [f"{p}.restored" for p in programs])) > 0
        assert read(tool, plcrt, [f"{p}.torn" for p in programs]) == [False] * 4


def test_the_log_of_the_run_before_a_power_cut_is_there(tool, plcrt, eventually):
    counter = tool.build("first", program(""))
    tool.ok("flash", "--port", plcrt.port, str(counter))
    tool.ok("stop", "--port", plcrt.port)
    kept = tool.ok("log", "--kept", "--port", plcrt.port)["entries"]
    assert [e["text"].partition(",")[0] for e in kept] == [
        "plcrt started",
        "Application loaded",
        "Application started",
        "Application stopped",
    ]
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    again = tool.ok("log", "--kept", "--port", plcrt.port)["entries"]
    assert again[: len(kept)] == kept
    assert {entry["start"] for entry in again[len(kept) :]} == {2}
    assert all(entry["utc"].startswith("20") for entry in again)
