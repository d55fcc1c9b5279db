"""Communication beside tasks that leave no pause, and the processor time that watchdogs count."""

from __future__ import annotations

import os
import signal
import time
from collections import Counter

import pytest

import plctool
from plctool.testing.plcrt import Plcrt

# A freewheeling task that takes `turns` turns per cycle, and one below it.
BUSY = """VAR_GLOBAL
    turns : DINT;
    begun, ended : DINT;
    below : DINT;
END_VAR
PROGRAM Free
VAR
    i : DINT;
    x : LREAL;
END_VAR
begun := begun + 1;
FOR i := 1 TO turns DO
    x := SQRT(x + 1.5);
END_FOR
ended := ended + 1;
END_PROGRAM
PROGRAM Below
below := below + 1;
END_PROGRAM
CONFIGURATION Config
    TASK Wheel(PRIORITY := 1, WATCHDOG := T#30m);
    TASK Low(INTERVAL := T#10ms, PRIORITY := 30);
    PROGRAM Main WITH Wheel : Free;
    PROGRAM Other WITH Low : Below;
END_CONFIGURATION
"""
CYCLE = 0.5  # processor time of a cycle to aim at [s]


@pytest.fixture
def connected(tool, plcrt, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tool.folder / "cache"))
    with plctool.connect(f"serial:{plcrt.port}") as plc:
        yield plc


def test_many_requests_are_answered_within_one_long_cycle(tool, connected, eventually):
    connected.flash(tool.build("busy", BUSY))
    turns = 1000
    while connected.tasks()[0].last_us < CYCLE * 1e6:
        turns *= 2
        connected.write({"turns": turns})
        before = connected.read("ended")
        eventually(lambda before=before: connected.read("ended") > before + 1)
    below = connected.read("below")

    def most_in_one_cycle() -> int:
        """Requests; one or two where communication waits for the end of a cycle."""
        return max(Counter(connected.read("begun") for _ in range(40)).values())

    eventually(lambda: most_in_one_cycle() > 3)
    eventually(lambda: connected.read("below") > below + 5)


def test_values_of_a_freewheeling_task_are_read_between_its_cycles(tool, connected, eventually):
    connected.flash(tool.build("busy", BUSY))
    connected.write({"turns": 100})
    eventually(lambda: connected.read("ended") > 10)
    readings = [connected.sample(["begun", "ended"]) for _ in range(100)]
    consistent = [reading.values for reading in readings if reading.consistent]
    assert len(consistent) > 50
    assert all(values["begun"] == values["ended"] for values in consistent)


def test_the_load_of_the_shell_counts_freewheeling_tasks(tool, connected, eventually):
    connected.flash(tool.build("busy", BUSY))
    connected.write({"turns": 5_000_000})
    eventually(lambda: int(connected.shell("plcload").removeprefix("PLC load: ").rstrip("%")) >= 10)


LOOPS = """VAR_GLOBAL
    run, looping : BOOL;
    n : DINT;
END_VAR
PROGRAM Loops
VAR
    x : DINT;
END_VAR
n := n + 1;
WHILE run DO
    looping := TRUE;
    x := x + 1;
END_WHILE
END_PROGRAM
CONFIGURATION Config
    TASK A(INTERVAL := T#1ms, PRIORITY := 0, WATCHDOG := T#30m);
    TASK B(INTERVAL := T#1ms, PRIORITY := 0, WATCHDOG := T#30m);
    TASK C(PRIORITY := 0, WATCHDOG := T#30m);
    TASK D(PRIORITY := 31, WATCHDOG := T#30m);
    PROGRAM A1 WITH A : Loops;
    PROGRAM B1 WITH B : Loops;
    PROGRAM C1 WITH C : Loops;
    PROGRAM D1 WITH D : Loops;
END_CONFIGURATION
"""


def test_tasks_that_take_all_processors_can_be_stopped(tool, connected, eventually):
    connected.flash(tool.build("loops", LOOPS, "-O0"))
    connected.write({"run": True})
    eventually(lambda: connected.read("looping"))
    connected.stop()
    exception = connected.status().exception
    assert exception is not None and exception.name == "STOP_TIMEOUT"


# Each cycle takes a good part of its interval, and far less processor time than its watchdog allows.
PAUSED = """PROGRAM Main
VAR
    i, n : DINT;
    x : LREAL;
END_VAR
n := n + 1;
FOR i := 1 TO 200000 DO
    x := SQRT(x + 1.5);
END_FOR
END_PROGRAM
CONFIGURATION Config
    TASK Half(INTERVAL := T#2ms, WATCHDOG := T#300ms);
    PROGRAM Main WITH Half : Main;
END_CONFIGURATION
"""


def test_a_process_that_is_paused_in_a_cycle_is_not_a_task_that_takes_too_long(tool, plcrt: Plcrt, connected):
    connected.flash(tool.build("paused", PAUSED))
    worker = plcrt.worker
    assert worker > 0  # 0 would be this process and its relatives
    for _ in range(6):
        before = connected.read("Main.n")
        os.kill(worker, signal.SIGSTOP)
        time.sleep(0.5)
        os.kill(worker, signal.SIGCONT)
        while connected.read("Main.n") < before + 3:
            assert connected.status().exception is None
    assert connected.status().exception is None


# The endless loop has begun; cycles of another task begin after it, one after the other.
BESIDE = """VAR_GLOBAL
    go : BOOL;
END_VAR
PROGRAM Loops
VAR
    x : DINT;
END_VAR
WHILE go DO
    x := x + 1;
END_WHILE
END_PROGRAM
PROGRAM Works
VAR
    i : DINT;
    x : LREAL;
END_VAR
FOR i := 1 TO 3000000 DO
    x := SQRT(x + 1.5);
END_FOR
END_PROGRAM
CONFIGURATION Config
    TASK Endless(INTERVAL := T#5ms, PRIORITY := 3, WATCHDOG := T#400ms);
    TASK Busy(PRIORITY := 2, WATCHDOG := T#30m);
    PROGRAM Main WITH Endless : Loops;
    PROGRAM Other WITH Busy : Works;
END_CONFIGURATION
"""


def us_beside_the_endless_loop(plc, eventually):
    """Time of the other task's cycles until the endless loop is broken [us]."""
    plc.write({"go": False})
    plc.start()
    cycles = plc.tasks()[1].cycles
    plc.write({"go": True})
    exception = eventually(lambda: plc.status().exception)
    assert (exception.name, exception.task) == ("WATCHDOG", "Endless")
    busy = plc.tasks()[1]
    plc.reset("warm")
    return (busy.cycles - cycles) * busy.min_us


def test_cycles_on_another_processor_do_not_stop_the_clock_of_an_endless_loop(tool, connected, eventually):
    """Processors are shared fairly; it was always six times as long as the watchdog. Other processes may hold it up."""
    connected.flash(tool.build("beside", BESIDE, "-O0"))
    eventually(lambda: us_beside_the_endless_loop(connected, eventually) < 3 * 400_000)
