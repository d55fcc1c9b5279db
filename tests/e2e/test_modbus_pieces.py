"""Modbus of a real plcrt on lines whose hardware hands over frames in pieces, with pauses that are longer than the
silence between frames: an FTDI adapter each 16 ms, a 16550A groups of 8 bytes."""

from __future__ import annotations

import os
import select
import struct
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

import plctool
from plctool.compiler import compile_sources
from plctool.device import Plc
from plctool.link.modbus import modbus_crc
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

PROGRAM = """
PROGRAM Main
VAR read : ARRAY[0..29] OF INT; written : ARRAY[0..29] OF INT; n : DINT; END_VAR
n := n + 1;
END_PROGRAM
"""
DESCRIPTION = """
[[modbus.rs485]]
port = "{client}"
baud = 19200
[[modbus.rs485.device]]
name = "Meter"
unit = 3
timeout = "T#10s"
[[modbus.rs485.device.read]]
function = 3
address = 40001
every = "T#100ms"
vars = ["Main.read"]
[modbus.server.rs485]
port = "{server}"
baud = 19200
unit = 7
holding = {{ 40001 = "Main.written" }}
"""
COUNT = 30
PIECES = [(8, 0.006), (27, 0.016)]  # bytes, and the pause after them [s]


class Line:
    """A pseudo terminal; `name` is the end of plcrt."""

    def __init__(self) -> None:
        self.end, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.name = os.ttyname(self._slave)

    def read(self, pause: float) -> bytes:
        """What comes until there is such a pause [s]."""
        data = b""
        while select.select([self.end], [], [], pause)[0]:
            data += os.read(self.end, 4096)
        return data

    def write(self, frame: bytes, size: int, pause: float) -> None:
        """Pieces of a frame."""
        for at in range(0, len(frame), size):
            if at:
                time.sleep(pause)
            os.write(self.end, frame[at : at + size])

    def close(self) -> None:
        os.close(self.end)
        os.close(self._slave)


class Meter:
    """The device at the end of a line: its registers count from `first`. Context manager."""

    def __init__(self, line: Line) -> None:
        self.first, self.pieces = 0, PIECES[0]
        self._line, self._over = line, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Meter:
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.is_set():
            if self._line.read(0.01)[:2] == bytes([3, 3]):
                registers = struct.pack(f">{COUNT}H", *range(self.first, self.first + COUNT))
                reply = bytes([3, 3, len(registers)]) + registers
                self._line.write(reply + modbus_crc(reply), *self.pieces)


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Plc, Meter, Line]]:
    folder: Path = tmp_path_factory.mktemp("pieces")
    lines = [Line(), Line()]
    (folder / "main.st").write_text(PROGRAM)
    (folder / "main.io.toml").write_text(DESCRIPTION.format(client=lines[0].name, server=lines[1].name))
    image = folder / "main.cdl"
    compile_sources([folder / "main.st"]).write(image)
    with Meter(lines[0]) as meter, Plcrt(folder / "flash") as plcrt, plctool.connect(f"serial:{plcrt.port}") as plc:
        plc.flash(image)
        yield plc, meter, lines[1]
    for line in lines:
        line.close()


@pytest.mark.parametrize("pieces", PIECES)
def test_reply_in_pieces_is_taken(plant: tuple[Plc, Meter, Line], pieces: tuple[int, float]) -> None:
    plc, meter, _ = plant
    meter.first, meter.pieces = meter.first + 1000, pieces
    eventually(lambda: plc.read("Meter.ok") and plc.read("Main.read[29]") == meter.first + 29)
    assert plc.read("Meter.errors") == 0


@pytest.mark.parametrize("pieces", PIECES)
def test_request_in_pieces_is_served(plant: tuple[Plc, Meter, Line], pieces: tuple[int, float]) -> None:
    """A busy machine may keep the pieces apart for so long that the request is given up: then it is made again."""
    plc, _, line = plant
    data = struct.pack(f">{COUNT}H", *range(pieces[0], pieces[0] + COUNT))
    request = bytes([7, 16, 0, 0, 0, COUNT, len(data)]) + data
    reply = request[:6] + modbus_crc(request[:6])

    def asks() -> bool:
        line.write(request + modbus_crc(request), *pieces)
        return line.read(0.5) == reply

    eventually(asks)
    eventually(lambda: plc.read("Main.written[29]") == pieces[0] + 29)
