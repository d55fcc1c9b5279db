"""SIGPWR: retain variables are saved at once, so that the loss of power after it loses nothing."""

from __future__ import annotations

import os
import signal

import pytest

from plctool import connect
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

PROGRAM = """
PROGRAM Main
VAR RETAIN total : DINT; END_VAR
total := total + 1;
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC
    TASK Main(INTERVAL := T#1ms, PRIORITY := 1);
    PROGRAM Main WITH Main : Main;
END_RESOURCE END_CONFIGURATION
"""


@pytest.mark.parametrize("supervised", [True, False])
def test_what_was_counted_before_sigpwr_survives_the_loss_of_power(plcrt: Plcrt, tool, supervised: bool) -> None:
    image = tool.build("counting", PROGRAM)
    plcrt.stop()
    plcrt.options = ("--tcp", "0") if supervised else ("--tcp", "0", "--no-supervisor")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        eventually(lambda: plc.read("Main.total") > 100)
        assert plcrt.process
        os.kill(plcrt.process.pid, signal.SIGPWR)
        eventually(lambda: str(plc.status().state) == "stop")
        total = plc.read("Main.total")
        assert any("The power fails: program stopped and values saved in" in entry.text for entry in plc.log())
    plcrt.stop(signal.SIGKILL)
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        assert str(plc.status().state) == "run"
        assert plc.read("Main.total") >= total


def test_the_program_runs_again_if_the_power_stays(plcrt: Plcrt, tool) -> None:
    image = tool.build("counting", PROGRAM)
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        assert plcrt.process
        os.kill(plcrt.process.pid, signal.SIGPWR)
        eventually(lambda: str(plc.status().state) == "stop")
        eventually(lambda: str(plc.status().state) == "run")
        assert any("The power is back" in entry.text for entry in plc.log())
