"""Online changes on a board; the rest of the promise is in tests/changing.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from changing import BODY, Changing, program
from conftest import TARGET
from environment import MACHINE
from online_programs import built

from plctool.core import lib
from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection
from plctool.testing.waiting import eventually


class TestBoard(Changing):
    target = TARGET

    @pytest.fixture
    def plc(self, make_board, tmp_path):
        result = built(tmp_path, program(), None, TARGET)
        with make_board("full") as board, Plc(Connection(board.line())) as plc:
            plc.add_symbols(result.symbols)
            plc.flash(result.image)
            yield plc


def every_ms(text):
    return text.replace("T#5ms", "T#1ms")


def test_ten_changes_lose_no_cycle_of_a_task_of_1_ms(make_board, tmp_path):
    """A cycle that is due and does not begin would be an overrun, and the program would count less than its task.

    The clock counts instructions: with others, a busy host that lets QEMU wait makes the timers late.
    """
    first = built(tmp_path, every_ms(program()), None, TARGET)
    board = make_board("full")
    board.power_on("exact")
    with Plc(Connection(board.line())) as plc:
        plc.add_symbols(first.symbols)
        plc.flash(first.image)
        for n in range(10):
            result = built(tmp_path, every_ms(program(f"{BODY} fixed := {n};")), plc.symbols(), TARGET)
            plc.add_symbols(result.symbols)
            plc.change(result.image)
        before = plc.read("Main.n")
        eventually(lambda: plc.read("Main.n") > before)
        plc.stop()
        (task,) = plc.tasks()
        assert task.overruns == 0
        assert plc.read("Main.n") == task.cycles > before


def test_power_off_right_after_a_change_keeps_retain_values(make_board, tmp_path):
    first = built(tmp_path, program(), None, TARGET)
    board = make_board("full")
    with board, Plc(Connection(board.line())) as plc:
        plc.add_symbols(first.symbols)
        plc.flash(first.image)
        plc.write({"Main.kept": 123})
        second = built(tmp_path, program("n := n - 1;"), first.symbols, TARGET)
        plc.add_symbols(second.symbols)
        plc.change(second.image)
        plc.write({"Main.kept": 123})
    with board, Plc(Connection(board.line())) as plc:
        plc.add_symbols(second.symbols)
        assert plc.status().image_crc == second.crc
        eventually(lambda: plc.read("Main.n") < 0)
        assert plc.read("Main.kept") == 123


LINES = """
[gpio]
name = "Board"
[gpio.in]
BUTTON0 = "Main.pressed"
[gpio.out]
LED0 = "Main.on"
LED1 = { var = "Main.blinks", on_stop = 0 }
"""
LEDS = 0x40028000  # a register of the FPGA


@pytest.mark.skipif(not MACHINE.startswith("mps2"), reason="the lines are those of MPS2 boards")
def test_lines_of_the_board_stay_as_they_are(make_board, tmp_path):
    (tmp_path / "board.io.toml").write_text(LINES)
    variables = "VAR pressed, on, blinks : BOOL; n : DINT; END_VAR"
    text = program("on := TRUE; n := n + 1;", variables, "")
    first = built(tmp_path, text, None, TARGET)
    with make_board("full") as board, Plc(Connection(board.line())) as plc:

        def leds():
            return int.from_bytes(board.read_memory(LEDS, 4), "little")

        plc.add_symbols(first.symbols)
        plc.flash(first.image)
        eventually(lambda: leds() == 1)
        for n in range(3):
            result = built(tmp_path, text.replace("n + 1;", f"n + {n + 2}; blinks := {n} > 0;"), plc.symbols(), TARGET)
            assert result.change.problems == []
            plc.add_symbols(result.symbols)
            plc.change(result.image)
            assert leds() & 1
            eventually(lambda n=n: leds() == (3 if n else 1))
            assert plc.read("Board.ok") and plc.io_devices()[0].state == "ok"
        plc.stop()
        assert leds() == 0


TWO_TASKS = """PROGRAM Main VAR n : DINT; END_VAR
n := n + 1;
END_PROGRAM
PROGRAM Other VAR n : DINT; END_VAR n := n + 1; END_PROGRAM
CONFIGURATION Config RESOURCE Res ON PLC
    TASK Fast(INTERVAL := T#5ms, PRIORITY := 1);
    TASK Slow(INTERVAL := T#7ms, PRIORITY := 9);
    PROGRAM Main WITH Fast : Main;
    PROGRAM Other WITH Slow : Other;
END_RESOURCE END_CONFIGURATION
"""


def test_a_change_during_a_step_of_another_tool_lets_all_tasks_go_on(make_board, tmp_path):
    first = built(tmp_path, TWO_TASKS, None, TARGET)
    second = built(tmp_path, TWO_TASKS.replace("n + 1;\n", "n + 2;\n"), first.symbols, TARGET)
    with make_board("full") as board, Plc(Connection(board.line())) as plc:
        plc.add_symbols(first.symbols)
        plc.add_symbols(second.symbols)
        plc.flash(first.image)
        debugger = plc.breakpoints
        debugger.set("program.st", 2)
        assert debugger.wait(20) is not None
        debugger.clear_all()
        target = debugger._target
        target.attach(keep=True)
        target.go(lib.BP_STEP, target.status().serial)  # to no line, so that it does not end
        plc._debugger = None  # of another tool
        plc.change(second.image)
        before = plc.read("Other.n")
        eventually(lambda: plc.read("Other.n") > before)


def test_a_firmware_without_online_change_says_so(make_board, tmp_path):
    text = "PROGRAM Main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM"
    first = built(tmp_path, text, None, TARGET)
    second = built(tmp_path, text.replace("n + 1", "n + 2"), first.symbols, TARGET)
    with make_board("standard") as board, Plc(Connection(board.line())) as plc:
        plc.add_symbols(first.symbols)
        plc.flash(first.image)
        with pytest.raises(DeviceError, match="knows no online change"):
            plc.change(second.image)
        assert plc.status().image_crc == first.crc
