"""Retain variables of a board with backup RAM: nothing is lost.

RAM of the board in QEMU keeps its content over the reset pin, as backup RAM does over power-off.
"""

from __future__ import annotations

import pytest
from environment import MACHINE
from programs import COUNTER

from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.testing.waiting import eventually

pytestmark = pytest.mark.skipif(MACHINE != "mps2-an386", reason="one board has backup RAM")


def begun_with(plc):
    """The retain variable as it was before the first cycle after the start."""
    eventually(lambda: plc.read("Main.n") > 0)
    values = plc.read("Main.kept", "Main.n")
    return values["Main.kept"] - values["Main.n"]


@pytest.fixture
def board(make_board, build):
    """Runs COUNTER, and saves retain variables in flash once an hour."""
    board = make_board("full")
    board.power_on()
    with Plc(Connection(board.line())) as plc:
        plc.write_file("Settings.cfg", b"[CmpRetain]\nSavePeriod=3600000\n")
    board.power_off()
    board.power_on()
    with Plc(Connection(board.line()), build(COUNTER).path.with_suffix(".sym")) as plc:
        plc.flash(build(COUNTER).path)
    return board


def test_reset_loses_nothing_that_is_in_backup_ram(board, build):
    symbols = build(COUNTER).path.with_suffix(".sym")
    kept = 0
    for _ in range(2):  # the second time from what the first one has brought back
        with Plc(Connection(board.line()), symbols) as plc:
            eventually(lambda at=kept + 1000, plc=plc: plc.read("Main.kept") > at)
            kept = plc.read("Main.kept")
        board.reset()
        with Plc(Connection(board.line()), symbols) as plc:
            assert begun_with(plc) >= kept
            eventually(lambda at=kept + 500, plc=plc: plc.read("Main.kept") > at)
            kept = plc.read("Main.kept")
    board.power_off()  # and the battery is empty
    board.power_on()
    with Plc(Connection(board.line()), symbols) as plc:
        assert begun_with(plc) < kept
