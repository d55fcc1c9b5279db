"""What a program on a board does with files; the rest of the promise is in tests/file_programs.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

from file_programs import PROGRAM, ProgramFiles

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection

SMALL = "PROGRAM Main VAR size : FILE.GetSize; END_VAR size(sFileName := 'a', xExecute := TRUE); END_PROGRAM"


class TestBoard(ProgramFiles):
    @pytest.fixture
    def plc(self, make_board, build):
        with make_board("full") as board, Plc(Connection(board.line())) as plc:
            plc.flash(build(PROGRAM).path)
            yield plc


def test_a_firmware_without_files_refuses_the_program(make_board, build):
    with (
        make_board("standard") as board,
        Plc(Connection(board.line())) as plc,
        pytest.raises(DeviceError, match="file_call"),
    ):
        plc.flash(build(SMALL).path)
