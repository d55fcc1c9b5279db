"""The firmware on its own: it starts, says who it is, and stays reachable."""

from __future__ import annotations

import pytest
from qemu import FACTORY_OFFSET

from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.link.services import AppState


@pytest.mark.parametrize("config", ["minimal", "standard", "full"])
def test_every_configuration_answers_the_name_service(make_board, config):
    board = make_board(config)
    board.power_on()
    with Connection(board.line()) as connection:
        (node,) = connection.scan(10, enough=1)
    assert node.device_name.startswith("MPS2 AN38")


def test_a_fresh_board_has_no_application(plc):
    assert plc.status().state is AppState.NONE


def test_serial_number_is_what_the_factory_wrote(make_board):
    board = make_board()
    board.write_flash(FACTORY_OFFSET, b"SN-4711\0")
    with board, Plc(Connection(board.line())) as plc:
        assert plc.identity().serial_number == "SN-4711"


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
