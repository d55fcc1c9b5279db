"""Programs in place from flash: tasks, values, exceptions, resets."""

from __future__ import annotations

from contextlib import suppress

import pytest
from programs import COUNTER, TWO_TASKS, compile_text, program
from qemu import FLASH_SIZE

from plctool.device import Plc
from plctool.errors import LinkError
from plctool.link.connection import Connection
from plctool.link.services import AppState
from plctool.symbols import symbol_path


def test_program_is_flashed_and_counts(plc, build, eventually):
    result = plc.flash(build(COUNTER).path)
    assert result.state is AppState.RUN
    eventually(lambda: plc.read("Main.n") > 20)


def test_code_lies_in_flash_as_it_was_built(board, plc, build):
    built = build(COUNTER)
    plc.flash(built.path)
    assert built.image in board.read_flash(0, FLASH_SIZE)


def test_fast_task_interrupts_the_slow_one(board, build, eventually):
    built = build(TWO_TASKS)
    with Plc(Connection(board.line())) as plc:
        plc.flash(built.path)
    board.power_off()
    board.power_on(exact=True)
    with Plc(Connection(board.line()), symbol_path(built.path)) as plc:
        eventually(lambda: plc.read("Slow.n") >= 100)
        fast, slow = plc.tasks()
    assert (fast.name, slow.name) == ("FastTask", "SlowTask")
    assert slow.min_us > 2000, "the slow task has to take longer than the interval of the fast one"
    assert (fast.overruns, slow.overruns) == (0, 0)
    assert fast.jitter_us < 200, "QEMU's serial line brings bytes as fast as the processor takes them"
    assert abs(fast.cycles - 10 * slow.cycles) <= 50


def test_variables_can_be_written_while_tasks_run(plc, build, eventually):
    plc.flash(build(COUNTER).path)
    plc.write({"Main.n": 1_000_000})
    eventually(lambda: plc.read("Main.n") > 1_000_000)


def test_real_arithmetic_has_the_right_bits(plc, build, eventually):
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


# ---- what goes wrong -------------------------------------------------------------------------------------------------

FAULTS = {
    "division": ("VAR a : DINT := 1; b : DINT; END_VAR", "a := a / b;", "DIVIDEBYZERO"),
    "bounds": ("VAR f : ARRAY[0..3] OF INT; i : INT := 9; END_VAR", "f[i] := 1;", "ARRAYBOUNDS"),
    "null": ("VAR p : POINTER TO DINT; END_VAR", "p^ := 1;", "ACCESS_VIOLATION"),
    "endless": ("VAR x : DINT; END_VAR", "WHILE TRUE DO x := x + 1; END_WHILE", "WATCHDOG"),
}


def has_stopped(plc: Plc) -> bool:
    """Whether an exception stopped the application. The device does not answer before an endless loop was broken."""
    with suppress(LinkError):
        return plc.status().state is AppState.EXCEPTION
    return False


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_stops_the_application_and_names_its_line(plc, build, eventually, fault):
    variables, body, name = FAULTS[fault]
    text = program(f"VAR ok : DINT; trip : BOOL; END_VAR\n{variables}", f"ok := ok + 1;\nIF trip THEN\n{body}\nEND_IF")
    plc.flash(build(text).path)
    eventually(lambda: plc.read("Main.ok") > 3)
    plc.write({"Main.trip": True})
    eventually(lambda: has_stopped(plc))
    exception = plc.status().exception
    assert (exception.name, exception.task, exception.pou) == (name, "Fast", "Main")
    assert exception.line == text.split("\n").index(body) + 1
    plc.reset("warm")
    plc.start()
    eventually(lambda: plc.read("Main.ok") > 3)


def test_unchecked_access_is_caught_by_the_processor(plc, tmp_path, eventually):
    from conftest import TARGET

    text = program("VAR p : POINTER TO DINT; n : DINT; END_VAR", "n := n + 1; IF n > 5 THEN p^ := n; END_IF")
    plc.flash(compile_text(text, TARGET, tmp_path, checks="none").path)
    eventually(lambda: plc.status().state is AppState.EXCEPTION)
    assert plc.status().exception.name == "ACCESS_VIOLATION"


@pytest.mark.parametrize("last", [299, 999], ids=["into another task's stack", "past all stacks"])
def test_stack_overflow_is_caught(plc, build, eventually, last):
    text = f"""
FUNCTION Large : DINT
VAR_INPUT
    i : DINT;
END_VAR
VAR
    f : ARRAY[0..{last}] OF DINT;
END_VAR
f[i] := i;
Large := f[i + 1] + f[i];
END_FUNCTION
""" + program("VAR n : DINT; i : DINT; END_VAR", "n := n + 1; IF n > 5 THEN i := Large(i); END_IF")
    plc.flash(build(text).path)
    eventually(lambda: plc.status().state is AppState.EXCEPTION)
    assert plc.status().exception.name == "STACK_OVERFLOW"
    assert plc.status().exception.task == "Fast"


# ---- resets and power ------------------------------------------------------------------------------------------------


def test_boot_project_runs_after_power_on_and_keeps_retain_variables(board, build, eventually):
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


def test_a_second_program_takes_the_place_of_the_first(plc, build, eventually):
    plc.flash(build(COUNTER).path)
    plc.flash(build(TWO_TASKS).path)
    eventually(lambda: plc.read("Fast.n") > 3)
    assert [task.name for task in plc.tasks()] == ["FastTask", "SlowTask"]


def test_code_runs_from_ram_where_the_board_prefers_it(make_board, build, eventually):
    board = make_board("full")
    with board, Plc(Connection(board.line())) as plc:
        plc.flash(build(COUNTER).path)
        eventually(lambda: plc.read("Main.n") > 20)
        plc.flash(build(TWO_TASKS).path)
        eventually(lambda: plc.read("Slow.n") > 2)
