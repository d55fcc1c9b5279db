"""Traces on a board; what they promise is in tests/tracing.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from tracing import PROGRAM, Tracing

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection


class TestBoard(Tracing):
    @pytest.fixture
    def plc(self, make_board, build):
        with make_board("full") as board, Plc(Connection(board.line())) as plc:
            plc.flash(build(PROGRAM).path)
            yield plc


def test_a_firmware_that_cannot_trace_says_so(make_board, build):
    with make_board("standard") as board, Plc(Connection(board.line())) as plc:
        plc.flash(build("PROGRAM Main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM").path)
        with pytest.raises(DeviceError, match="TRACE_BUFFER"):
            plc.trace(["Main.n"])
