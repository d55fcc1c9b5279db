"""A board with Modbus on its second UART, as a server and as a client."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from environment import TARGET
from programs import compile_text, program
from pymodbus.client import ModbusTcpClient
from pymodbus.framer import FramerType
from qemu import Board

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.link.connection import Connection
from plctool.link.transports import open_transport, parse_link
from plctool.testing.waiting import eventually

UNIT = 17

SERVER = """
[modbus.server.rs485]
name = "Bus"
port = "COM2"
baud = 115200
parity = "none"
unit = 17
as_bits = true
holding = { 40001 = "Main.setpoint", 40002 = "Main.ratio" }
input = { 30001 = "Main.half" }
"""

TOOLS = SERVER.replace("baud = 115200", "baud = 38400").replace("unit = 17", "unit = 247")

CLIENT = """
[[modbus.rs485]]
port = "COM2"
baud = 115200
parity = "none"
[[modbus.rs485.device]]
name = "Meter"
unit = 17
timeout = "T#500ms"
[[modbus.rs485.device.read]]
function = 3
address = 40001
every = "T#50ms"
var = "Main.ratio"
[[modbus.rs485.device.write]]
function = 6
address = 40010
on_change = true
var = "Main.half_int"
"""

VARIABLES = "VAR setpoint : INT; ratio, half : REAL; half_int : INT; ok : BOOL; END_VAR"


def load(board: Board, folder: Path, description: str, body: str, variables: str = VARIABLES) -> Plc:
    """The program with a description on the board, running."""
    (folder / "bus.io.toml").write_text(description)
    built = compile_text(program(variables, body, "T#10ms"), TARGET, folder)
    plc = Plc(Connection(board.line()), built.path.with_suffix(".sym"))
    plc.flash(built.image)
    return plc


def crc(data: bytes) -> bytes:
    """What follows a frame."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value.to_bytes(2, "little")


class Device:
    """A device at the other end of the UART: `registers`, of which a client reads and writes some."""

    def __init__(self, place: tuple[str, int]) -> None:
        self.registers = bytearray(64)
        self._socket = socket.create_connection(place)
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        with contextlib.suppress(ConnectionError):  # the board is switched off
            self._serve()

    def _serve(self) -> None:
        request = b""
        while data := self._socket.recv(8 - len(request)):
            request += data
            if len(request) < 8:
                continue
            if crc(request[:6]) != request[6:]:
                request = request[1:]  # the board was switched on or off, or we came, in the middle of one
                continue
            start = 2 * int.from_bytes(request[2:4])
            if request[1] == 3:
                size = 2 * int.from_bytes(request[4:6])
                reply = bytes([UNIT, 3, size]) + self.registers[start : start + size]
            else:
                self.registers[start : start + 2] = request[4:6]
                reply = request[:6]
            self._socket.sendall(reply + crc(reply))
            request = b""


def test_board_is_a_server(make_board: Callable[..., Any], tmp_path: Path) -> None:
    board = make_board("modbus")
    board.power_on("host")
    with load(board, tmp_path, SERVER, "half := ratio / 2.0; ok := Bus.ok;") as plc:
        host, port = board.field_bus
        # A frame in which QEMU loses the processor is cut in two, and has no reply.
        client = ModbusTcpClient(host, port=port, framer=FramerType.RTU, timeout=5, retries=10)
        with client:
            assert not client.write_registers(1, [0x4048, 0], device_id=UNIT).isError()  # 3.125
            assert not client.write_register(0, 0x1234, device_id=UNIT).isError()
            eventually(lambda: plc.read("Main.setpoint") == 0x1234 and plc.read("Main.half") == 1.5625)
            assert client.read_input_registers(0, count=2, device_id=UNIT).registers == [0x3FC8, 0]
            assert client.read_coils(0, count=16, device_id=UNIT).bits == [bool(0x1234 >> i & 1) for i in range(16)]
            assert client.read_holding_registers(9, count=1, device_id=UNIT).exception_code == 2
        assert plc.read("Main.ok")


def test_board_is_a_client(make_board: Callable[..., Any], tmp_path: Path) -> None:
    board = make_board("modbus")
    board.power_on("host")
    body = "half := ratio / 2.0; half_int := REAL_TO_INT(half); ok := Meter.ok;"
    with load(board, tmp_path, CLIENT, body) as plc:
        eventually(lambda: plc.read("Meter.errors") >= 2)
        assert not plc.read("Main.ok")
        device = Device(board.field_bus)
        device.registers[0:4] = bytes([0x42, 0xC8, 0, 0])  # 100.0
        eventually(lambda: plc.read("Main.ok") and plc.read("Main.ratio") == 100.0)
        eventually(lambda: device.registers[18:20] == bytes([0, 50]))


def test_a_program_asks_a_device_once(make_board: Callable[..., Any], tmp_path: Path) -> None:
    variables = "VAR read : MODBUS_READ; write : MODBUS_WRITE; words : ARRAY[0..1] OF WORD; ask : BOOL; END_VAR"
    body = """
    read(Execute := ask, Device := 'Meter', Address := 40006, Count := 2, Data := words);
    write(Execute := read.Done, Device := 'Meter', FunctionCode := 6, Address := 40008, Data := words);
    """
    board = make_board("modbus")
    board.power_on("host")
    with load(board, tmp_path, CLIENT[: CLIENT.index("[[modbus.rs485.device.read]]")], body, variables) as plc:
        device = Device(board.field_bus)
        device.registers[10:14] = bytes([0x12, 0x34, 0x56, 0x78])
        ends = [f"Main.{block}.{end}" for block in ("read", "write") for end in ("Done", "Error")]

        def is_done() -> bool:
            """Asks once. A frame in which QEMU loses the processor is cut in two, and has no reply."""
            plc.write({"Main.ask": False})
            eventually(lambda: not any(plc.read(*ends).values()))
            plc.write({"Main.ask": True})
            eventually(lambda: any(plc.read(*ends[1:]).values()))
            return bool(plc.read("Main.write.Done"))

        eventually(is_done)
        assert [plc.read(f"Main.words[{i}]") for i in (0, 1)] == [0x1234, 0x5678]
        assert device.registers[14:16] == bytes([0x12, 0x34])
        assert plc.read("Meter.ok")


def test_the_line_of_the_tool_is_no_field_bus(make_board: Callable[..., Any], tmp_path: Path) -> None:
    """Neither when an application comes over it, nor when the board starts with that application."""
    refusal = "Not used: Bus (IoDrvModbus): the serial line"  # "COM1" is in use: the board's log has short entries
    board = make_board("modbus")
    board.power_on("host")
    own_line = SERVER.replace("COM2", "COM1").replace("unit = 17", "unit = 17\noptional = true")
    with load(board, tmp_path, own_line, "ok := Bus.ok;") as plc:
        assert any(entry.text.startswith(refusal) for entry in plc.log())
    board.power_off()
    board.power_on("host")
    with Plc(Connection(board.line())) as plc:
        assert any(entry.text.startswith(refusal) for entry in plc.log())
        assert plc.status().state == "run"


def test_tools_are_on_the_line_of_the_field_bus(make_board: Callable[..., Any], tmp_path: Path) -> None:
    """Without a server there, with one, and with one that is set up again by the download."""
    board = make_board("modbus-tunnel")
    board.power_on("host")
    host, port = board.field_bus
    with Plc(Connection(open_transport(parse_link(f"modbus:socket://{host}:{port}")))) as plc:
        for number, description in enumerate(["", TOOLS, TOOLS + "# changed\n", ""]):
            folder = tmp_path / str(number)
            folder.mkdir()
            if description:
                (folder / "bus.io.toml").write_text(description)
            built = compile_text(program(VARIABLES, f"half_int := {number} + setpoint;"), TARGET, folder)
            plc.flash(built.path)
            eventually(lambda wanted=number: plc.read("Main.half_int") == wanted)
        folder = tmp_path / "client"
        folder.mkdir()
        (folder / "bus.io.toml").write_text(CLIENT)
        with pytest.raises(DeviceError, match="only a server can be on it"):
            plc.flash(compile_text(program(VARIABLES, "half_int := 9;"), TARGET, folder).path)
        eventually(lambda: plc.read("Main.half_int") == 3)
