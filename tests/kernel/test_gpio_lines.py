"""plcrt and the lines of a real kernel: inputs, outputs, edges that start a task, lines that others have. See `run`."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.testing.waiting import eventually

CONFIG = Path("/sys/kernel/config/gpio-sim")
LINES = ("START", "DOOR", "MOTOR", "LAMP")

pytestmark = pytest.mark.skipif(not CONFIG.exists(), reason="there is no gpio-sim: make test-kernel")

PROGRAM = """\
VAR_GLOBAL start : BOOL; door : BOOL; motor : BOOL; lamp : BOOL; starts : DINT; END_VAR
PROGRAM Main motor := start AND NOT door; lamp := door; END_PROGRAM
PROGRAM Count starts := starts + 1; END_PROGRAM
CONFIGURATION C
    RESOURCE R ON PLC
        TASK Fast(INTERVAL := T#5ms, PRIORITY := 1);
        TASK Edge(EVENT := 'started', PRIORITY := 2);
        PROGRAM Main WITH Fast : Main;
        PROGRAM Count WITH Edge : Count;
    END_RESOURCE
END_CONFIGURATION
"""
DESCRIPTION = """\
[gpio.in]
START = { var = "start", event = "started" }
DOOR = { var = "door", invert = true }
[gpio.out]
MOTOR = { var = "motor", on_stop = 0 }
LAMP = { var = "lamp", on_stop = "hold" }
"""

EVENT_PROGRAM = """\
VAR_GLOBAL start : BOOL; starts : DINT; END_VAR
PROGRAM Count IF start THEN starts := starts + 1; END_IF; END_PROGRAM
CONFIGURATION C
    RESOURCE R ON PLC
        TASK Edge(EVENT := 'started', PRIORITY := 2);
        PROGRAM Count WITH Edge : Count;
    END_RESOURCE
END_CONFIGURATION
"""
EVENT_DESCRIPTION = """\
[gpio.in]
START = { var = "start", event = "started" }
"""

# Another process that has an input line of a chip until its standard input ends: struct gpio_v2_line_request.
OTHER = """
import fcntl, os, struct, sys
request = bytearray(592)
struct.pack_into("<I", request, 0, int(sys.argv[2]))
request[256:261] = b"other"
struct.pack_into("<Q", request, 288, 4)
struct.pack_into("<I", request, 560, 1)
fcntl.ioctl(os.open("/dev/" + sys.argv[1], os.O_RDWR), 0xC250B407, request)
print("ready", flush=True)
sys.stdin.read()
"""


class Chip:
    """A chip of the kernel with LINES, and what is outside of it: wires that pull its inputs, lamps at its outputs."""

    def __init__(self) -> None:
        self.folder = CONFIG / "plc"
        self.bank = self.folder / "bank"
        self.bank.mkdir(parents=True)
        (self.bank / "num_lines").write_text(str(len(LINES)))
        for number, name in enumerate(LINES):
            line = self.bank / f"line{number}"
            line.mkdir()
            (line / "name").write_text(name)
        self.plug()

    def plug(self) -> None:
        (self.folder / "live").write_text("1")
        self.name = (self.bank / "chip_name").read_text().strip()
        device = (self.folder / "dev_name").read_text().strip()
        self.lines = Path("/sys/devices/platform") / device / self.name
        eventually(lambda: Path("/dev", self.name).exists())

    def unplug(self) -> None:
        (self.folder / "live").write_text("0")

    def pull(self, name: str, up: bool) -> None:
        (self._line(name) / "pull").write_text("pull-up" if up else "pull-down")

    def level(self, name: str) -> int:
        return int((self._line(name) / "value").read_text())

    def _line(self, name: str) -> Path:
        return self.lines / f"sim_gpio{LINES.index(name)}"

    def remove(self) -> None:
        self.unplug()
        for number in range(len(LINES)):
            (self.bank / f"line{number}").rmdir()
        self.bank.rmdir()
        self.folder.rmdir()


@pytest.fixture
def chip() -> Iterator[Chip]:
    chip = Chip()
    yield chip
    chip.remove()


def test_inputs_outputs_and_stop(chip: Chip, plc: Plc, image: Path) -> None:
    chip.pull("START", False)
    chip.pull("DOOR", True)
    plc.flash(image)
    assert (chip.level("MOTOR"), chip.level("LAMP")) == (0, 0)
    chip.pull("START", True)
    eventually(lambda: chip.level("MOTOR") == 1)
    chip.pull("DOOR", False)  # inverted: it is open
    eventually(lambda: (chip.level("MOTOR"), chip.level("LAMP")) == (0, 1))
    chip.pull("DOOR", True)
    eventually(lambda: (chip.level("MOTOR"), chip.level("LAMP")) == (1, 0))
    chip.pull("DOOR", False)
    eventually(lambda: chip.level("LAMP") == 1)
    plc.stop()
    assert (chip.level("MOTOR"), chip.level("LAMP")) == (0, 1)


def test_each_edge_starts_the_task_once(chip: Chip, plc: Plc, image: Path) -> None:
    chip.pull("START", False)
    plc.flash(image)
    eventually(lambda: plc.read("start") is False)
    before = plc.read("starts")
    for number in range(1, 6):
        chip.pull("START", True)
        eventually(lambda count=before + number: plc.read("starts") == count)
        chip.pull("START", False)
        eventually(lambda: plc.read("start") is False)
    assert plc.read("starts") == before + 5  # falling edges start nothing


def test_line_of_another_process_refuses_the_program_by_name(chip: Chip, plc: Plc, image: Path) -> None:
    command = [sys.executable, "-c", OTHER, chip.name, str(LINES.index("DOOR"))]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdin and other.stdout
        assert other.stdout.readline() == "ready\n"
        with pytest.raises(DeviceError, match="line DOOR is in use by something else"):
            plc.flash(image)
        other.stdin.close()
    plc.flash(image)  # it is free again


def test_chip_that_is_pulled_is_lost_and_comes_back(chip: Chip, plc: Plc, image: Path) -> None:
    chip.pull("START", True)
    chip.pull("DOOR", True)
    plc.flash(image)
    eventually(lambda: chip.level("MOTOR") == 1)
    chip.unplug()
    eventually(lambda: plc.io_devices()[0].state != "ok")
    chip.plug()
    chip.pull("START", True)
    chip.pull("DOOR", True)
    eventually(lambda: plc.io_devices()[0].state == "ok")
    eventually(lambda: chip.level("MOTOR") == 1)


def test_chip_that_only_posts_events_is_lost_and_comes_back(chip: Chip, plc: Plc, event_image: Path) -> None:
    chip.pull("START", False)
    plc.flash(event_image)
    chip.pull("START", True)
    eventually(lambda: plc.read("starts") == 1)
    chip.unplug()
    eventually(lambda: plc.io_devices()[0].state != "ok")
    chip.plug()
    chip.pull("START", False)
    eventually(lambda: plc.io_devices()[0].state == "ok")
    chip.pull("START", True)
    eventually(lambda: plc.read("starts") == 2)
