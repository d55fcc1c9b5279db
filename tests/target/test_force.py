"""Forced variables on a board; the rest of the promise is in tests/forcing.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from forcing import PROGRAM, Forcing

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection


class TestBoard(Forcing):
    @pytest.fixture
    def plc(self, make_board, build):
        with make_board("full") as board, Plc(Connection(board.line())) as plc:
            plc.flash(build(PROGRAM).path)
            yield plc


def test_power_off_ends_it(make_board, build):
    board = make_board("full")
    for has_forced in (False, True):
        with board, Plc(Connection(board.line())) as plc:
            plc.flash(build(PROGRAM).path)
            assert plc.forced() == {}
            if not has_forced:
                plc.force({"Main.n": 5})


def test_a_firmware_that_cannot_force_says_so(make_board, build):
    with make_board("standard") as board, Plc(Connection(board.line())) as plc:
        plc.flash(build("PROGRAM Main VAR n : DINT; END_VAR n := n + 1; END_PROGRAM").path)
        with pytest.raises(DeviceError, match="FORCE_MAX"):
            plc.force({"Main.n": 5})
        assert plc.sample(["Main.n"]).forced == []
