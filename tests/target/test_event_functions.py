"""Functions that events call, on a board; the rest of the promise is in tests/event_functions.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from environment import firmware
from event_functions import PROGRAM, EndlessFunctions

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection

CONFIGS = [config for config in ("full", "plus") if firmware(config).exists()]


class TestBoard(EndlessFunctions):
    @pytest.fixture
    def image(self, build):
        return build(PROGRAM).path

    @pytest.fixture(params=CONFIGS)
    def plc(self, request, make_board, image):
        with make_board(request.param) as board, Plc(Connection(board.line())) as plc:
            plc.flash(image)
            yield plc


def test_a_firmware_without_events_refuses_the_program(make_board, build):
    with (
        make_board("standard") as board,
        Plc(Connection(board.line())) as plc,
        pytest.raises(DeviceError, match="event_answer"),
    ):
        plc.flash(build(PROGRAM).path)
