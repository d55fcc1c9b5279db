"""A Modbus client that keeps sending requests to a real plcrt and reads no reply."""

from __future__ import annotations

import select
import socket
import struct
import time
from contextlib import suppress
from pathlib import Path

from free_ports import free_port
from processes import processor_ns

import plctool
from plctool.compiler import compile_sources
from plctool.testing.plcrt import Plcrt

PROGRAM = """
PROGRAM Main
VAR table : ARRAY[0..124] OF INT; END_VAR
END_PROGRAM
"""
DESCRIPTION = """
[modbus.server.tcp]
address = "127.0.0.1"
port = {port}
holding = {{ 40001 = "Main.table" }}
"""
REQUESTS = struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, 0, 125) * 5000
PATIENCE = 60  # of one that is never dropped [s]
BUSY_SHARE = 0.2  # of a processor


def dial(port: int) -> socket.socket:
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    client.settimeout(20)
    client.connect(("127.0.0.1", port))
    client.setblocking(False)
    return client


def test_client_that_reads_nothing_costs_next_to_nothing_and_is_dropped(tmp_path: Path) -> None:
    port = free_port()
    (tmp_path / "main.st").write_text(PROGRAM)
    (tmp_path / "main.io.toml").write_text(DESCRIPTION.format(port=port))
    image, at = tmp_path / "main.cdl", 0
    compile_sources([tmp_path / "main.st"]).write(image)
    with Plcrt(tmp_path / "flash") as plcrt, plctool.connect(f"serial:{plcrt.port}") as plc:
        plc.flash(image)
        with dial(port) as client, suppress(ConnectionError):
            writable = select.poll()
            writable.register(client, select.POLLOUT)
            while True:
                at = (at + client.send(REQUESTS[at:])) % len(REQUESTS)
                used, since = processor_ns(plcrt.worker), time.monotonic_ns()
                assert writable.poll(PATIENCE * 1000), "it is never dropped"
        assert processor_ns(plcrt.worker) - used < BUSY_SHARE * (time.monotonic_ns() - since)
