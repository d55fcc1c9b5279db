"""Retain variables of a board with backup RAM, and with a supply monitor: nothing is lost.

RAM of the board in QEMU keeps its content over the reset pin, as backup RAM does over power-off. QEMU's test interface
sets the line that leads from the supply monitor to the processor.
"""

from __future__ import annotations

import socket

import pytest
from environment import MACHINE
from programs import COUNTER

from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.testing.waiting import eventually

pytestmark = pytest.mark.skipif(MACHINE != "mps2-an386", reason="one board has backup RAM and a supply monitor")
SUPPLY_LINE = 6


def begun_with(plc):
    """The retain variable as it was before the first cycle after the start."""
    eventually(lambda: plc.read("Main.n") > 0)
    values = plc.read("Main.kept", "Main.n")
    return values["Main.kept"] - values["Main.n"]


def set_line(board, number):
    """Sets an interrupt line of the processor, and takes it back."""
    with socket.socket(socket.AF_UNIX) as test:
        test.connect(str(board.folder / "qtest"))
        for level in (1, 0):
            test.sendall(f"set_irq_in /machine/armv7m unnamed-gpio-in {number} {level}\n".encode())
            assert test.recv(100).startswith(b"OK")


@pytest.fixture
def board(make_board, build):
    """Runs COUNTER, and saves retain variables in flash once an hour."""
    board = make_board("full")
    board.starts_from += ["-qtest", "unix:qtest,server=on,wait=off", "-qtest-log", "none"]
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


def test_interrupt_of_the_supply_monitor_saves_into_flash_before_the_power_is_gone(board, build):
    symbols = build(COUNTER).path.with_suffix(".sym")
    with Plc(Connection(board.line()), symbols) as plc:
        eventually(lambda: plc.read("Main.kept") > 1000)
        set_line(board, SUPPLY_LINE)
        eventually(lambda: str(plc.status().state) == "stop")
        kept = plc.read("Main.kept")
        said = [entry.text for entry in plc.log() if "The power fails" in entry.text]
    assert len(said) == 1 and int(said[0].split()[-2]) <= 50, said  # ms
    board.power_off()
    board.power_on()
    with Plc(Connection(board.line()), symbols) as plc:
        assert begun_with(plc) == kept
