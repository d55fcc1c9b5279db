"""What a program on a board adds to the log; the rest of the promise is in tests/logging_programs.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from logging_programs import PROGRAM, Logging

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection


class TestBoard(Logging):
    @pytest.fixture
    def plc(self, make_board, build):
        with make_board("full") as board, Plc(Connection(board.line())) as plc:
            plc.flash(build(PROGRAM).path)
            yield plc


def test_a_firmware_that_takes_no_messages_refuses_the_program(make_board, build):
    with (
        make_board("standard") as board,
        Plc(Connection(board.line())) as plc,
        pytest.raises(DeviceError, match="log_add"),
    ):
        plc.flash(build(PROGRAM).path)
