"""A board keeps its starts, stops and exceptions over power-off."""

from __future__ import annotations

import pytest
from environment import MACHINE

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection
from plctool.testing.waiting import eventually

PROGRAM = "PROGRAM Main VAR n : INT := 5; d : INT := 1; END_VAR n := n / d; END_PROGRAM"
CONFIGS = ["plus", "full"] if MACHINE.startswith("mps2") else ["full"] if MACHINE == "virt" else []


@pytest.mark.parametrize("config", CONFIGS)
def test_the_run_before_a_power_off_is_in_the_log(make_board, build, config):
    built = build(PROGRAM)
    with make_board(config) as board:
        with Plc(Connection(board.line()), built.path.with_suffix(".sym")) as plc:
            plc.flash(built.path)
            plc.write({"Main.d": 0})
            eventually(lambda: plc.status().exception is not None)
        board.power_off()
        board.power_on()
        with Plc(Connection(board.line())) as plc:
            kept = plc.log(kept=True)
            assert [entry.text for entry in kept if entry.start == 1][:3] == [
                "Reset: power on",
                f"Application loaded, CRC {plc.status().image_crc:08X}",
                "Application started",
            ]
            assert any("division by zero" in entry.text for entry in kept if entry.start == 1)
            assert any(entry.text == "Reset: power on" for entry in kept if entry.start == 2)
            plc.stop() if plc.status().exception is None else plc.reset("warm")
            assert plc.log(kept[-1].handle, kept=True)


def test_firmware_that_keeps_none_says_what_it_needs(make_board):
    with (
        make_board("standard") as board,
        Plc(Connection(board.line())) as plc,
        pytest.raises(DeviceError, match="Build its firmware with LOG_KEEP"),
    ):
        plc.log(kept=True)
