"""Modbus beside libmodbus and pymodbus, in both roles: requests per second on TCP loopback, and on serial lines as slow
as real ones, with the share of the time in which bytes are on the line. Others take a frame for complete when it has
its length; plcrt and the standard wait for silence."""

from __future__ import annotations

import asyncio
import ctypes
import ctypes.util
import logging
import os
import select
import socket
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from plctool.compiler import compile_sources
from plctool.device import Plc, connect
from plctool.iec.types import UDINT
from plctool.testing.children import ends_with_us
from plctool.testing.plcrt import Plcrt

SECONDS = 2.0  # of each figure
PATIENCE = 20.0  # until a server replies [s]
REGISTERS = 16  # of a request
READS = 8  # of plcrt as a client: so that the next one is due when one is done
UNIT = 1
BITS = 11  # of a byte with parity
FRAMES = 8 + 5 + 2 * REGISTERS  # bytes of a request and its reply on a serial line
SILENCE = 3.5  # bytes after each of both, of the standard, and at least:
LEAST_SILENCE = 0.00175  # [s]
BAUDS = (115200, 19200)
REQUESTS = 32768  # parameter of a device: how many there were
NAMES = [f"r{n}" for n in range(READS)]
PROGRAM = f"""
PROGRAM Main
VAR {", ".join(NAMES)} : ARRAY[1..{REGISTERS}] OF INT; n : INT; END_VAR
n := {" + ".join(f"{name}[1]" for name in NAMES)};
END_PROGRAM
"""

Ask = Callable[[], bool]  # one request; whether it got its reply


def is_tcp(place: str) -> bool:
    return place.startswith("tcp:")


def port_of(place: str) -> int:
    return int(place.removeprefix("tcp:"))


def line_of(place: str) -> tuple[str, int]:
    """Path and speed of a serial line."""
    path, _, baud = place.rpartition("@")
    return path, int(baud)


class Line:
    """A serial line between two pseudo terminals, which know neither speed nor parity: what one side writes at a time
    arrives as a whole, when its last byte would have passed. Context manager."""

    def __init__(self, baud: int) -> None:
        self._byte_time = BITS / baud
        self._pairs = [os.openpty(), os.openpty()]
        for _, slave in self._pairs:
            tty.setraw(slave)
        self.near, self.far = (f"{os.ttyname(slave)}@{baud}" for _, slave in self._pairs)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._carry, daemon=True)

    def __enter__(self) -> Line:
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._end.set()
        self._thread.join()
        for fd in (fd for pair in self._pairs for fd in pair):
            os.close(fd)

    def _carry(self) -> None:
        (near, _), (far, _) = self._pairs
        while not self._end.is_set():
            for ready in select.select([near, far], [], [], 0.05)[0]:
                begin = time.monotonic()
                data = os.read(ready, 4096)
                time.sleep(max(0.0, begin + len(data) * self._byte_time - time.monotonic()))
                os.write(far if ready == near else near, data)


# ---- libmodbus ----


def libmodbus() -> ctypes.CDLL:
    """The C library. Raises OSError when it is not installed."""
    library = ctypes.CDLL(ctypes.util.find_library("modbus") or "libmodbus.so.5")
    for name in ("modbus_new_tcp", "modbus_new_rtu", "modbus_mapping_new"):
        getattr(library, name).restype = ctypes.c_void_p
    return library


def context(library: ctypes.CDLL, place: str) -> ctypes.c_void_p:
    if is_tcp(place):
        found = ctypes.c_void_p(library.modbus_new_tcp(b"127.0.0.1", port_of(place)))
    else:
        path, baud = line_of(place)
        found = ctypes.c_void_p(library.modbus_new_rtu(path.encode(), baud, ctypes.c_char(b"N"), 8, 1))
    library.modbus_set_slave(found, UNIT)
    return found


def serve_libmodbus(place: str) -> None:
    library = libmodbus()
    server = context(library, place)
    mapping = ctypes.c_void_p(library.modbus_mapping_new(0, 0, REGISTERS, 0))
    request = (ctypes.c_uint8 * 260)()
    if is_tcp(place):
        listening = ctypes.c_int(library.modbus_tcp_listen(server, 1))
    else:
        library.modbus_connect(server)
    while True:
        if is_tcp(place):
            library.modbus_tcp_accept(server, ctypes.byref(listening))
        while (size := library.modbus_receive(server, request)) >= 0:
            if size > 0:
                library.modbus_reply(server, request, size, mapping)


@contextmanager
def asked_by_libmodbus(place: str) -> Iterator[Ask]:
    library = libmodbus()
    client, found = context(library, place), (ctypes.c_uint16 * REGISTERS)()
    end = time.monotonic() + PATIENCE
    while library.modbus_connect(client) != 0:  # until the server listens
        assert time.monotonic() < end, place
        time.sleep(0.05)
    yield lambda: library.modbus_read_registers(client, 0, REGISTERS, found) == REGISTERS
    library.modbus_close(client)
    library.modbus_free(client)


# ---- pymodbus ----


def serve_pymodbus(place: str) -> None:
    from pymodbus.server import ModbusSerialServer, ModbusTcpServer
    from pymodbus.simulator import DataType, SimData, SimDevice

    async def serve() -> None:
        device = SimDevice(UNIT, simdata=[SimData(0, count=REGISTERS, values=0, datatype=DataType.REGISTERS)])
        server: Any
        if is_tcp(place):
            server = ModbusTcpServer([device], address=("127.0.0.1", port_of(place)))
        else:
            path, baud = line_of(place)
            server = ModbusSerialServer([device], port=path, baudrate=baud)
        await server.serve_forever()

    asyncio.run(serve())


@contextmanager
def asked_by_pymodbus(place: str) -> Iterator[Ask]:
    from pymodbus.client import ModbusSerialClient, ModbusTcpClient

    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # that a server is not there yet
    client: Any
    if is_tcp(place):
        client = ModbusTcpClient("127.0.0.1", port=port_of(place))
    else:
        path, baud = line_of(place)
        client = ModbusSerialClient(path, baudrate=baud, timeout=1)
    end = time.monotonic() + PATIENCE
    while not client.connect():
        assert time.monotonic() < end, place
        time.sleep(0.05)
    yield lambda: not client.read_holding_registers(0, count=REGISTERS, device_id=UNIT).isError()
    client.close()


# ---- plcrt ----


def server_description(place: str) -> str:
    held = f'holding = {{ 40001 = "Main.{NAMES[0]}" }}\n'
    if is_tcp(place):
        return f'[modbus.server.tcp]\nname = "Other"\naddress = "127.0.0.1"\nport = {port_of(place)}\n{held}'
    path, baud = line_of(place)
    return f'[modbus.server.rs485]\nname = "Other"\nport = "{path}"\nbaud = {baud}\nunit = {UNIT}\n{held}'


def client_description(place: str) -> str:
    path, baud = ("", 0) if is_tcp(place) else line_of(place)
    kind = "tcp" if is_tcp(place) else "rs485"
    where = f'host = "127.0.0.1"\nport = {port_of(place)}' if is_tcp(place) else f'port = "{path}"\nbaud = {baud}'
    reads = "".join(
        f'[[modbus.{kind}.device.read]]\nfunction = 3\naddress = 40001\nevery = "T#1ms"\nvar = "Main.{name}"\n'
        for name in NAMES
    )
    return f'[[modbus.{kind}]]\n{where}\n[[modbus.{kind}.device]]\nname = "Other"\nunit = {UNIT}\n{reads}'


@contextmanager
def plcrt(description: str) -> Iterator[Plc]:
    """A plcrt that runs with this description."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "bench.st").write_text(PROGRAM)
        (folder / "bench.io.toml").write_text(description)
        image = folder / "bench.cdl"
        compile_sources([folder]).write(image)
        with Plcrt(folder / "plc.flash", "--tcp", "0") as process, connect(f"tcp:{process.tcp}") as plc:
            plc.flash(image)
            yield plc


# ---- figures ----


@contextmanager
def other_server(kind: str, place: str) -> Iterator[None]:
    command = ends_with_us([sys.executable, __file__, kind, place])
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.kill()
        process.wait()


def rate(ask: Ask) -> float:
    """Requests per second of a client that has nothing else to do."""
    end = time.monotonic() + PATIENCE
    while not ask():  # a server may not be there yet
        assert time.monotonic() < end
    count, begin = 0, time.monotonic()
    while (now := time.monotonic()) < begin + SECONDS:
        count += ask()
    return count / (now - begin)


def rate_of_plcrt(plc: Plc) -> float:
    """The same of plcrt as a client, which counts."""

    def count() -> int:
        return int(plc.io_read_parameter("Other", REQUESTS, UDINT))

    end = time.monotonic() + PATIENCE
    while not plc.read("Other.ok"):
        assert time.monotonic() < end
        time.sleep(0.05)
    first, begin = count(), time.monotonic()
    time.sleep(SECONDS)
    return (count() - first) / (time.monotonic() - begin)


def as_server(kind: str, server: str, client: str) -> float:
    """`server`, `client`: the place of each, which is another one on a serial line."""
    served = plcrt(server_description(server)) if kind == "plcrt" else other_server(kind, server)
    with served, asked_by_libmodbus(client) as ask:
        return rate(ask)


def as_client(kind: str, server: str, client: str) -> float:
    with other_server("libmodbus", server):
        if kind == "plcrt":
            with plcrt(client_description(client)) as plc:
                return rate_of_plcrt(plc)
        with (asked_by_libmodbus if kind == "libmodbus" else asked_by_pymodbus)(client) as ask:
            return rate(ask)


def shown(requests: float, baud: int) -> str:
    return f"{requests:7,.0f} {100 * requests * FRAMES * BITS / baud:4.0f} %" if baud else f"{requests:7,.0f}       "


def most(baud: int) -> str:
    """What the standard allows, which ends a frame by silence."""
    byte_time = BITS / baud
    return shown(1 / (FRAMES * byte_time + 2 * max(SILENCE * byte_time, LEAST_SILENCE)), baud)


def figure(role: Callable[[str, str, str], float], kind: str, baud: int) -> str:
    if baud:
        with Line(baud) as line:
            return shown(role(kind, line.near, line.far), baud)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        place = f"tcp:{free.getsockname()[1]}"
    return shown(role(kind, place, place), 0)


def main() -> None:
    print(f"\nModbus on this machine: requests of {REGISTERS} registers per second, and their share of a serial line")
    try:
        libmodbus()
    except OSError:
        print("  left out: libmodbus is not installed (apt-get install libmodbus5)")
        return
    kinds = ("plcrt", "libmodbus", "pymodbus")
    print(f"  {'':<26}" + "".join(f"{kind:>16}" for kind in (*kinds, "the standard")))
    for name, role in (("server", as_server), ("client", as_client)):
        for baud in (0, *BAUDS):
            what = f"{name}, {f'{baud} bit/s' if baud else 'TCP loopback'}"
            figures = [figure(role, kind, baud) for kind in kinds] + ([most(baud)] if baud else [])
            print(f"  {what:<26}" + "".join(f"{each:>16}" for each in figures), flush=True)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        {"libmodbus": serve_libmodbus, "pymodbus": serve_pymodbus}[sys.argv[1]](sys.argv[2])
    else:
        main()
