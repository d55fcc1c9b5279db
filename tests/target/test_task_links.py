"""Values that go from task to task on a board; the promise is in tests/task_links.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from task_links import PROGRAM, TaskLinks

from plctool.device import Plc
from plctool.link.connection import Connection


class TestBoard(TaskLinks):
    @pytest.fixture
    def plc(self, make_board, build):
        with make_board("standard") as board, Plc(Connection(board.line())) as plc:
            plc.flash(build(PROGRAM).path)
            yield plc
