"""A gateway in this process before a fake controller on a virtual clock, at the socket where tools look for it."""

from __future__ import annotations

import os
import socket
import struct
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fake_device import FakeDevice, FakeLine, FakePlc
from small_app import make_application

import plctool
from plctool.core import lib
from plctool.debug.symbols import symbol_path
from plctool.device import Plc
from plctool.gateway.client import GatewayConnection, connect_gateway
from plctool.gateway.frames import PROTOCOL, Frame, Kind, Pipe, document_frame
from plctool.gateway.place import Place, find_place
from plctool.gateway.server import Gateway
from plctool.link.connection import Connection
from plctool.link.transports import make_link, parse_link

PORT = "/dev/no-such-line"
BAUD = 115200
PATIENCE = 30.0


def answer_on(pipe: Pipe) -> Frame:
    """The next frame that says more than that a request waits for its turn."""
    while (frame := pipe.receive(PATIENCE)).kind is Kind.WAIT:
        pass
    return frame


class Served:
    """A controller with an application, the gateway that owns its line, and tools that use it."""

    def __init__(self, folder: Path) -> None:
        self.place: Place = find_place(PORT)
        self.plc = FakePlc()
        self.plc.image, self.symbols = make_application()
        self.device = FakeDevice(self.plc.handle)
        self.line = FakeLine(self.device)
        self.line.name = PORT
        self.image = folder / "small.cdl"
        self.image.write_bytes(self.plc.image)
        symbol_path(self.image).write_text(self.symbols.to_json())
        self._open: list[GatewayConnection | Plc | Pipe] = []
        self.start()

    def start(self, idle: float = 1e6) -> None:
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(str(self.place.socket))
        listener.listen()
        listener.setblocking(False)
        self.gateway = Gateway(Connection(self.line), listener, link=parse_link(f"serial:{PORT}"), idle=idle)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        self.gateway.run()
        self.place.socket.unlink()
        self.gateway.end()

    @property
    def has_ended(self) -> bool:
        return not self._thread.is_alive()

    def tool(self, words: str = "a tool", baud: int = BAUD) -> GatewayConnection:
        """A connection of a tool, below the session."""
        connection = connect_gateway(make_link("serial", PORT, baud=baud), words)
        self._open.append(connection)
        return connection

    def connect(self, words: str = "a tool") -> Plc:
        """A tool as Python programs see it."""
        plc = plctool.connect(f"serial:{PORT}", symbols=symbol_path(self.image), tool=words)
        self._open.append(plc)
        return plc

    def guest(self, **hello: Any) -> Pipe:
        """What has a socket and may do anything with it. It says hello unless `hello` is None."""
        pipe = self.stranger()
        document = {
            "protocol": PROTOCOL,
            "scheme": "serial",
            "baud": BAUD,
            "pid": os.getpid(),
            "tool": "a guest",
            "patience": 1,
            **hello,
        }
        pipe.send(document_frame(Kind.HELLO, 1, document), PATIENCE)
        assert pipe.receive(PATIENCE).kind is Kind.DONE
        return pipe

    def stranger(self) -> Pipe:
        """A socket that has said nothing yet."""
        connected = socket.socket(socket.AF_UNIX)
        connected.connect(str(self.place.socket))
        pipe = Pipe(connected)
        self._open.append(pipe)
        return pipe

    def answer(self, answer: Callable[[bytes], bytes]) -> None:
        """A function gives the device's replies to messages that no service of it takes."""
        begin = struct.pack("<H", lib.L7_PROTOCOL)
        self.device.handler = lambda m: self.plc.handle(m) if m.startswith(begin) else answer(m)

    def call(self, pipe: Pipe, op: str, number: int = 7, **arguments: Any) -> Frame:
        """Asks as a guest; the answer."""
        pipe.send(document_frame(Kind.CALL, number, {"op": op, **arguments}), PATIENCE)
        return answer_on(pipe)

    def close(self) -> None:
        for tool in self._open:
            tool.close()
        self.gateway.stop("The test is over.", "over")
        self._thread.join(PATIENCE)


class Gate:
    """A handler of a fake device that holds a request until it is released."""

    def __init__(self, handler: Callable[[bytes], bytes]) -> None:
        self.handler = handler
        self.closed = threading.Event()  # set when a request has come to it
        self._open = threading.Event()

    def __call__(self, message: bytes) -> bytes:
        self.closed.set()
        assert self._open.wait(PATIENCE)
        return self.handler(message)

    def open(self) -> None:
        self._open.set()
