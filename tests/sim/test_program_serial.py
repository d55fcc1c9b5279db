"""What a program does with a serial port in the simulator; the rest of the promise is in tests/serial_programs.py."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from serial_programs import FUNCTIONS, PROGRAM, ProgramSerial, check_functions

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.controller import Controller
from plctool.errors import DeviceError
from plctool.sim import Simulator


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> BuildResult:
    path = tmp_path_factory.mktemp("program") / "app.st"
    path.write_text(PROGRAM)
    return compile_sources([path])


@pytest.fixture
def plc(built: BuildResult) -> Iterator[Simulator]:
    with Simulator(built.image, built.symbols) as simulator:
        yield simulator


class TestSimulator(ProgramSerial):
    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        assert isinstance(plc, Simulator)
        for _ in range(2000):
            if condition():
                return
            plc.run_cycles(1)
        raise AssertionError("the program does not come to an end")

    def exchange(self, plc: Controller, data: bytes, size: int) -> bytes:
        assert isinstance(plc, Simulator)
        plc.serial_send(1, data)
        plc.run_for(1000)
        return plc.serial_receive(1)

    def wait_stopped(self, plc: Controller) -> None:
        assert isinstance(plc, Simulator)
        plc.run_for(100)


def test_bytes_for_a_port_that_is_not_open_are_refused(plc: Simulator) -> None:
    with pytest.raises(DeviceError, match="the program has to open it"):
        plc.serial_send(1, b"x")


def test_functions_of_syslibcom_exchange_bytes(tmp_path: Path) -> None:
    source = tmp_path / "functions.st"
    source.write_text(FUNCTIONS)
    with Simulator.from_sources(source) as plc:
        test = TestSimulator()
        check_functions(
            plc, lambda condition: test.wait(plc, condition), lambda data, size: test.exchange(plc, data, size)
        )
