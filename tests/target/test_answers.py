"""A board of which QEMU has the processor and the serial line, but not the flash: it answers, and a download ends in
the error of a flash that does not work."""

from __future__ import annotations

import pytest
from programs import COUNTER

from plctool.device import Plc
from plctool.errors import PlcError
from plctool.link.connection import Connection
from plctool.link.services import AppState, echo
from plctool.link.session import Session


@pytest.mark.parametrize("config", ["minimal", "standard", "full"])
def test_every_configuration_answers_the_name_service(make_board, config):
    board = make_board(config)
    board.power_on()
    with Connection(board.line()) as connection:
        (node,) = connection.scan(60, enough=1)
    assert node.device_name == "STM32F405"


def test_large_messages_arrive_whole(board):
    with Connection(board.line()) as connection:
        session = Session(connection)
        data = bytes(i * 7 % 251 for i in range(700))
        for _ in range(5):
            assert echo(session, data) == data


def test_a_download_without_a_working_flash_is_refused(plc, build):
    with pytest.raises(PlcError) as refused:
        plc.flash(build(COUNTER).path)
    assert "ERR_DEVICE" in str(refused.value)
    assert plc.status().state is AppState.NONE


def test_first_start_is_logged_as_power_on(board):
    with Plc(Connection(board.line())) as plc:
        assert "Reset: power on" in [entry.text for entry in plc.log()]
