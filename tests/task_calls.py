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
    long, long_after, free, trip, always : BOOL;
    decides, keeps_failing, ends_task, begins_task, go : BOOL;
    caught, caught_in, failures : UDINT;
    loops : DINT;
    load, last : UDINT;
    status : ARRAY[0..3] OF DWORD;
    mine, missing : DWORD;
    finfo : F_TASK_INFO;
END_VAR
FUNCTION Spend
VAR n : DINT; END_VAR
FOR n := 1 TO loops DO
    state := (state * 1103515245) XOR SHR(state, 3) XOR 12345;
END_FOR
END_FUNCTION
{attribute 'call_on' := 'EVT_TaskException'}
FUNCTION OnException : BOOL
caught := IecGetLastException();
caught_in := IecTaskGetCurrent(0);
failures := failures + 1;
trip := trip AND NOT decides OR keeps_failing;
IF ends_task THEN IecTaskDisableScheduling(caught_in); END_IF
OnException := decides;
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
results[3] := IecTaskGetNext(results[2] + 1, ADR(results[4]));
IF begins_task THEN IecTaskEnableScheduling(1); END_IF
IecTaskGetInfo(1, info[0]);
results[5] := IecTaskGetInfo(own, info[1]);
results[6] := IecTaskGetInfo(0, info[1]);
results[7] := IecTaskDisableWatchdog(1);
load := SchedGetProcessorLoad(0);
status[0] := Tasks1_16();
status[1] := Tasks17_32();
status[2] := CyclesCounter();
status[3] := OverrunsCounter();
missing := F_IecTasks_getInfo(ADR(finfo), UDINT_TO_WORD(DWORD_TO_UDINT(F_IecTasks_getCount())));
mine := F_IecTasks_getInfo(ADR(finfo), 16#FFFF);
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
IF always THEN Spend(); END_IF
n := n + 1;
END_PROGRAM
PROGRAM Level
VAR n : DINT; END_VAR
n := n + 1;
go := n MOD 5 <> 0;
END_PROGRAM
CONFIGURATION C
    RESOURCE R ON PLC
        TASK TheFast(INTERVAL := T#10ms, PRIORITY := 3);
        TASK TheSlow(INTERVAL := T#50ms, PRIORITY := 7, WATCHDOG := T#40ms);
        TASK TheLevel(LEVEL := go, PRIORITY := 5);
        PROGRAM Fast WITH TheFast : Fast;
        PROGRAM Level WITH TheLevel : Level;
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

    def test_status_words_and_counters_are_those_of_mk905(self, plc: Controller) -> None:
        self.wait(plc, lambda: plc.read("status[0]") != 0)
        self.run(plc)
        assert plc.read("status[1]") == 0
        assert plc.read("status[0]") & ~0b1111 == 0  # the tasks 1 and 2 only
        cycles, overruns = plc.read("status[2]"), plc.read("status[3]")
        assert 0 < cycles <= sum(task.cycles for task in plc.tasks())
        assert overruns <= sum(task.overruns for task in plc.tasks())
        info = plc.read("finfo")
        assert (info["name"], info["period_us"]) == ("TheSlow", 50_000)
        assert plc.read("mine", "missing") == {"mine": 1, "missing": 0}

    def test_level_task_runs_as_long_as_its_variable_is_true(self, plc: Controller) -> None:
        for expected in (5, 10):
            plc.write({"go": True})
            self.wait(plc, lambda: not plc.read("go"))
            self.run(plc)
            assert plc.read("Level.n") == expected

    def fail(self, plc: Controller, **options: bool) -> None:
        self.run(plc)
        plc.write({**options, "trip": True})
        self.wait(plc, lambda: plc.read("failures") > 0)

    def test_program_goes_on_after_an_exception_that_its_function_takes(self, plc: Controller) -> None:
        self.fail(plc, decides=True)
        self.run(plc)
        n = plc.read("Fast.n")
        self.wait(plc, lambda: plc.read("Fast.n") > n + 1)
        assert plc.read("caught", "caught_in", "failures") == {
            "caught": lib.RTSEXCPT_DIVIDEBYZERO,
            "caught_in": 1,
            "failures": 1,
        }
        assert plc.status().exception is None
        assert any("TheFast: division by zero; the program goes on" in entry.text for entry in plc.log())

    def test_function_stops_the_task_that_failed_and_another_starts_it(self, plc: Controller) -> None:
        self.fail(plc, decides=True, ends_task=True)
        n = plc.read("Fast.n")
        self.run(plc)
        assert plc.read("Fast.n") == n
        plc.write({"begins_task": True})
        self.wait(plc, lambda: plc.read("Fast.n") > n)

    def test_function_that_takes_no_exception_lets_the_program_stop(self, plc: Controller) -> None:
        self.fail(plc)
        self.wait(plc, lambda: str(plc.status().state) == "exception")
        exception = plc.status().exception
        assert exception is not None
        assert (exception.name, exception.task) == ("DIVIDEBYZERO", "TheFast")

    def test_task_that_fails_all_the_time_stops_the_program(self, plc: Controller) -> None:
        self.fail(plc, decides=True, keeps_failing=True)
        self.wait(plc, lambda: str(plc.status().state) == "exception")
        assert plc.read("failures") == 10  # IEC_TASK_MAX_FAILURES

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

    def test_load_of_each_task_is_that_of_the_tool(self, plc: Controller) -> None:
        plc.write({"loops": self.LOOPS // 100, "always": True})
        self.wait(plc, lambda: (plc.tasks()[1].load_percent or 0) > 0)
        self.run(plc)
        assert plc.read("info[1].dwLoad") > 0
        assert plc.read("load") > 0
        plc.stop()
        assert {task.load_percent for task in plc.tasks()} == {0}

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
