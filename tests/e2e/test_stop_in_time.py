"""Stop, reset, download and SIGTERM have their way within a second, whatever the program does."""

from __future__ import annotations

import signal
import time

import pytest
from questions import log


@pytest.fixture
def plcrt(ordinary_plcrt):
    return ordinary_plcrt


LONG = "WATCHDOG := T#30m, SENSITIVITY := 1000"
# How much longer than the promised second a command may take on a machine under load, start of Python included [s].
PATIENCE = 30

LOOPS = """VAR_GLOBAL
    go, run : BOOL;
    begun : DINT;
END_VAR
PROGRAM Loops
VAR
    x : DINT;
END_VAR
begun := begun + 1;
WHILE run DO
    x := x + 1;
END_WHILE
END_PROGRAM
PROGRAM Sets
go := TRUE;
END_PROGRAM
CONFIGURATION Config
    {tasks}
END_CONFIGURATION
"""
SETS = f"TASK Setter(INTERVAL := T#1ms, {LONG}); PROGRAM Sets1 WITH Setter : Sets;"
TASKS = {
    "cyclic": f"TASK Endless(INTERVAL := T#1ms, PRIORITY := 0, {LONG}); PROGRAM Main WITH Endless : Loops;",
    "freewheeling": f"TASK Endless(PRIORITY := 0, {LONG}); PROGRAM Main WITH Endless : Loops;",
    "event": f"TASK Endless(SINGLE := go, PRIORITY := 0, {LONG}); PROGRAM Main WITH Endless : Loops; {SETS}",
}
LOOP = range(10, 13)  # lines of the WHILE loop

INITIALISATION = """FUNCTION Endless : DINT
VAR x : DINT; END_VAR
WHILE x >= 0 DO
    x := (x + 1) MOD 1000;
END_WHILE
Endless := x;
END_FUNCTION
PROGRAM Main
VAR
    n : DINT := Endless();
END_VAR
n := n + 1;
END_PROGRAM
"""


def start_loop(tool, plcrt, eventually, kind: str) -> None:
    """Unoptimised, so that the loop looks at its variable."""
    image = tool.build("loops", LOOPS.replace("{tasks}", TASKS[kind]), "-O0")
    tool.ok("flash", "--port", plcrt.port, str(image), "--no-start")
    tool.ok("write", "--port", plcrt.port, "run=TRUE")
    tool.ok("start", "--port", plcrt.port)
    eventually(lambda: tool.ok("read", "--port", plcrt.port, "begun")["values"]["begun"] > 0)


@pytest.mark.parametrize("kind", TASKS)
def test_stop_ends_an_endless_task_and_says_where_it_was(tool, plcrt, eventually, kind):
    start_loop(tool, plcrt, eventually, kind)
    tool.ok("stop", "--port", plcrt.port, timeout=PATIENCE)
    status = tool.ok("status", "--port", plcrt.port)
    assert (status["exception"]["name"], status["exception"]["task"]) == ("STOP_TIMEOUT", "Endless")
    assert status["exception"]["line"] in LOOP
    assert "Endless: did not end in time for a stop" in log(tool, plcrt)


def test_reset_ends_an_endless_task_and_the_program_starts_again(tool, plcrt, eventually):
    start_loop(tool, plcrt, eventually, "cyclic")
    tool.ok("reset", "cold", "--port", plcrt.port, timeout=PATIENCE)
    tool.ok("start", "--port", plcrt.port)
    eventually(lambda: tool.ok("read", "--port", plcrt.port, "begun")["values"]["begun"] > 10)


def test_a_download_ends_an_endless_task(tool, plcrt, eventually, counter):
    start_loop(tool, plcrt, eventually, "freewheeling")
    tool.ok("flash", "--port", plcrt.port, str(counter))
    eventually(lambda: tool.ok("read", "--port", plcrt.port, "Main.count")["values"]["Main.count"] > 10)


@pytest.mark.parametrize("kind", TASKS)
def test_plcrt_ends_on_sigterm_and_does_not_hold_it_against_the_program(tool, plcrt, eventually, kind):
    start_loop(tool, plcrt, eventually, kind)
    assert plcrt.stop(signal.SIGTERM) == 0
    plcrt.start()
    status = tool.ok("status", "--port", plcrt.port)
    assert (status["state"], status["exception"]) == ("run", None)


def test_plcrt_ends_on_sigterm_while_the_program_initialises(tool, plcrt):
    tool("flash", "--port", plcrt.port, str(tool.build("endless", INITIALISATION)))
    start = time.monotonic()
    assert plcrt.stop(signal.SIGTERM) == 0
    assert time.monotonic() - start < PATIENCE


def test_initialisation_that_does_not_end_is_broken_off(tool, plcrt):
    tool("flash", "--port", plcrt.port, str(tool.build("endless", INITIALISATION)))
    exception = tool.ok("status", "--port", plcrt.port)["exception"]
    assert exception["name"] == "WATCHDOG"
    tool.ok("reset", "warm", "--port", plcrt.port, timeout=PATIENCE)
