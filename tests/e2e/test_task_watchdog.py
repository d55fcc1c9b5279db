"""WATCHDOG and SENSITIVITY of a TASK on a real plcrt."""

from __future__ import annotations

import pytest

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


def test_a_task_within_its_watchdog_goes_on(tool, plcrt, eventually):
    started(tool, plcrt, "WATCHDOG := T#10s")
    eventually(lambda: counted(tool, plcrt) > 20)
    assert exception(tool, plcrt) is None


# The slow task waits until the outputs are in their safe state, which is when the fast one has been broken.
HELD_UP = """VAR_GLOBAL
    go, slow_loops : BOOL;
    begun, finished : DINT; (* cycles of the slow task *)
END_VAR
PROGRAM Slow
VAR
    x : DINT;
END_VAR
begun := begun + 1;
%QX0.0 := go;
WHILE %QX0.0 OR slow_loops DO
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
    TASK FastTask(INTERVAL := T#50ms, PRIORITY := 1, WATCHDOG := T#500ms);
    TASK SlowTask(INTERVAL := T#50ms, PRIORITY := 2, WATCHDOG := T#500ms);
    PROGRAM Fast WITH FastTask : Fast;
    PROGRAM Slow WITH SlowTask : Slow;
END_CONFIGURATION
"""


def flash_and_loop(tool, plcrt, *writes: str) -> None:
    """Flashes HELD_UP, unoptimised so that each loop looks at its variables, and lets its tasks loop."""
    tool.ok("flash", "--port", plcrt.port, str(tool.build("held_up", HELD_UP, "-O0")))
    tool.ok("write", "--port", plcrt.port, *writes)


def check_blame_and_count(tool, plcrt, eventually) -> int:
    """The fast task is to blame. How many cycles of the slow one did not come to their end."""
    fault = eventually(lambda: exception(tool, plcrt))
    assert (fault["name"], fault["task"], fault["pou"]) == ("WATCHDOG", "FastTask", "Fast")
    counts = tool.ok("read", "--port", plcrt.port, "begun", "finished")["values"]
    return counts["begun"] - counts["finished"]


def test_a_task_that_an_endless_loop_held_up_finishes_its_cycle(tool, plcrt, eventually):
    flash_and_loop(tool, plcrt, "go=TRUE")
    assert check_blame_and_count(tool, plcrt, eventually) == 0


def test_of_two_tasks_in_endless_loops_the_later_is_to_blame_and_both_are_broken(tool, plcrt, eventually):
    flash_and_loop(tool, plcrt, "slow_loops=TRUE", "go=TRUE")
    assert check_blame_and_count(tool, plcrt, eventually) == 1
    tool.ok("reset", "warm", "--port", plcrt.port)
    tool.ok("start", "--port", plcrt.port)
    eventually(lambda: tool.ok("read", "--port", plcrt.port, "finished")["values"]["finished"] > 1)
