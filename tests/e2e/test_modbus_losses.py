"""Devices on the network that close, refuse, restart or reply as another one, and what plcrt says of them."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from free_ports import free_port

import plctool
from plctool.compiler import compile_sources
from plctool.core import lib
from plctool.device import Plc
from plctool.iec.types import UDINT
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

PROGRAM = """
PROGRAM Main
VAR level : INT; speed : INT := 11; run : BOOL := TRUE; good, bad : UDINT; END_VAR
IF level = 7 AND Drive.ok THEN good := good + 1; ELSIF good > 0 THEN bad := bad + 1; END_IF
END_PROGRAM
"""
DESCRIPTION = """
[[modbus.tcp]]
host = "127.0.0.1"
port = {port}
retries = 3
[[modbus.tcp.device]]
name = "Drive"
unit = 1
timeout = "T#500ms"
read = [ {{ function = 3, address = 40001, every = "T#20ms", var = "Main.level", on_error = "zero" }} ]
write = [
    {{ function = 6, address = 40011, on_change = true, var = "Main.speed" }},
    {{ function = 5, address = 11, on_change = true, var = "Main.run" }},
]
"""


class Drive:
    """A device with register 0 = 7. `habit`: what it does with requests. Context manager, which may be entered again:
    then it has lost what was written."""

    def __init__(self, port: int) -> None:
        self._port = port
        self.habit = "well"
        self.written: dict[tuple[int, int], int] = {}
        self.writes = 0

    def __enter__(self) -> Drive:
        self.written = {}
        self._connections: list[socket.socket] = []
        self._listener = socket.create_server(("127.0.0.1", self._port))
        threading.Thread(target=self._accept, args=(self._listener,), daemon=True).start()
        return self

    def __exit__(self, *exc: object) -> None:
        for one in (self._listener, *self._connections):
            with_shutdown(one)

    def _accept(self, listener: socket.socket) -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            self._connections.append(connection)
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        try:
            while len(head := connection.recv(7, socket.MSG_WAITALL)) == 7:
                pdu = connection.recv(struct.unpack(">H", head[4:6])[0] - 1, socket.MSG_WAITALL)
                if not self._reply(connection, head, pdu):
                    break
        except OSError:
            pass
        with_shutdown(connection)

    def _reply(self, connection: socket.socket, head: bytes, pdu: bytes) -> bool:
        """False: it closes the connection."""
        if self.habit in ("hangs up", "mute"):
            return self.habit == "mute"
        function, address, value = struct.unpack(">BHH", pdu[:5])
        if function in (5, 6):
            self.written[function, address] = value
            self.writes += 1
        reply = struct.pack(">BBH", 3, 2, 7) if function == 3 else pdu
        unit = b"\x09" if self.habit == "unit 9" else head[6:]
        size = len(reply) + (7 if self.habit == "too short" else 1)
        transaction = b"\xff\xff" if self.habit == "transaction" else head[:2]
        connection.sendall(transaction + head[2:4] + struct.pack(">H", size) + unit + reply)
        return self.habit != "closes"


def with_shutdown(one: socket.socket) -> None:
    with suppress(OSError):
        one.shutdown(socket.SHUT_RDWR)
    one.close()


@contextmanager
def running(folder: Path, drive: Drive, port: int) -> Iterator[Plc]:
    (folder / "main.st").write_text(PROGRAM)
    (folder / "main.io.toml").write_text(DESCRIPTION.format(port=port))
    compile_sources([folder / "main.st"]).write(folder / "main.cdl")
    with drive, Plcrt(folder / "flash") as plcrt, plctool.connect(f"serial:{plcrt.port}") as plc:
        plc.flash(folder / "main.cdl")
        eventually(lambda: plc.read("Drive.ok"))
        yield plc


def test_the_log_says_what_came_in_place_of_a_reply(tmp_path: Path) -> None:
    port = free_port()
    drive = Drive(port)
    with running(tmp_path, drive, port) as plc:
        for habit, words in (
            ("unit 9", "it replies as unit 9"),
            ("transaction", "its replies are not to what was asked"),
            ("too short", "its replies are incomplete"),
            ("hangs up", "it closes the connection"),
            ("mute", "it does not reply"),
        ):
            drive.habit = habit
            eventually(lambda words=words: any(f"Drive is lost: {words}" in e.text for e in plc.log()))  # type: ignore[misc]
            eventually(lambda: not plc.read("Drive.ok"))
            drive.habit = "well"
            eventually(lambda: plc.read("Drive.ok"))
        drive.__exit__()
        eventually(lambda: any("Drive is lost: no connection to it" in e.text for e in plc.log()))


def test_a_device_that_closes_after_each_reply_is_well(tmp_path: Path) -> None:
    port = free_port()
    drive = Drive(port)
    drive.habit = "closes"
    with running(tmp_path, drive, port) as plc:
        eventually(lambda: plc.read("Main.good") >= 300)
        assert plc.io_read_parameter("Drive", int(lib.MODBUS_PARAM_TIMEOUTS), UDINT) == 0
        assert drive.writes < 20


@pytest.mark.parametrize("down_s", [0.0, 0.2, 0.7])
def test_a_device_that_restarts_gets_its_outputs_again(tmp_path: Path, down_s: float) -> None:
    port = free_port()
    drive = Drive(port)
    with running(tmp_path, drive, port):
        outputs = {(6, 10): 11, (5, 10): 0xFF00}
        eventually(lambda: drive.written == outputs)
        drive.__exit__()
        threading.Event().wait(down_s)  # as long as it takes to restart
        drive.__enter__()
        eventually(lambda: drive.written == outputs)
