"""What traces do, on any controller: the tests of the simulator, of plcrt and of boards."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from plctool.controller import Controller
from plctool.errors import DeviceError, PlcError, UsageError
from plctool.link.traces import TraceOptions

PROGRAM = """
TYPE Point : STRUCT x : INT; y : LREAL; END_STRUCT END_TYPE
TYPE Color : (Red, Green, Blue); END_TYPE
VAR_GLOBAL level AT %IW1 : INT; valve AT %QW1 : INT; END_VAR
PROGRAM Main
VAR
    n : DINT; big : LINT := 5000000000; wave : LREAL; slow : REAL; word : WORD; half : BOOL; small : SINT := -100;
    list : ARRAY[1..3] OF Point; color : Color; pause : TIME; name : STRING; place : POINTER TO DINT; a : DINT;
    b : DINT := 77; copy : INT;
END_VAR
VAR CONSTANT limit : DINT := 5; END_VAR
n := n + 1;
big := big + 1;
wave := SIN(DINT_TO_LREAL(n) / 10.0);
slow := DINT_TO_REAL(n) * 0.5;
word := DINT_TO_WORD(n);
half := NOT half;
small := small + 1;
list[2].x := list[2].x + 2;
list[2].y := -wave;
IF n MOD 3 = 0 THEN color := Red; ELSIF n MOD 3 = 1 THEN color := Green; ELSE color := Blue; END_IF
pause := pause + T#1ms;
IF n MOD 2 = 0 THEN place := ADR(b); ELSE place := 0; END_IF
valve := DINT_TO_INT(n MOD 100);
copy := valve;
END_PROGRAM
PROGRAM Look
VAR n : DINT; END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION Config RESOURCE Res ON PLC
    TASK Fast(INTERVAL := T#5ms, PRIORITY := 1);
    TASK Slow(INTERVAL := T#20ms, PRIORITY := 9);
    PROGRAM Main WITH Fast : Main;
    PROGRAM Look WITH Slow : Look;
END_RESOURCE END_CONFIGURATION
"""


class Tracing:
    """The fixture `plc` is a controller that runs PROGRAM."""

    samples = 40

    def test_each_cycle_of_the_task_is_recorded(self, plc: Controller) -> None:
        names = ["Main.n", "Main.big", "Main.wave", "Main.slow", "Main.half", "Main.small", "Main.pause", "Main.word.0"]
        found = plc.trace(names, samples=self.samples)
        assert (len(found), found.lost, found.complete, found.task) == (self.samples, 0, True, "Fast")
        first = found["Main.n"][0]
        for i, n in enumerate(found["Main.n"]):
            assert n == first + i
            assert found["Main.big"][i] == 5_000_000_000 + n
            assert math.isclose(found["Main.wave"][i], math.sin(n / 10), abs_tol=1e-12)
            assert found["Main.slow"][i] == n * 0.5
            assert found["Main.half"][i] is bool(n % 2)
            assert found["Main.small"][i] == (n - 100 + 128) % 256 - 128
            assert found["Main.pause"][i] == n
            assert found["Main.word.0"][i] is bool(n % 2)
        assert found.times_ms[0] == 0
        assert math.isclose(found.times_ms[-1], 5 * (self.samples - 1), rel_tol=0.5)

    def test_structures_enumerations_and_outputs_are_recorded(self, plc: Controller) -> None:
        found = plc.trace(["Main.list[2]", "Main.color", "valve", "Main.copy", "level"], samples=6)
        assert found.names == ["Main.list[2].x", "Main.list[2].y", "Main.color", "valve", "Main.copy", "level"]
        assert found["valve"] == found["Main.copy"]
        x = found["Main.list[2].x"]
        assert [(b - a) % 65536 for a, b in pairwise(x)] == [2] * 5
        assert {row[3] for row in found.rows()} == {"0", "1", "2"}

    def test_a_task_can_be_chosen_and_every_nth_cycle(self, plc: Controller) -> None:
        found = plc.trace(["Look.n"], task="slow", every=2, samples=4)
        assert found["Look.n"] == list(range(found["Look.n"][0], found["Look.n"][0] + 8, 2))
        assert found.task == "Slow"

    def test_a_pointer_is_followed_in_each_cycle(self, plc: Controller) -> None:
        found = plc.trace(["Main.place^", "Main.n"], samples=4)
        assert found["Main.place^"] == [0 if n % 2 else 77 for n in found["Main.n"]]

    @pytest.mark.parametrize(
        ("trigger", "name", "is_true"),
        [
            ("Main.n > {n}", "Main.n", lambda v, n: v == n + 1),
            ("Main.big>={big}", "Main.n", lambda v, n: v == n),
            ("Main.wave < -0.5", "Main.wave", lambda v, n: v < -0.5),
            ("Main.slow >= {slow}", "Main.slow", lambda v, n: v == n * 0.5),
            ("Main.half", "Main.half", lambda v, n: v is True),
            ("NOT Main.half", "Main.half", lambda v, n: v is False),
            ("Main.word.3 = TRUE", "Main.word.3", lambda v, n: v is True),
            ("Main.color = Blue", "Main.n", lambda v, n: v % 3 == 2),
            ("Main.list[2].x <> 0", "Main.n", lambda v, n: True),
        ],
    )
    def test_a_trigger_decides_from_when_on(self, plc: Controller, trigger: str, name: str, is_true) -> None:
        n = plc.read("Main.n") + 60
        text = trigger.format(n=n, big=5_000_000_000 + n, slow=n * 0.5)
        level = "<> 0" in trigger
        found = plc.trace(list(dict.fromkeys([name, "Main.n"])), samples=8, before=3, trigger=text, level=level)
        assert found.trigger is not None
        assert (found.complete, found.lost, len(found) - found.trigger) == (True, 0, 5)
        assert found.trigger <= 3
        assert is_true(found[name][found.trigger], n)
        assert all(b == a + 1 for a, b in pairwise(found["Main.n"]))
        assert found.times_ms[found.trigger] == 0

    def test_system_values_of_the_task_are_recorded(self, plc: Controller) -> None:
        found = plc.trace(["@cycle", "@late", "@load", "Main.n"], samples=10)
        assert [column.unit for column in found.columns] == ["us", "us", "%", ""]
        for cycle, load in zip(found["@cycle"], found["@load"], strict=True):
            assert 0 <= cycle < 1e6
            assert math.isclose(load, cycle / 5000 * 100)

    def test_two_tools_trace_at_once(self, plc: Controller) -> None:
        with (
            plc.start_trace(["Main.n"], TraceOptions(samples=10)) as first,
            plc.start_trace(["Look.n", "Main.half"], TraceOptions(samples=5, name="second"), "Slow") as second,
        ):
            assert [config.name for config in plc.traces()] == ["", "second"]
            assert len(plc.finish_trace(second)) == 5
            assert len(plc.finish_trace(first)) == 10
        assert plc.traces() == []

    def test_a_kept_trace_is_opened_by_its_name(self, plc: Controller) -> None:
        options = TraceOptions(samples=12, name="night", keep=True)
        with plc.start_trace(["Main.n", "Main.wave", "Main.half", "Main.word.2", "@cycle"], options):
            pass
        with pytest.raises(UsageError, match="There is a trace night"):
            plc.start_trace(["Main.n"], options)
        with plc.open_trace("Night") as opened:
            found = plc.finish_trace(opened)
        assert set(found.names) == {"Main.n", "Main.wave", "Main.half", "Main.word.2", "@cycle"}
        assert all(math.isclose(w, math.sin(n / 10)) for n, w in zip(found["Main.n"], found["Main.wave"], strict=True))
        plc.end_trace("night")
        with pytest.raises(UsageError, match="There is no trace night; there is none"):
            plc.open_trace("night")

    def test_a_reset_ends_it_and_the_error_says_so(self, plc: Controller) -> None:
        running = plc.start_trace(["Main.n"], TraceOptions())
        running.poll()
        plc.reset("warm")
        with pytest.raises(DeviceError, match="The trace has ended: by a download, a reset"):
            running.poll()
        plc.start()
        running.end()
        assert plc.traces() == []

    def test_what_cannot_be_traced_is_refused_with_what_to_do(self, plc: Controller) -> None:
        for name, words in {
            "Main.name": "is a string, which cannot be traced",
            "Main.place": "cannot be traced",
            "Main.limit": "is a constant",
            "Main.nothing": "no variable",
            "@nothing": "there are @cycle, @late, @load",
        }.items():
            with pytest.raises(UsageError, match=words):
                plc.trace(["Main.n", name], samples=1)
        for trigger, words in {
            "Main.n": "is no BOOL; write for example 'Main.n > 5'",
            "> 5": "has no variable",
            "": "is empty",
            "Main.n > many": "many",
            "@cycle > x": "compare it with one",
            "@cycle > -1": "never",
        }.items():
            with pytest.raises(UsageError, match=words):
                plc.trace(["Main.n"], samples=1, trigger=trigger)
        for options, words in (
            ({"every": 0}, "n is 1 or more"),
            ({"samples": 0}, "at least one sample"),
            ({"before": 3}, "need a trigger"),
            ({"before": 10, "samples": 10, "trigger": "Main.half"}, "Less than all samples"),
            ({"task": "None"}, "There is no task None; there are Fast, Slow"),
        ):
            with pytest.raises(UsageError, match=words):
                plc.trace(["Main.n"], **options)
        with pytest.raises(UsageError, match="takes a list of names"):
            plc.trace("Main.n")
        with pytest.raises(UsageError, match="at most"):
            plc.trace([f"Main.n.{bit}" for bit in range(32)] + [f"Main.big.{bit}" for bit in range(64)] + ["Main.a"])
        assert plc.traces() == []

    def test_a_full_buffer_is_refused_with_what_to_do(self, plc: Controller) -> None:
        names = ["Main.wave", "Main.big"]
        with (
            plc.start_trace(names, TraceOptions(samples=1 << 31)),
            pytest.raises(PlcError, match=r"no room for this trace.*--list"),
        ):
            plc.trace(names, samples=1000)
        assert plc.traces() == []
