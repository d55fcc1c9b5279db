"""What a program on plcrt forbids; the rest of the promise is in tests/forbidding.py."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from forbidding import PROGRAM, Forbidding

from plctool import connect
from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually


@pytest.fixture
def image(tmp_path: Path, tool) -> Path:
    (tmp_path / "forbidding.st").write_text(PROGRAM)
    tool.ok("build", "forbidding.st", "-o", "forbidding.cdl")
    return tmp_path / "forbidding.cdl"


@pytest.fixture
def plc(plcrt: Plcrt, image: Path) -> Iterator[Plc]:
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        yield plc


class TestPlcrt(Forbidding):
    pass


def test_the_tool_says_what_is_forbidden_and_by_whom(plc: Plc, plcrt: Plcrt, tool) -> None:
    plc.write({"Main.lock[2]": True, "Main.lock[4]": True})
    eventually(lambda: len(plc.status().forbidden) == 2)
    link = ["--tcp", plcrt.tcp]
    assert "forbidden by the program: stop, write\n" in tool("status", *link).out
    done = tool("stop", *link)
    refusal = "the running program forbids it (PlcOperationControlInstance), as status shows (ERR_OPERATION_DENIED)"
    assert (done.status, done.err) == (1, f"plctool: The device refused the stop: {refusal}.\n")
    with pytest.raises(DeviceError, match="refused the write: the running program forbids it"):
        plc.write({"Main.n": 5})


def test_power_off_and_on_forbids_again_what_the_program_does(plc: Plc, plcrt: Plcrt, image: Path, tool) -> None:
    """It is the program that forbids, so it also ends with a start that the program does not forbid in."""
    plc.write({"Main.lock[7]": True})
    eventually(lambda: plc.status().forbidden)
    plcrt.stop()
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as again:
        eventually(lambda: str(again.status().state) == "run")
        assert again.status().forbidden == []
        again.stop()
