"""Breakpoints on a board; what they promise is in tests/breakpoints.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

import breakpoints
from breakpoints import FILE, Breaking
from environment import TARGET

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection


@pytest.fixture
def plc(make_board, tmp_path):
    with make_board("full") as board, Plc(Connection(board.line())) as plc:
        plc.flash(breakpoints.build(tmp_path, target=TARGET))
        try:
            plc.breakpoints.list()
        except DeviceError as error:
            pytest.skip(str(error))
        yield plc


class TestBoard(Breaking):
    target = TARGET


def test_a_firmware_without_breakpoints_says_so(make_board, build):
    with make_board("standard") as board, Plc(Connection(board.line())) as plc:
        plc.flash(build("PROGRAM Main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM").path)
        with pytest.raises(DeviceError, match="not supported on this device"):
            plc.breakpoints.set(FILE, 1)
