"""Outputs of a program are LEDs of the board; a line that the board has not refuses the program."""

from __future__ import annotations

from pathlib import Path

import pytest
from environment import MACHINE, TARGET, eventually, firmware
from programs import program
from qemu import Board
from test_headroom import HEADROOM

from plctool.compiler import IoFiles, compile_sources
from plctool.debug.symbols import symbol_path
from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection

LEDS = 0x40028000  # a register of the FPGA that QEMU has
PROGRAM = program(
    "VAR held, dark, pressed, both : BOOL; END_VAR", "held := TRUE; dark := TRUE; both := pressed AND dark;"
)
LINES = """
[gpio.in]
BUTTON0 = "Main.pressed"
[gpio.out]
LED0 = { var = "Main.held", on_stop = "hold" }
LED1 = { var = "Main.dark", on_stop = 0 }
"""

pytestmark = pytest.mark.skipif(not MACHINE.startswith("mps2"), reason="the lines are those of MPS2 boards")


def build(folder: Path, lines: str) -> Path:
    (folder / "main.st").write_text(PROGRAM)
    (folder / "main.io.toml").write_text(lines)
    built = compile_sources([folder / "main.st"], target=TARGET, io=IoFiles(device=None))
    image = folder / "main.cdl"
    image.write_bytes(built.image)
    built.symbols.save(symbol_path(image))
    return image


def test_outputs_are_the_leds_of_the_board(tmp_path: Path) -> None:
    image = build(tmp_path, LINES)
    board = Board(MACHINE, firmware("full"), tmp_path)

    def leds() -> int:
        return int.from_bytes(board.read_memory(LEDS, 4), "little")

    with board, Plc(Connection(board.line())) as plc:
        plc.flash(image)
        eventually(lambda: leds() == 3)
        assert plc.read("Main.pressed") is False
        assert plc.io_devices()[0].state == "ok"
        plc.stop()
        assert leds() == 1
        plc.start()
        eventually(lambda: leds() == 3)
        (tmp_path / "bad").mkdir()
        with pytest.raises(DeviceError, match=r"gpio \(IoDrvGpio\): this device has no line LED7"):
            plc.flash(build(tmp_path / "bad", LINES.replace("LED1", "LED7")))
        eventually(lambda: leds() == 3)  # what ran before runs again
        assert plc.stack().unused >= HEADROOM  # the deepest that there is
