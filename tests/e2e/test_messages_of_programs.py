"""What a program on plcrt adds to the log; the rest of the promise is in tests/logging_programs.py."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from logging_programs import PROGRAM, Logging

from plctool import connect
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually


@pytest.fixture
def plc(plcrt: Plcrt, tmp_path: Path, tool) -> Iterator[Plc]:
    image = tool.build("logging", PROGRAM)
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        yield plc


class TestPlcrt(Logging):
    pass


def test_log_command_shows_messages_of_the_program(plc: Plc, plcrt: Plcrt, tool) -> None:
    plc.write({"Main.step": 1})
    eventually(lambda: "warning    IecLog: pump is dry\n" in tool("log", "--tcp", plcrt.tcp).out)
