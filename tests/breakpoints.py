"""What breakpoints do, on any controller that has them: the tests of the simulator and of plcrt."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from plctool.compiler import compile_sources
from plctool.controller import Controller
from plctool.debug.breakpoints import Debugger, Halt
from plctool.errors import DeviceError, UsageError
from plctool.image.targets import host_target

FILE = "halting.st"
PROGRAM = """\
FUNCTION Add : INT
VAR_INPUT a : INT; b : INT; END_VAR
VAR sum : INT; list : ARRAY[0..3] OF INT; name : STRING(20); END_VAR
sum := a + b;                               // 4
list[2] := sum;
name := 'added';
Add := sum;                                 // 7
END_FUNCTION
FUNCTION_BLOCK Counter
VAR_INPUT step : INT; END_VAR
VAR_IN_OUT total : DINT; END_VAR
VAR_OUTPUT n : INT; END_VAR
VAR_TEMP twice : INT; END_VAR
twice := step * 2;                          // 14
n := Add(n, step);                          // 15
total := total + twice;                     // 16
END_FUNCTION_BLOCK
PROGRAM Main
VAR
    counter : Counter; cycles : DINT; total : DINT; k : INT; divisor : INT := 1; speed : REAL; wait : TIME;
    on : BOOL; word : WORD;
END_VAR
cycles := cycles + 1;                       // 23
FOR k := 1 TO 2 DO                          // 24
    counter(step := k, total := total);     // 25
END_FOR
speed := speed + 0.5;                       // 27
wait := wait + T#1ms;
on := NOT on;
word := word + 1;                           // 30
k := k / divisor;                           // 31
END_PROGRAM
PROGRAM Other
VAR n : DINT; END_VAR
n := n + 1;                                 // 35
END_PROGRAM
CONFIGURATION Config RESOURCE Res ON PLC
    TASK Fast(INTERVAL := T#5ms, PRIORITY := 1, WATCHDOG := T#100ms);
    TASK Slow(INTERVAL := T#7ms, PRIORITY := 9);
    PROGRAM Main WITH Fast : Main;
    PROGRAM Other WITH Slow : Other;
END_RESOURCE END_CONFIGURATION
"""


def build(folder: Path, *, level: int = 0, debug: bool = True, target: str = "") -> Path:
    """The image of PROGRAM."""
    target = target or os.environ.get("PLCRT_TARGET", "") or host_target()
    (folder / FILE).write_text(PROGRAM)
    built = compile_sources([folder / FILE], target=target, level=level, debug=debug)
    built.write(folder / "halting.cdl")
    return folder / "halting.cdl"


def halt(debugger: Debugger, seconds: float = 20) -> Halt:
    found = debugger.wait(seconds)
    assert found is not None, "the program did not halt"
    return found


def place(found: Halt) -> tuple[str, int]:
    return found.calls[0].pou, found.calls[0].line


def values(found: Halt, call: int = 0) -> dict[str, str]:
    """The variables of a call as ST writes them."""
    halted, at = found.halted, found.calls[call]
    return {n: halted.text(s) for n, s in (halted.locals(at) | halted.instance(at)).items() if n != "counter"}


class Breaking:
    """The fixture `plc` is a controller that runs PROGRAM."""

    target = ""  # what programs are built for; "" for this machine

    def test_a_task_halts_at_a_line_with_its_calls_and_variables(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        debugger.set(FILE, 15)
        found = halt(debugger)
        assert (found.reason, found.task) == ("breakpoint", "Fast")
        assert [(c.pou, c.line) for c in found.calls] == [("Counter", 15), ("Main", 25)]
        shown = values(found)
        assert (shown["step"], shown["twice"]) == ("1", "2")
        assert values(found, 1)["k"] == "1"
        assert plc.status().state == "halted"
        assert plc.read("Main.k") == 1

    def test_a_line_without_code_is_the_next_one_with_code(self, plc: Controller) -> None:
        assert plc.breakpoints.set(FILE, 2).line == 4
        assert plc.breakpoints.set(FILE, 12).line == 14

    def test_steps_lead_over_into_and_out_of_calls(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        debugger.set(FILE, 15)
        halt(debugger)
        debugger.step_into()
        assert place(halt(debugger)) == ("Add", 4)
        for line in (5, 6, 7):
            debugger.step_over()
            assert place(halt(debugger)) == ("Add", line)
        shown = values(debugger.halt or halt(debugger))
        assert (shown["list"], shown["name"]) == (f"[0, 0, {shown['sum']}, 0]", "'added'")
        debugger.step_out()
        assert place(halt(debugger)) == ("Counter", 15)
        debugger.step_over()
        assert place(halt(debugger)) == ("Counter", 16)
        debugger.step_out()
        assert place(halt(debugger)) in (("Main", 25), ("Main", 24))  # nothing of line 25 is left

    def test_a_step_over_stays_in_its_function(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        number = debugger.set(FILE, 15).number
        halt(debugger)
        debugger.clear(number)
        debugger.step_over()
        assert place(halt(debugger)) == ("Counter", 16)

    def test_a_step_out_of_a_program_leads_to_the_next_cycle_of_its_task(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        number = debugger.set(FILE, 31).number
        halt(debugger)
        debugger.clear(number)
        before = plc.read("Main.cycles")
        debugger.step_over()
        assert place(halt(debugger)) == ("Main", 23)
        assert plc.read("Main.cycles") == before
        debugger.step_cycle()
        assert place(halt(debugger)) == ("Main", 23)
        assert plc.read("Main.cycles") == before + 1

    def test_the_program_runs_to_a_line(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        number = debugger.set(FILE, 23).number
        halt(debugger)
        debugger.clear(number)
        debugger.run_to(FILE, 30)
        assert place(halt(debugger)) == ("Main", 30)

    def test_a_condition_is_checked_by_the_controller_if_it_compares_a_variable(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        start = plc.read("Main.cycles")
        made = debugger.set(FILE, 27, condition=f"Main.cycles >= {start + 20}")
        assert made.by_device is not None
        found = halt(debugger)
        assert plc.read("Main.cycles") >= start + 20
        assert debugger.list()[0][1] == 1
        assert found.breakpoints[0].number == made.number

    @pytest.mark.parametrize(
        "condition",
        ["Main.speed > 5.25", "Main.wait > T#20ms", "Main.on = TRUE", "Main.word.2 = TRUE", "Main.counter.n > 30"],
    )
    def test_conditions_of_all_types_are_compared_by_the_controller(self, plc: Controller, condition: str) -> None:
        debugger = plc.breakpoints
        assert debugger.set(FILE, 30, condition=condition).by_device is not None
        found = halt(debugger)
        assert found.halted.evaluate(condition, found.calls[0])

    def test_other_conditions_are_checked_by_the_tool(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        made = debugger.set(FILE, 15, condition="step = 2 AND (total MOD 2 = 0)")
        assert made.by_device is None
        assert values(halt(debugger))["step"] == "2"

    def test_a_breakpoint_halts_from_a_hit_on(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        before = plc.read("Main.cycles")
        debugger.set(FILE, 25, hits=6)
        found = halt(debugger)
        assert found.breakpoints
        assert debugger.list()[0][1] == 6
        assert plc.read("Main.cycles") - before >= 3

    def test_a_logpoint_writes_and_does_not_halt(self, plc: Controller) -> None:
        lines: list[str] = []
        debugger = plc.breakpoints
        debugger.output = lines.append
        debugger.set(FILE, 16, log="step {step} of {Main.cycles}, {step * 10}, {nothing}")
        debugger.set(FILE, 27, hits=3)
        found = halt(debugger)
        assert place(found) == ("Main", 27)
        assert len(lines) >= 4
        assert lines[-1].startswith("step 2 of ")
        assert ", 20, <There is no variable nothing" in lines[-1]

    def test_variables_are_written_while_the_task_is_halted(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        number = debugger.set(FILE, 16).number
        found = halt(debugger)
        debugger.clear(number)
        found.halted.write("twice", "1000", found.calls[0])
        found.halted.write("step", "7", found.calls[0])
        found.halted.write("total", "50", found.calls[0])
        plc.write({"Main.word": 99})
        debugger.step_over()
        found = halt(debugger)
        assert plc.read("Main.total") == 1050
        assert plc.read("Main.counter.step") == 7
        with pytest.raises(UsageError):
            found.halted.write("Main.word", "many", found.calls[0])
        with pytest.raises(UsageError, match="no variable"):
            found.halted.write("nobody", "1", found.calls[0])

    def test_other_tasks_wait_and_go_on(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        debugger.set(FILE, 23)
        halt(debugger)
        before = plc.read("Other.n")
        for _ in range(3):
            debugger.step_over()
            halt(debugger)
        assert plc.read("Other.n") - before <= 1  # a cycle that ran ends
        debugger.clear_all()
        debugger.go()
        self.wait(debugger)
        assert plc.read("Other.n") > before + 2
        assert plc.status().state == "run"

    def test_each_task_goes_on_from_where_it_halted(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        for line, task in ((35, "Slow"), (23, "Fast")):
            number = debugger.set(FILE, line).number
            for _ in range(5):
                found = halt(debugger)
                assert (found.task, place(found)[1], found.exception) == (task, line, "")
                debugger.go()
            debugger.clear(number)
            if debugger.wait(0) is not None:
                debugger.go()
        self.wait(debugger)
        assert plc.status().state == "run"

    def wait(self, debugger: Debugger) -> None:
        assert debugger.wait(0.3) is None

    def test_a_running_program_is_paused(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        debugger.pause()
        found = halt(debugger)
        assert found.reason == "pause"
        assert found.calls[0].pou in ("Main", "Counter", "Add", "Other")
        debugger.go()
        self.wait(debugger)

    def test_an_exception_halts_before_it_unwinds(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        plc.write({"Main.divisor": 0})
        found = halt(debugger)
        assert (found.reason, found.exception) == ("exception", "DIVIDEBYZERO")
        assert place(found) == ("Main", 31)
        assert plc.status().exception is None
        debugger.go()
        debugger.wait(0.2)
        exception = plc.status().exception
        assert exception is not None and exception.line == 31

    @pytest.mark.parametrize("what", ["stop", "reset"])
    def test_a_halted_program_is_stopped_like_any(self, plc: Controller, what: str) -> None:
        debugger = plc.breakpoints
        debugger.set(FILE, 15)
        halt(debugger)
        plc.stop() if what == "stop" else plc.reset("warm")
        assert plc.status().state == "stop"
        debugger.forget_halt()
        plc.start()
        assert place(halt(debugger)) == ("Counter", 15)

    def test_a_program_without_debugging_information_halts_by_line(self, plc: Controller, tmp_path: Path) -> None:
        folder = tmp_path / "optimised"
        folder.mkdir()
        plc.flash(build(folder, level=2, debug=False, target=self.target))
        debugger = plc.breakpoints
        debugger.set(FILE, 30)
        assert halt(debugger).calls[0].line == 30

    @pytest.mark.parametrize("level", [0, 2])
    def test_a_program_computes_the_same_with_a_trap_at_each_statement(
        self, plc: Controller, tmp_path: Path, level: int
    ) -> None:
        folder = tmp_path / f"level{level}"
        folder.mkdir()
        plc.flash(build(folder, level=level, debug=level == 0, target=self.target))
        debugger = plc.breakpoints
        room = debugger._target.status().room
        for offset in sorted(debugger.statements.stops)[:room]:
            debugger._target.set(offset, 10**9, None)
        start = plc.read("Main.cycles")
        self.run_until(debugger, lambda: plc.read("Main.cycles") > start + 20)
        hits = debugger._target.hits()
        plc.stop()
        cycles = plc.read("Main.cycles")
        assert (plc.read("Main.total"), plc.read("Main.word")) == (6 * cycles, cycles)
        assert max(hits.values()) >= 20

    def run_until(self, debugger: Debugger, condition: Callable[[], bool]) -> None:
        for _ in range(200):
            assert debugger.wait(0.1) is None
            if condition():
                return
        pytest.fail("the program does not run")

    def test_a_task_halts_at_the_statement_after_a_change(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        start = plc.read("Main.word")
        made = debugger.watch("Main.word", hits=2)
        found = halt(debugger)
        assert (found.reason, place(found)) == ("data breakpoint", ("Main", 31))
        assert plc.read("Main.word") >= start + 2
        (changed,) = found.changed
        assert changed.breakpoint == made
        assert int(changed.new[3:], 16) == int(changed.old[3:], 16) + 1 == plc.read("Main.word")
        assert debugger.granularity == "each statement"
        debugger.clear(made.number)
        assert debugger.watched() == []
        debugger.go()
        self.wait(debugger)

    def test_several_variables_are_compared_bits_and_members_too(self, plc: Controller) -> None:
        """Each task compares all of them, so that the other one may be the first to see a change."""
        debugger = plc.breakpoints
        for name in ("Main.counter.n", "Main.word.1", "Other.n"):
            debugger.watch(name)
        wanted = {("Main.counter.n", "Counter", 16), ("Main.word.1", "Main", 31)}
        seen = set()
        for _ in range(100):
            found = halt(debugger)
            seen |= {(changed.breakpoint.name, *place(found)) for changed in found.changed}
            debugger.go()
            if wanted <= seen and "Other.n" in {name for name, *_ in seen}:
                break
        assert wanted <= seen
        assert "Other.n" in {name for name, *_ in seen}

    def test_a_change_counts_if_its_condition_is_true(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        debugger.watch("Main.k", condition="Main.k = 3")
        found = halt(debugger)
        assert plc.read("Main.k") == 3
        assert [c.new for c in found.changed] == ["3"]

    def test_a_variable_that_the_tool_writes_has_changed_too(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        debugger.watch("Main.divisor")
        self.wait(debugger)
        plc.write({"Main.divisor": 2})
        found = halt(debugger)
        assert [str(c) for c in found.changed] == ["Main.divisor: 1 -> 2"]

    def test_a_member_of_the_instance_of_a_call_is_compared(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        number = debugger.set(FILE, 14).number
        found = halt(debugger)
        debugger.clear(number)
        made = debugger.watch(found.halted.in_area("n", found.calls[0]))
        assert made.name == "Main.counter.n"
        debugger.go()
        assert place(halt(debugger)) == ("Counter", 16)
        with pytest.raises(UsageError, match="twice is a variable of a call, which ends with it"):
            found.halted.in_area("twice", found.calls[0])

    def test_what_cannot_be_compared_is_refused(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        with pytest.raises(UsageError, match=r"Main\.counter is a .*Name a part of it"):
            debugger.watch("Main.counter")
        with pytest.raises(UsageError):
            debugger.watch("Main.nothing")
        for name in ("Main.k", "Main.on", "Main.total", "Main.cycles"):
            debugger.watch(name)
        with pytest.raises(DeviceError):
            debugger.watch("Main.speed")
        assert len(debugger.watched()) == 4

    def test_breakpoints_end_with_the_debugger(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        debugger.set(FILE, 15)
        halt(debugger)
        plc.end_debugging()
        assert plc.status().state == "run"
        assert plc.breakpoints.list() == []
        self.wait(plc.breakpoints)

    def test_what_makes_no_sense_is_refused_with_what_to_do(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        with pytest.raises(UsageError, match=r"no code of other\.st; it is made of .*halting\.st"):
            debugger.set("other.st", 1)
        with pytest.raises(UsageError, match="no code at line 1000"):
            debugger.set(FILE, 1000)
        with pytest.raises(UsageError, match="is not an expression; write"):
            debugger.set(FILE, 15, condition="step >")
        with pytest.raises(UsageError, match="from the first hit on"):
            debugger.set(FILE, 15, hits=0)
        with pytest.raises(UsageError, match="no breakpoint 99"):
            debugger.clear(99)
        with pytest.raises(UsageError, match="The program runs"):
            debugger.step_over()
        assert debugger.list() == []

    def test_a_condition_that_fails_halts_and_says_why(self, plc: Controller) -> None:
        lines: list[str] = []
        debugger = plc.breakpoints
        debugger.output = lines.append
        debugger.set(FILE, 15, condition="nothing + 1 > 0")
        halt(debugger)
        assert "There is no variable nothing" in lines[0]

    def test_a_full_list_is_refused(self, plc: Controller) -> None:
        debugger = plc.breakpoints
        room = debugger._target.status().room
        offsets = sorted(debugger.statements.stops)
        with pytest.raises(DeviceError):
            for offset in range(room + 1):
                debugger._target.set(offsets[0] + offset, 10**6, None)
        debugger._target.detach()
