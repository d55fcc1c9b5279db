"""Alarms on a board; the rest of the promise is in tests/alarms.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from alarms import EACH_CYCLE, PROGRAM, Alarms, check_one_moment

from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.testing.waiting import eventually

CUTS = 8


class TestBoard(Alarms):
    @pytest.fixture
    def plc(self, make_board, build):
        with make_board("full") as board, Plc(Connection(board.line())) as plc:
            plc.flash(build(PROGRAM).path)
            yield plc


def test_power_cuts_leave_the_history_of_one_moment(make_board, build):
    """Later and later after the start, so also while it is saved."""
    board, program = make_board("full"), build(EACH_CYCLE)
    board.power_on()
    with Plc(Connection(board.line())) as plc:
        plc.flash(program.path)
        check_one_moment(plc)
        plc.stop()  # saves
        saved = plc.alarm_history().count
    board.power_off()
    for cut in range(CUTS):
        board.power_on()
        with Plc(Connection(board.line())) as plc:
            if cut == 0:
                plc.start()
            count = check_one_moment(plc)
            assert count >= saved
            eventually(lambda plc=plc, least=count + 60 + 23 * cut: plc.read("Main.events") > least)
            board.power_off()
    assert count > saved + 24
