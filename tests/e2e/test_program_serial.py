"""What a program on plcrt does with a serial port; the rest of the promise is in tests/serial_programs.py."""

from __future__ import annotations

import os
import pty
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from serial_programs import FUNCTIONS, PROGRAM, ProgramSerial, check_functions

from plctool import connect
from plctool.cli.main import main
from plctool.controller import Controller
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually


class TestPlcrt(ProgramSerial):
    @pytest.fixture
    def plc(self, plcrt: Plcrt, tool) -> Iterator[Plc]:
        image = tool.build("serial", PROGRAM)
        self.line, device = pty.openpty()
        name = os.ttyname(device)
        os.close(device)
        plcrt.stop()
        plcrt.options = ("--tcp", "0", "--com", name)
        plcrt.start()
        with connect(f"tcp:{plcrt.tcp}") as plc:
            plc.flash(image)
            yield plc
        os.close(self.line)

    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        eventually(condition)

    def exchange(self, plc: Controller, data: bytes, size: int) -> bytes:
        os.write(self.line, data)
        came = b""
        while len(came) < size:
            came += os.read(self.line, size)
        return came

    def test_functions_of_syslibcom_exchange_bytes(self, plc: Plc, tmp_path: Path) -> None:
        source = tmp_path / "functions.st"
        source.write_text(FUNCTIONS)
        assert main(["build", str(source), "-o", str(source.with_suffix(".cdl"))]) == 0
        plc.flash(source.with_suffix(".cdl"))
        check_functions(plc, eventually, lambda data, size: self.exchange(plc, data, size))
