"""Outputs of a program are LEDs of the board; a line that the board has not refuses the program."""

from __future__ import annotations

from pathlib import Path

import pytest
from environment import MACHINE, TARGET, firmware
from programs import program
from qemu import Board
from test_headroom import HEADROOM

from plctool.compiler import IoFiles, compile_sources
from plctool.debug.symbols import symbol_path
from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.image.board import read_firmware
from plctool.link.connection import Connection
from plctool.link.transports import make_link
from plctool.port_check import parse_wire
from plctool.port_check.bench import Bench
from plctool.port_check.report import judge
from plctool.port_check.wires import Wires
from plctool.testing.waiting import eventually

LEDS = 0x40028000  # a register of the FPGA that QEMU has
PROGRAM = program(
    "VAR held, dark, pressed, both : BOOL; END_VAR", "held := TRUE; dark := TRUE; both := pressed AND dark;"
)
LINES = """
[gpio]
name = "Board"
[gpio.in]
BUTTON0 = "Main.pressed"
[gpio.out]
LED0 = { var = "Main.held", on_stop = "hold" }
LED1 = { var = "Main.dark", on_stop = 0 }
"""

pytestmark = pytest.mark.skipif(not MACHINE.startswith("mps2"), reason="the lines are those of MPS2 boards")


def build(folder: Path, lines: str, board: str | None = None, device: str = "") -> Path:
    (folder / "main.st").write_text(PROGRAM)
    (folder / "main.io.toml").write_text(lines)
    (folder / "device.toml").write_text(device)
    io = IoFiles(device=folder / "device.toml" if device else None)
    built = compile_sources([folder / "main.st"], target=TARGET, io=io, board=board)
    image = folder / "main.cdl"
    image.write_bytes(built.image)
    built.symbols.save(symbol_path(image))
    return image


@pytest.mark.parametrize("config", ["io", "full"])
def test_outputs_are_the_leds_of_the_board(tmp_path: Path, config: str) -> None:
    image = build(tmp_path, LINES)
    board = Board(MACHINE, firmware(config), tmp_path)

    def leds() -> int:
        return int.from_bytes(board.read_memory(LEDS, 4), "little")

    with board, Plc(Connection(board.line())) as plc:
        plc.flash(image)
        eventually(lambda: leds() == 3)
        assert plc.read("Main.pressed") is False
        assert plc.read("Board.ok") is True
        if config == "full":  # the small one has no services for it
            assert plc.io_devices()[0].state == "ok"
        plc.stop()
        assert leds() == 1
        plc.start()
        eventually(lambda: leds() == 3)
        (tmp_path / "bad").mkdir()
        with pytest.raises(DeviceError, match=r"Board \(IoDrvGpio\): this device has no line LED7"):
            plc.flash(build(tmp_path / "bad", LINES.replace("LED1", "LED7")))
        eventually(lambda: leds() == 3)  # what ran before runs again
        assert plc.stack().unused >= HEADROOM  # the deepest that there is


def test_program_for_another_board_of_the_same_processor_is_refused(tmp_path: Path) -> None:
    """A lamp of its name may be a motor of the other."""
    elf = firmware("full")
    slug = read_firmware(elf).board.slug
    with Board(MACHINE, elf, tmp_path) as board, Plc(Connection(board.line())) as plc:
        plc.flash(build(tmp_path, LINES, board=slug))
        assert plc.io_devices()[0].state == "ok"
        lines = "".join(f"{name} = '{name}'\n" for name in ("LED0", "LED1"))
        other = f"name = 'IO-16'\n[gpio]\nin.BUTTON0 = 'BUTTON0'\n[gpio.out]\n{lines}"
        with pytest.raises(DeviceError, match=r"those of the board IO-16, this is MPS2 AN\d+"):
            plc.flash(build(tmp_path, LINES, device=other))
        eventually(lambda: plc.read("Main.held") is True)  # what ran before goes on


def test_port_check_finds_that_a_wire_is_missing(tmp_path: Path) -> None:
    """QEMU presses no button, so there is none; the check's program runs on the board and says so."""
    with Board(MACHINE, firmware("full"), tmp_path) as board, Plc(Connection(board.line())) as plc:
        link = make_link("serial", "the board's", baud=115200)
        bench = Bench(lambda: Plc(Connection(board.line())), plc, TARGET, tmp_path, link)
        wires = [parse_wire("LED0=BUTTON0"), parse_wire("LED1=BUTTON1")]
        found = [judge(check) for check in Wires(bench, wires, None).checks()]
    assert [(outcome.verdict, outcome.text.partition(" within ")[0]) for outcome in found] == [
        ("failed", "BUTTON0 does not follow LED0"),
        ("failed", "BUTTON1 does not follow LED1"),
    ]
    assert all(outcome.text.endswith("it stays low") and outcome.figures["edges"] == 1 for outcome in found)
