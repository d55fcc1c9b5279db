"""Functions that events call, on plcrt; the rest of the promise is in tests/event_functions.py."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from event_functions import PROGRAM, REGISTERED, EndlessFunctions, check_registered

from plctool import connect
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually


@pytest.fixture
def image(tmp_path: Path, tool) -> Path:
    return Path(tool.build("events", PROGRAM))


@pytest.fixture
def plc(plcrt: Plcrt, image: Path) -> Iterator[Plc]:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        yield plc


class TestPlcrt(EndlessFunctions):
    pass


def test_power_off_and_on_calls_functions_of_start_and_stop(plc: Plc, plcrt: Plcrt) -> None:
    plcrt.stop()
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as again:
        eventually(lambda: again.read("Main.n") > 0)
        assert again.read("heard[1]", "heard[2]", "heard[3]") == {"heard[1]": 1, "heard[2]": 1, "heard[3]": 0}


def test_functions_that_the_program_registers_are_called(plc: Plc, tool) -> None:
    plc.flash(Path(tool.build("registered", REGISTERED)))

    def run() -> None:
        eventually(lambda: not plc.read("Main.take") and not plc.read("Main.back"))

    check_registered(plc, run)
