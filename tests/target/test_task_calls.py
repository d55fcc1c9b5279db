"""What a program on a board asks about its tasks; the rest of the promise is in tests/task_calls.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from environment import firmware
from task_calls import PROGRAM, TaskWatchdogs

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection

CONFIGS = [config for config in ("full", "plus") if firmware(config).exists()]


class TestBoard(TaskWatchdogs):
    LOOPS = 20_000_000

    @pytest.fixture(params=CONFIGS)
    def plc(self, request, make_board, build):
        with make_board(request.param) as board, Plc(Connection(board.line())) as plc:
            plc.flash(build(PROGRAM).path)
            yield plc


def test_a_firmware_that_does_not_tell_refuses_the_program(make_board, build):
    with (
        make_board("standard") as board,
        Plc(Connection(board.line())) as plc,
        pytest.raises(DeviceError, match="task_value"),
    ):
        plc.flash(build(PROGRAM).path)


LEVEL = """
VAR_GLOBAL go : BOOL; END_VAR
PROGRAM Main
END_PROGRAM
CONFIGURATION C
    TASK Level(LEVEL := go);
    PROGRAM One WITH Level : Main;
END_CONFIGURATION
"""


def test_a_firmware_without_level_tasks_refuses_them_instead_of_running_them_at_edges(make_board, build):
    with (
        make_board("standard") as board,
        Plc(Connection(board.line())) as plc,
        pytest.raises(DeviceError, match="Task Level has the unknown kind 4"),
    ):
        plc.flash(build(LEVEL).path)
