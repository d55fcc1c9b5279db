"""The programs of can-utils, which engineers have, on one bus with controllers and plctool. See `run`."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from nodes import NODES

import plctool
from plctool.core import lib
from plctool.link.transports import parse_link

TOOL = 200  # an address that plctool has not, because it begins elsewhere
PATIENCE = "20000"  # [ms]
LISTEN_PATIENCE = 60.0  # [s]
FLASHED = 1999, 3  # index and value of an element of the program

pytestmark = pytest.mark.skipif(shutil.which("candump") is None, reason="there is no can-utils: make test-vcan")


def interface_of(bus: str) -> str:
    return parse_link(bus).place.partition(":")[2]


def identifier(target: int, source: int) -> int:
    return lib.CAN_ID_BASE | target << lib.CAN_TARGET_SHIFT | source


def listeners(interface: str) -> int:
    """How many filters the kernel has for frames of an interface."""
    lines = [line.split() for file in Path("/proc/net/can").glob("rcvlist_*") for line in file.read_text().splitlines()]
    return sum(words[:1] == [interface] for words in lines)


def wait_for_listener(interface: str, before: int) -> None:
    """Until there is one more; candump does not say when it listens."""
    end = time.monotonic() + LISTEN_PATIENCE
    while listeners(interface) <= before:
        assert time.monotonic() < end, "candump does not listen"
        time.sleep(0.01)


@contextmanager
def started(*command: str | Path, output: Path | None = None) -> Iterator[subprocess.Popen[bytes]]:
    """A program that runs beside; ends with the block."""
    with (output or Path("/dev/null")).open("wb") as file:
        process = subprocess.Popen(command, stdout=file, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def test_a_scan_that_is_typed_is_answered_by_all(bus: str, tmp_path: Path) -> None:
    interface = interface_of(bus)
    answers = f"{interface},{identifier(TOOL, 0):08X}:{identifier(0xFF, 0):08X}"
    dump = ["candump", "-L", "-n", str(len(NODES)), "-T", PATIENCE, answers]
    before = listeners(interface)
    with subprocess.Popen(dump, stdout=subprocess.PIPE, text=True) as listening:
        wait_for_listener(interface, before)
        request = f"{identifier(lib.CAN_TO_ALL, TOOL):08X}#{lib.CAN_FRAME_SCAN:02X}0A000401020304"
        subprocess.run(["cansend", interface, request], check=True)
        frames = [line.split()[2] for line in listening.communicate()[0].splitlines()]
    assert {int(frame.partition("#")[0], 16) & lib.CAN_ADDRESS_MASK for frame in frames} == set(NODES)


def test_a_program_is_flashed_while_others_send(bus: str, image: Path) -> None:
    """500 random frames a second, with standard identifiers, which go before all of ours."""
    interface = interface_of(bus)
    with (
        started("cangen", interface, "-g", "2", "-I", "r", "-L", "8") as noise,
        plctool.connect(bus + "2") as plc,
    ):
        plc.flash(image, force=True)
        index, value = FLASHED
        assert plc.read(f"Main.t[{index}]") == value
        assert noise.poll() is None


def test_a_download_that_was_recorded_and_is_played_again_changes_nothing(
    bus: str, image: Path, tmp_path: Path
) -> None:
    interface = interface_of(bus)
    log = tmp_path / "flash.log"
    before = listeners(interface)
    with started("candump", "-L", interface, output=log):
        wait_for_listener(interface, before)
        with plctool.connect(bus + "1") as plc:
            plc.flash(image, force=True)
    frames = log.read_text().count("\n")
    assert frames > 30
    with plctool.connect(bus + "1") as plc:
        plc.write({"Main.count": 1_000_000})
        subprocess.run(["canplayer", "-t", "-I", log], check=True, stdout=subprocess.DEVNULL)
        assert plc.read("Main.count") >= 1_000_000
        assert plc.status().state == "run"
