"""What a program asks about its tasks, on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from plctool.controller import Controller
from plctool.core import lib
from plctool.testing.waiting import eventually

PROGRAM = """
VAR_GLOBAL
    results : ARRAY[0..8] OF UDINT;
    state : DWORD;
    info : ARRAY[0..1] OF Task_Info2;
    outside : UDINT := IecTaskGetCurrent(0);
    zero : DINT;
    long, long_after, free, trip : BOOL;
    loops : DINT;
    load, last : UDINT;
END_VAR
FUNCTION Spend
VAR n : DINT; END_VAR
FOR n := 1 TO loops DO
    state := (state * 1103515245) XOR SHR(state, 3) XOR 12345;
END_FOR
END_FUNCTION
PROGRAM Fast
VAR n : DINT; own : UDINT; failed : UDINT; END_VAR
n := n + 1;
own := IecTaskGetCurrent(ADR(failed));
IF trip THEN n := n / zero; END_IF
last := IecGetLastException();
END_PROGRAM
PROGRAM Slow
VAR n : DINT; own : UDINT; END_VAR
own := IecTaskGetCurrent(0);
results[0] := IecTaskGetFirst(ADR(results[1]));
results[2] := IecTaskGetNext(results[0], 0);
results[3] := IecTaskGetNext(results[2], ADR(results[4]));
IecTaskGetInfo(1, info[0]);
results[5] := IecTaskGetInfo(own, info[1]);
results[6] := IecTaskGetInfo(0, info[1]);
results[7] := IecTaskDisableWatchdog(1);
load := SchedGetProcessorLoad(0);
IF long THEN
    long := FALSE;
    IF free THEN
        results[8] := IecTaskDisableWatchdog(own);
    END_IF
    Spend();
    IF long_after THEN
        IecTaskEnableWatchdog(own);
        Spend();
    END_IF
END_IF
n := n + 1;
END_PROGRAM
CONFIGURATION C
    RESOURCE R ON PLC
        TASK TheFast(INTERVAL := T#10ms, PRIORITY := 3);
        TASK TheSlow(INTERVAL := T#50ms, PRIORITY := 7, WATCHDOG := T#40ms);
        PROGRAM Fast WITH TheFast : Fast;
        PROGRAM Slow WITH TheSlow : Slow;
    END_RESOURCE
END_CONFIGURATION
"""
INVALID = 0xFFFFFFFF


class TaskCalls:
    """The fixture `plc` is a controller that runs PROGRAM."""

    LOOPS: int
    """So many take more than the watchdog time of the task, and less than the time that no cycle may take."""

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        """Lets the program run until the condition holds."""
        eventually(condition)

    def run(self, plc: Controller) -> None:
        n = plc.read("Slow.n")
        self.wait(plc, lambda: plc.read("Slow.n") > n + 1)

    def test_each_task_knows_itself_and_the_others(self, plc: Controller) -> None:
        self.run(plc)
        assert plc.read("Fast.own", "Fast.failed", "Slow.own") == {"Fast.own": 1, "Fast.failed": 0, "Slow.own": 2}
        expected = [1, 0, 2, INVALID, lib.ERR_NO_OBJECT, 0, lib.ERR_NO_OBJECT, lib.ERR_PARAMETER]
        assert [plc.read(f"results[{n}]") for n in range(8)] == expected
        assert plc.read("outside") == INVALID

    def test_information_is_that_of_the_tool(self, plc: Controller) -> None:
        self.run(plc)
        fast, slow = plc.read("info[0]"), plc.read("info[1]")
        assert (fast["szName"], fast["nPriority"], fast["dwInterval"], fast["dwWatchdogTime"]) == (
            "TheFast",
            3,
            10_000,
            0,
        )
        assert (slow["szName"], slow["KindOf"], slow["dwWatchdogTime"]) == ("TheSlow", lib.KIND_CYCLIC, 40_000)
        assert 0 < fast["dwCycleCount"] <= plc.tasks()[0].cycles
        assert fast["dwMinCycleTime"] <= fast["dwAverageCycleTime"] <= fast["dwMaxCycleTime"]
        assert plc.read("load") <= 100

    def test_last_exception_outlives_a_reset(self, plc: Controller) -> None:
        assert plc.read("last") == 0
        plc.write({"trip": True})
        self.wait(plc, lambda: str(plc.status().state) == "exception")
        plc.reset("warm")
        plc.start()
        self.wait(plc, lambda: plc.read("last") == lib.RTSEXCPT_DIVIDEBYZERO)


class TaskWatchdogs(TaskCalls):
    """Where cycles take time."""

    def spend(self, plc: Controller, **options: bool) -> None:
        self.run(plc)
        plc.write({"loops": self.LOOPS, **options, "long": True})
        self.wait(plc, lambda: not plc.read("long") or str(plc.status().state) == "exception")

    def test_cycle_without_its_watchdog_may_take_longer(self, plc: Controller) -> None:
        self.spend(plc, free=True)
        self.run(plc)
        assert plc.read("results[8]") == 0
        assert plc.tasks()[1].max_us > 40_000

    def test_cycle_with_its_watchdog_may_not(self, plc: Controller) -> None:
        self.spend(plc)
        self.check_watchdog(plc)

    def test_watchdog_that_is_enabled_again_counts_from_there(self, plc: Controller) -> None:
        self.spend(plc, free=True, long_after=True)
        self.check_watchdog(plc)

    def test_next_cycle_has_its_watchdog_again(self, plc: Controller) -> None:
        self.spend(plc, free=True)
        self.run(plc)
        self.spend(plc, free=False)
        self.check_watchdog(plc)

    def check_watchdog(self, plc: Controller) -> None:
        self.wait(plc, lambda: str(plc.status().state) == "exception")
        exception = plc.status().exception
        assert exception is not None
        assert (exception.name, exception.task) == ("WATCHDOG", "TheSlow")
