"""The firmware on its own: it starts, says who it is, and stays reachable."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from environment import MACHINE, eventually
from programs import program
from qemu import FACTORY_OFFSET

from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.link.services import AppState

MAIN_WATCHDOG_MS = 20_000  # see main.c
IS_MPS2 = MACHINE.startswith("mps2")


@pytest.mark.parametrize("config", ["minimal", "standard", "full"])
def test_every_configuration_answers_the_name_service(make_board, config):
    board = make_board(config)
    board.power_on()
    with Connection(board.line()) as connection:
        (node,) = connection.scan(10, enough=1)
    assert node.device_name.startswith("MPS2 AN" if IS_MPS2 else "LM3S6965")


def test_a_fresh_board_has_no_application(plc):
    assert plc.status().state is AppState.NONE


@pytest.mark.skipif(not IS_MPS2, reason="the factory writes it elsewhere")
def test_serial_number_is_what_the_factory_wrote(make_board):
    board = make_board()
    board.write_flash(FACTORY_OFFSET, b"SN-4711\0")
    with board, Plc(Connection(board.line())) as plc:
        assert plc.identity().serial_number == "SN-4711"


@pytest.mark.skipif(IS_MPS2, reason="a board without Ethernet")
def test_serial_number_is_the_ethernet_address(plc):
    assert plc.identity().serial_number == "525400123456"  # QEMU's, unless told otherwise


def test_first_start_is_logged_as_power_on(plc):
    assert "Reset: power on" in [entry.text for entry in plc.log()]


def test_reset_is_logged_as_such(board):
    with Plc(Connection(board.line())) as plc:
        plc.status()
    board.reset()
    with Plc(Connection(board.line())) as plc:
        assert "Reset: reset pin" in [entry.text for entry in plc.log()]


def test_noise_on_the_line_is_ignored(board):
    line = board.line()
    line.send_raw(bytes(range(256)) * 20)
    with Plc(Connection(line)) as plc:
        assert plc.status().state is AppState.NONE


def test_large_messages_arrive_whole(board):
    from plctool.link.services import echo
    from plctool.link.session import Session

    with Connection(board.line()) as connection:
        session = Session(connection)
        data = bytes(i * 7 % 251 for i in range(700))
        for _ in range(5):
            assert echo(session, data) == data


def test_main_loop_kicks_the_hardware_watchdog(make_board, build):
    board = make_board()
    board.power_on("exact")
    with Plc(Connection(board.line())) as plc:
        plc.flash(build(program("VAR n : DINT; END_VAR", "n := n + 1;", "T#20ms")).path)
        eventually(lambda: plc.read("Main.n") * 20 > MAIN_WATCHDOG_MS + 5_000)
        assert [entry.text for entry in plc.log() if "Reset" in entry.text] == ["Reset: power on"]


def processor_time(board) -> float:
    """Seconds that QEMU has used of the host's processors."""
    fields = Path(f"/proc/{board.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_processor_sleeps_while_there_is_nothing_to_do(board):
    with Plc(Connection(board.line())) as plc:
        plc.status()
    begin, before = time.monotonic(), processor_time(board)
    time.sleep(1.0)
    assert processor_time(board) - before < 0.5 * (time.monotonic() - begin)
