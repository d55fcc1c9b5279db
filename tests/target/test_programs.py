"""Programs in place from flash: tasks, values, resets."""

from __future__ import annotations

import pytest
from programs import COUNTER, TWO_TASKS, program
from qemu import FLASH_SIZE

from plctool.debug.symbols import symbol_path
from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection
from plctool.link.services import AppState
from plctool.testing.waiting import eventually


def test_program_is_flashed_and_counts(plc, build):
    result = plc.flash(build(COUNTER).path)
    assert result.state is AppState.RUN
    eventually(lambda: plc.read("Main.n") > 20)


def test_code_lies_in_flash_as_it_was_built(board, plc, build):
    built = build(COUNTER)
    plc.flash(built.path)
    assert built.image in board.read_flash(0, FLASH_SIZE)


def test_fast_task_interrupts_the_slow_one(board, build):
    built = build(TWO_TASKS)
    with Plc(Connection(board.line())) as plc:
        plc.flash(built.path)
    board.power_off()
    board.power_on("exact")
    with Plc(Connection(board.line()), symbol_path(built.path)) as plc:
        eventually(lambda: plc.read("Slow.n") >= 100)
        fast, slow = plc.tasks()
    assert (fast.name, slow.name) == ("FastTask", "SlowTask")
    assert slow.min_us > 2000, "the slow task has to take longer than the interval of the fast one"
    assert (fast.overruns, slow.overruns) == (0, 0)
    assert fast.jitter_us < 200, "QEMU's serial line brings bytes as fast as the processor takes them"
    assert abs(fast.cycles - 10 * slow.cycles) <= 50


def test_variables_can_be_written_while_tasks_run(plc, build):
    plc.flash(build(COUNTER).path)
    plc.write({"Main.n": 1_000_000})
    eventually(lambda: plc.read("Main.n") > 1_000_000)


def test_pointers_are_followed_and_values_read_together_are_of_one_cycle(plc, build):
    text = program(
        "VAR first, last : LINT; list : ARRAY[1..20] OF DINT; i : INT; p : REF_TO LINT; nowhere : REF_TO DINT; END_VAR",
        """
first := first + 16#1_0000_0001;
FOR i := 1 TO 20 DO list[i] := LINT_TO_DINT(first MOD 16#1_0000_0000); END_FOR
p := REF(last);
last := first;
""",
    )
    plc.flash(build(text).path)
    eventually(lambda: plc.read("Main.last") > 0)
    readings = [plc.sample(["Main.first", "Main.list", "Main.p^"]) for _ in range(30)]
    consistent = [reading.values for reading in readings if reading.consistent]
    assert consistent
    for values in consistent:
        assert values["Main.first"] == values["Main.p^"]
        assert set(values["Main.list"]) == {values["Main.first"] % 2**32}
    with pytest.raises(DeviceError, match=r"Main\.nowhere is NULL"):
        plc.read("Main.nowhere^")


def test_real_arithmetic_has_the_right_bits(plc, build):
    text = program(
        "VAR a : REAL := 1.0; b : REAL; c : REAL; i : DINT; l : LINT; t : LINT; done : BOOL; END_VAR",
        """
IF NOT done THEN
    a := a / 3.0; b := a * 7.5 - 0.1; c := SQRT(b);
    i := REAL_TO_DINT(b * 1000.0); l := REAL_TO_LINT(b * 1.0E12); t := LINT#-7000000000 / 3 MOD 1000;
    done := TRUE;
END_IF
""",
    )
    plc.flash(build(text).path)
    eventually(lambda: plc.read("Main.done"))
    values = plc.read_all(["Main.a", "Main.b", "Main.c", "Main.i", "Main.l", "Main.t"])
    assert list(values.values()) == [
        pytest.approx(0.33333334, abs=1e-8),
        pytest.approx(2.4, abs=1e-6),
        pytest.approx(1.5491934, abs=1e-6),
        2400,
        pytest.approx(2.4e12, rel=1e-6),
        -333,
    ]


# ---- resets and power ------------------------------------------------------------------------------------------------


def test_boot_project_runs_after_power_on_and_keeps_retain_variables(board, build):
    with Plc(Connection(board.line())) as plc:
        plc.flash(build(COUNTER).path)
        eventually(lambda: plc.read("Main.kept") > 50)
        plc.stop()  # saves
        kept = plc.read("Main.kept")
    board.power_off()
    board.power_on()
    with Plc(Connection(board.line()), symbol_path(build(COUNTER).path)) as plc:
        assert plc.status().state is AppState.RUN
        assert kept <= plc.read("Main.kept")
        assert plc.read("Main.n") < kept + 100_000


def test_a_second_program_takes_the_place_of_the_first(plc, build):
    plc.flash(build(COUNTER).path)
    plc.flash(build(TWO_TASKS).path)
    eventually(lambda: plc.read("Fast.n") > 3)
    assert [task.name for task in plc.tasks()] == ["FastTask", "SlowTask"]


def test_code_runs_from_ram_where_the_board_prefers_it(make_board, build):
    board = make_board("full")
    with board, Plc(Connection(board.line())) as plc:
        plc.flash(build(COUNTER).path)
        eventually(lambda: plc.read("Main.n") > 20)
        plc.flash(build(TWO_TASKS).path)
        eventually(lambda: plc.read("Slow.n") > 2)
