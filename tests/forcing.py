"""What forced variables do, on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from plctool.controller import Controller
from plctool.errors import DeviceError, UsageError
from plctool.testing.waiting import eventually

PROGRAM = """
TYPE Point : STRUCT x : INT; y : LREAL; END_STRUCT END_TYPE
FUNCTION_BLOCK Adder
VAR_INPUT step : INT; END_VAR
VAR_IN_OUT total : DINT; END_VAR
VAR_OUTPUT calls : INT; END_VAR
total := total + step;
calls := calls + 1;
END_FUNCTION_BLOCK
VAR_GLOBAL
    switch AT %IX0.3 : BOOL;
    level AT %IW1 : INT;
    lamp AT %QX0.2 : BOOL;
    other AT %QX0.3 : BOOL;
    valve AT %QW1 : INT;
END_VAR
PROGRAM Main
VAR
    n : DINT; seen : DINT; sum : DINT; word : WORD; half : BOOL; add : Adder; list : ARRAY[1..3] OF Point;
    name : STRING;
    pause : TIME; place : POINTER TO DINT; a : DINT; b : DINT; saw_switch : BOOL; saw_level : INT; divisor : DINT := 1;
END_VAR
VAR RETAIN kept : DINT; END_VAR
seen := n;
n := (n + 1) / divisor;
kept := kept + 1;
word := word + 1;
half := NOT half;
add(step := 1, total := sum);
list[2].y := 1.0;
pause := pause + T#1ms;
IF place = 0 THEN place := ADR(a); END_IF
a := 0;
b := 0;
saw_switch := switch;
saw_level := level;
lamp := FALSE;
other := TRUE;
valve := 1;
END_PROGRAM
PROGRAM Look
VAR lamp_there : BOOL; valve_there : INT; n : DINT; END_VAR
lamp_there := lamp;
valve_there := valve;
n := n + 1;
END_PROGRAM
CONFIGURATION Config RESOURCE Res ON PLC
    TASK Fast(INTERVAL := T#5ms, PRIORITY := 1);
    TASK Slow(INTERVAL := T#7ms, PRIORITY := 9);
    PROGRAM Main WITH Fast : Main;
    PROGRAM Look WITH Slow : Look;
END_RESOURCE END_CONFIGURATION
"""


class Forcing:
    """The fixture `plc` is a controller that runs PROGRAM."""

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        """Lets the program run until the condition holds."""
        eventually(condition)

    def pass_cycles(self, plc: Controller) -> None:
        """Lets each task run some whole cycles."""
        before = [task.cycles for task in plc.tasks()]
        self.wait(plc, lambda: all(task.cycles >= was + 3 for task, was in zip(plc.tasks(), before, strict=True)))

    def read(self, plc: Controller, *names: str) -> dict[str, Any]:
        self.pass_cycles(plc)
        return plc.read_all(names)

    def test_a_forced_variable_is_what_the_program_reads_and_leaves(self, plc: Controller) -> None:
        plc.force({"Main.n": 1000, "Main.pause": "T#3s", "Main.half": True, "Main.list[2].y": 2.5})
        values = self.read(plc, "Main.n", "Main.seen", "Main.pause", "Main.half", "Main.list[2].y")
        assert list(values.values()) == [1000, 1000, "T#3s", True, 2.5]
        plc.unforce(["Main.n"])
        self.wait(plc, lambda: plc.read("Main.n") > 1000)
        assert list(plc.forced()) == ["Main.pause", "Main.half", "Main.list[2].y"]

    def test_a_write_to_a_forced_variable_does_not_last(self, plc: Controller) -> None:
        plc.force({"Main.n": -5})
        plc.write({"Main.n": 7})
        assert self.read(plc, "Main.n", "Main.seen") == {"Main.n": -5, "Main.seen": -5}

    def test_a_forced_bit_leaves_the_others_to_the_program(self, plc: Controller) -> None:
        plc.force({"Main.word.15": True, "Main.word.12": False})
        values = set()
        self.wait(plc, lambda: values.add(plc.read("Main.word")) or len(values) > 1)
        assert all(value & 0x9000 == 0x8000 for value in values)

    def test_a_forced_input_is_what_the_program_sees(self, plc: Controller) -> None:
        plc.force({"switch": True, "%IW1": 1234})
        values = self.read(plc, "Main.saw_switch", "Main.saw_level", "%IX0.3", "level")
        assert list(values.values()) == [True, 1234, True, 1234]

    def test_a_forced_output_is_what_other_tasks_read(self, plc: Controller) -> None:
        plc.force({"lamp": True, "valve": 77})
        values = self.read(plc, "Look.lamp_there", "Look.valve_there", "lamp", "other", "%QW1")
        assert list(values.values()) == [True, 77, True, True, 77]
        plc.unforce()
        assert self.read(plc, "Look.valve_there", "valve") == {"Look.valve_there": 1, "valve": 1}

    def test_what_a_reference_leads_to_is_forced_by_way_of_it(self, plc: Controller) -> None:
        plc.force({"Main.add.total": 50, "Main.add.calls": 3})
        assert self.read(plc, "Main.sum", "Main.add.calls") == {"Main.sum": 50, "Main.add.calls": 3}
        assert plc.forced() == {"Main.add.total": 50, "Main.add.calls": 3}

    def test_a_pointer_is_followed_in_each_cycle(self, plc: Controller) -> None:
        self.pass_cycles(plc)
        plc.force({"Main.place^": 9})
        assert self.read(plc, "Main.a", "Main.b") == {"Main.a": 9, "Main.b": 0}
        assert plc.forced() == {"Main.place^": 9}

    def test_safe_outputs_win_and_the_force_holds_after_the_start(self, plc: Controller) -> None:
        plc.force({"valve": 77, "Main.n": 5})
        self.pass_cycles(plc)
        plc.stop()
        assert plc.read("valve") == 0
        assert plc.forced() == {"valve": 77, "Main.n": 5}
        plc.start()
        assert self.read(plc, "valve", "Main.seen") == {"valve": 77, "Main.seen": 5}

    def test_an_exception_leaves_safe_outputs(self, plc: Controller) -> None:
        plc.force({"valve": 77, "Main.divisor": 0})
        self.wait(plc, lambda: plc.status().exception)
        assert plc.read("valve") == 0
        assert plc.status().forced == ["valve", "Main.divisor"]
        plc.reset("warm")
        plc.start()
        assert plc.forced() == {}
        assert self.read(plc, "valve") == {"valve": 1}

    @pytest.mark.parametrize("option", ["warm", "cold"])
    def test_a_reset_ends_it(self, plc: Controller, option: str) -> None:
        plc.force({"Main.n": 5})
        plc.reset(option)
        assert plc.forced() == {}
        assert plc.status().forced == []
        plc.start()
        self.wait(plc, lambda: plc.read("Main.n") not in (0, 5))

    def test_what_is_forced_is_marked(self, plc: Controller) -> None:
        assert plc.sample(["Main.n"]).forced == []
        plc.force({"Main.n": 5, "Main.list[1].x": 1, "Main.word.9": True})
        reading = plc.sample(["Main.n", "Main.seen", "Main.list", "Main.list[1].y", "Main.word.9", "Main.word.8"])
        assert reading.forced == ["Main.n", "Main.list", "Main.word.9"]
        assert reading.marked_texts["Main.n"] == "5 (forced)"
        assert plc.status().forced == ["Main.n", "Main.list[1].x", "Main.word.9"]
        plc.unforce()
        assert plc.sample(["Main.n"]).forced == []

    def test_a_full_list_is_refused_with_its_number_and_changes_nothing(self, plc: Controller) -> None:
        plc.force({"Main.n": 5})
        bits = {f"Main.{name}.{bit}": True for name in ("n", "seen", "sum", "a", "b", "kept") for bit in range(32)}
        with pytest.raises(DeviceError, match=r"forces \d+ variables at most, and 1 are forced"):
            plc.force(bits)
        assert plc.forced() == {"Main.n": 5}

    def test_what_cannot_be_forced_is_refused_with_what_to_do(self, plc: Controller) -> None:
        for name, words in {
            "Main.name": "string",
            "Main.list": r"Main\.list\[1\]\.x",
            "Main.add": r"Main\.add\.step",
            "Main.nothing": "no variable",
        }.items():
            with pytest.raises(UsageError, match=words):
                plc.force({"Main.n": 5, name: 1})
        with pytest.raises(UsageError):
            plc.force({"Main.n": "many"})
        with pytest.raises(UsageError, match="is not forced"):
            plc.unforce(["Main.n"])
        assert plc.forced() == {}
