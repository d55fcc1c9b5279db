"""WATCHDOG and SENSITIVITY of a TASK on a real plcrt."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from plctool.testing.plcrt import Plcrt

PROGRAM = """PROGRAM Main
VAR
    slow : BOOL;
    n, i : DINT;
END_VAR
n := n + 1;
IF slow THEN
    FOR i := 1 TO 2000000000 DO
        n := n * 3 + i;
    END_FOR
END_IF
END_PROGRAM

PROGRAM Other
VAR
    n : DINT;
END_VAR
n := n + 1;
END_PROGRAM

CONFIGURATION Config
    TASK Fast(INTERVAL := T#20ms, PRIORITY := 1, {properties});
    TASK Slow(INTERVAL := T#20ms, PRIORITY := 2);
    PROGRAM Main WITH Fast : Main;
    PROGRAM Other WITH Slow : Other;
END_CONFIGURATION
"""
LOOP = range(8, 11)  # lines of the FOR loop


def started(tool, plcrt, properties: str) -> None:
    image = tool.build("guarded", PROGRAM.replace("{properties}", properties))
    tool.ok("flash", "--port", plcrt.port, str(image))


def exception(tool, plcrt):
    return tool.ok("status", "--port", plcrt.port)["exception"]


def counted(tool, plcrt) -> int:
    return int(tool.ok("read", "--port", plcrt.port, "Other.n")["values"]["Other.n"])


@pytest.mark.parametrize("properties", ["WATCHDOG := T#100ms", "WATCHDOG := T#50ms, SENSITIVITY := 2"])
def test_a_task_that_exceeds_its_watchdog_stops_where_it_was(tool, plcrt, eventually, properties):
    started(tool, plcrt, properties)
    eventually(lambda: counted(tool, plcrt) > 2)
    assert exception(tool, plcrt) is None
    tool.ok("write", "--port", plcrt.port, "Main.slow=TRUE")
    fault = eventually(lambda: exception(tool, plcrt))
    assert (fault["name"], fault["task"], fault["pou"]) == ("WATCHDOG", "Fast", "Main")
    assert fault["line"] in LOOP
    before = counted(tool, plcrt)
    assert counted(tool, plcrt) == before  # the other task starts no new cycle


def test_a_series_of_long_cycles_names_the_program_and_line(tool, plcrt, eventually):
    work = "n := n * 3 + i;\n    END_FOR"
    text = PROGRAM.replace("{properties}", "WATCHDOG := T#10ms, SENSITIVITY := 10").replace("2000000000", "limit")
    text = text.replace("n, i : DINT;", "n, i : DINT; limit : DINT := 160_000_000;", 1)
    assert work in text  # some 50 ms of it
    tool.ok("flash", "--port", plcrt.port, str(tool.build("series", text)))
    tool.ok("write", "--port", plcrt.port, "Main.slow=TRUE")
    fault = eventually(lambda: exception(tool, plcrt))
    assert (fault["name"], fault["task"], fault["pou"]) == ("WATCHDOG", "Fast", "Main")
    assert fault["line"] in range(6, 12)


def test_a_loop_in_a_single_cycle_is_broken_as_well(tool, plcrt):
    started(tool, plcrt, "WATCHDOG := T#100ms")
    tool.ok("stop", "--port", plcrt.port)
    tool.ok("write", "--port", plcrt.port, "Main.slow=TRUE")
    assert tool("cycle", "--port", plcrt.port).status == 1
    fault = exception(tool, plcrt)
    assert (fault["name"], fault["task"], fault["line"] in LOOP) == ("WATCHDOG", "Fast", True)


def test_a_loop_made_of_a_jump_is_broken_as_well(tool, plcrt, eventually):
    text = PROGRAM.replace("{properties}", "WATCHDOG := T#100ms")
    loop = "FOR i := 1 TO 2000000000 DO\n        n := n * 3 + i;\n    END_FOR"
    assert loop in text
    text = text.replace(loop, "again:\n        n := n * 3 + i;\n    JMP again;")
    tool.ok("flash", "--port", plcrt.port, str(tool.build("jumping", text)))
    tool.ok("write", "--port", plcrt.port, "Main.slow=TRUE")
    fault = eventually(lambda: exception(tool, plcrt))
    assert (fault["name"], fault["task"], fault["pou"]) == ("WATCHDOG", "Fast", "Main")
    assert fault["line"] in LOOP


def test_the_watchdog_is_not_caught(tool, plcrt, eventually):
    text = PROGRAM.replace("{properties}", "WATCHDOG := T#100ms")
    loop = "FOR i := 1 TO 2000000000 DO\n        n := n * 3 + i;\n    END_FOR"
    assert loop in text
    text = text.replace(loop, f"__TRY {loop} __CATCH(exc) went_on := TRUE; __FINALLY went_on := TRUE; __ENDTRY")
    text = text.replace("    slow : BOOL;", "    slow, went_on : BOOL; exc : __SYSTEM.ExceptionCode;")
    tool.ok("flash", "--port", plcrt.port, str(tool.build("catching", text)))
    tool.ok("write", "--port", plcrt.port, "Main.slow=TRUE")
    fault = eventually(lambda: exception(tool, plcrt))
    assert (fault["name"], fault["task"], fault["pou"]) == ("WATCHDOG", "Fast", "Main")
    assert fault["line"] in LOOP
    values = tool.ok("read", "--port", plcrt.port, "Main.exc", "Main.went_on")["values"]
    assert values == {"Main.exc": "RTSEXCPT_NOEXCEPTION", "Main.went_on": False}


def test_a_task_within_its_watchdog_goes_on(tool, plcrt, eventually):
    started(tool, plcrt, "WATCHDOG := T#10s")
    eventually(lambda: counted(tool, plcrt) > 20)
    assert exception(tool, plcrt) is None


# The slow task has its work, some 30 ms of it, and then may loop; the fast one, which comes more often than that, loops
# in the midst of it. All on one processor.
HELD_UP = """VAR_GLOBAL
    go, slow_loops : BOOL;
    begun, finished : DINT; (* cycles of the slow task *)
END_VAR
PROGRAM Slow
VAR
    i, x : DINT;
END_VAR
begun := begun + 1;
FOR i := 1 TO 30_000_000 DO
    x := x + i;
END_FOR
WHILE slow_loops DO
    x := x + 1;
END_WHILE
finished := finished + 1;
END_PROGRAM

PROGRAM Fast
VAR
    x : DINT;
END_VAR
IF begun <> finished THEN
    WHILE go DO
        x := x + 1;
    END_WHILE
END_IF
END_PROGRAM

CONFIGURATION Config
    TASK FastTask(INTERVAL := T#10ms, PRIORITY := 1, WATCHDOG := T#500ms);
    TASK SlowTask(INTERVAL := T#50ms, PRIORITY := 2, WATCHDOG := T#500ms);
    PROGRAM Fast WITH FastTask : Fast;
    PROGRAM Slow WITH SlowTask : Slow;
END_CONFIGURATION
"""


def on_one_processor(plcrt: Plcrt) -> None:
    """The threads that tasks will have inherit it."""
    for thread in Path(f"/proc/{plcrt.worker}/task").iterdir():
        os.sched_setaffinity(int(thread.name), {min(os.sched_getaffinity(0))})


def flash_and_loop(tool, plcrt, *writes: str) -> None:
    """Flashes HELD_UP, unoptimised so that each loop looks at its variables, and lets its tasks loop."""
    on_one_processor(plcrt)
    tool.ok("flash", "--port", plcrt.port, str(tool.build("held_up", HELD_UP, "-O0")))
    tool.ok("write", "--port", plcrt.port, *writes)


def unfinished(tool, plcrt) -> int:
    """How many cycles of the slow task have not come to their end."""
    counts = tool.ok("read", "--port", plcrt.port, "begun", "finished")["values"]
    return int(counts["begun"] - counts["finished"])


def test_a_task_that_an_endless_loop_held_up_finishes_its_cycle(tool, plcrt, eventually):
    flash_and_loop(tool, plcrt, "go=TRUE")
    fault = eventually(lambda: exception(tool, plcrt))
    assert (fault["name"], fault["task"], fault["pou"]) == ("WATCHDOG", "FastTask", "Fast")
    assert unfinished(tool, plcrt) == 0


def test_two_tasks_in_endless_loops_are_both_broken(tool, plcrt, eventually):
    flash_and_loop(tool, plcrt, "slow_loops=TRUE", "go=TRUE")
    assert eventually(lambda: exception(tool, plcrt))["name"] == "WATCHDOG"
    assert unfinished(tool, plcrt) == 1
    tool.ok("reset", "warm", "--port", plcrt.port)
    tool.ok("start", "--port", plcrt.port)
    eventually(lambda: tool.ok("read", "--port", plcrt.port, "finished")["values"]["finished"] > 1)
