"""The other side of Modbus: devices of pymodbus, and a serial line between two programs that a test can pull."""

from __future__ import annotations

import asyncio
import os
import select
import threading
import tty
from collections.abc import Coroutine
from typing import Any

from pymodbus.framer import FramerType
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

REGISTERS = 64


class Wire:
    """A serial line between two pseudo terminals, `plc` and `other`. Context manager; `pulled`: nothing passes."""

    def __init__(self) -> None:
        self._pairs = [os.openpty(), os.openpty()]
        for _, slave in self._pairs:
            tty.setraw(slave)
        self.plc, self.other = (os.ttyname(slave) for _, slave in self._pairs)
        self.pulled = False
        self.flipped = False  # a bit of each first byte
        self.absent: set[int] = set()  # units that requests do not reach
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Wire:
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._end.set()
        self._thread.join()
        for fd in (fd for pair in self._pairs for fd in pair):
            os.close(fd)

    def _read(self, end: int) -> bytearray:
        """All that comes without a pause: a frame that arrives in two pieces is two broken ones."""
        data = bytearray()
        while select.select([end], [], [], 0.002 if data else 0)[0]:
            data += os.read(end, 4096)
        return data

    def _run(self) -> None:
        (near, _), (far, _) = self._pairs
        others = {near: far, far: near}
        while not self._end.is_set():
            for ready in select.select([near, far], [], [], 0.05)[0]:
                data = self._read(ready)
                if self.flipped and data:
                    data[0] ^= 0x10
                if not self.pulled and not (data and data[0] in self.absent):
                    os.write(others[ready], data)


class Devices:
    """Devices of pymodbus on one line: `memory[unit]` are the registers of each, which are its coils, too (bit n is bit
    n % 16 of register n // 16). Context manager; may be entered again."""

    def __init__(
        self,
        units: list[int],
        *,
        tcp: int = 0,
        serial: str = "",
        baud: int = 19200,
        rtu: bool = False,
        host: str = "127.0.0.1",
    ) -> None:
        self._host = host
        self._units, self._tcp, self._serial, self._baud = units, tcp, serial, baud
        self._framer = FramerType.RTU if rtu else FramerType.SOCKET  # on TCP
        self.memory: dict[int, list[int]] = {}
        self.requests: list[tuple[int, int]] = []  # unit and function of each

    def __enter__(self) -> Devices:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._server = self._do(self._begin())
        return self

    def __exit__(self, *exc: object) -> None:
        self._do(self._server.shutdown())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def _do(self, what: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(what, self._loop).result(20)

    async def _begin(self) -> Any:
        devices = [self._device(unit) for unit in self._units]
        server: Any
        if self._serial:
            # One that is alone has to leave requests to others unanswered.
            server = ModbusSerialServer(devices, port=self._serial, baudrate=self._baud, ignore_missing_devices=True)
        else:
            address = (self._host, self._tcp)
            server = ModbusTcpServer(devices, framer=self._framer, address=address, ignore_missing_devices=True)
        await server.serve_forever(background=True)
        return server

    def _device(self, unit: int) -> SimDevice:
        async def note(function: int, start: int, address: int, count: int, registers: list[int], values: Any) -> None:
            self.requests.append((unit, function))
            if unit not in self.memory:
                self.memory[unit] = registers

        values = SimData(0, count=REGISTERS, values=0, datatype=DataType.REGISTERS)
        return SimDevice(unit, simdata=[values], use_bit_addressing=True, action=note)

    def count(self, unit: int) -> int:
        """Requests to a device so far."""
        return sum(asked == unit for asked, _ in self.requests)
