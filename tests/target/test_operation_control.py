"""What a program on a board forbids; the rest of the promise is in tests/forbidding.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from forbidding import PROGRAM, Forbidding

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection


class TestBoard(Forbidding):
    @pytest.fixture
    def image(self, build):
        return build(PROGRAM).path

    @pytest.fixture
    def plc(self, make_board, image):
        with make_board("full") as board, Plc(Connection(board.line())) as plc:
            plc.flash(image)
            yield plc


def test_a_firmware_that_cannot_forbid_refuses_the_program(make_board, build):
    with (
        make_board("standard") as board,
        Plc(Connection(board.line())) as plc,
        pytest.raises(DeviceError, match="operation_control"),
    ):
        plc.flash(build(PROGRAM).path)
