"""Modbus servers of others with the same memory and behaviour: pymodbus and libmodbus. Each has one unit, and four
tables of WORDS words, 16 bits of coils and discrete inputs in each.

A request whose first word is TRAP + n, or a bit of it, is refused with exception n.
"""

from __future__ import annotations

import asyncio
import ctypes
import os
import select
import threading
from collections.abc import Callable, Coroutine
from typing import Any, Protocol

from modbus_clients import Place, libmodbus_context, libmodbus_library
from pymodbus.constants import ExcCodes
from pymodbus.pdu import ExceptionResponse, ModbusPDU
from pymodbus.pdu.device import ModbusControlBlock
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

WORDS = 1024
TRAP = 800
MOST_EXCEPTION = 11
TABLES = {"coils": (1, 5, 15), "discrete": (2,), "holding": (3, 6, 16, 22, 23), "inputs": (4,)}
TABLE_OF = {function: table for table, functions in TABLES.items() for function in functions}


def first_words(table: str) -> list[int]:
    """What a table has before it is written."""
    seed = list(TABLES).index(table)
    return [(257 * i + 4099 * seed + 13) & 0xFFFF for i in range(WORDS)]


def trap(function: int, address: int) -> int:
    """The exception that a request is refused with, 0: none."""
    table = TABLE_OF.get(function, "")
    word = address // 16 if table in ("coils", "discrete") else address
    return word - TRAP if table and TRAP < word <= TRAP + MOST_EXCEPTION else 0


class Server(Protocol):
    """A context manager."""

    refused: set[int]  # functions

    def __enter__(self) -> Server: ...

    def __exit__(self, *exc: object) -> None: ...

    def words(self, table: str, first: int, count: int) -> list[int]:
        """What the table has now."""


# ---- pymodbus --------------------------------------------------------------------------------------------------------


class PymodbusServer:
    """Its identification is that of all servers of pymodbus in this process, while it runs."""

    NAMES = ("Acme", "Tanks", "1.2")

    def __init__(self, place: Place) -> None:
        self._place = place
        self._memory = {table: first_words(table) for table in TABLES}
        self.refused: set[int] = set()
        self.identifies = True  # by 43/14

    async def _act(
        self, function: int, start: int, address: int, count: int, registers: list[int], values: Any
    ) -> ExcCodes | None:
        self._memory[TABLE_OF[function]] = registers
        if trap(function, address) == 0:
            return None
        self.refused.add(function)
        return ExcCodes(trap(function, address))

    def _on_pdu(self, sending: bool, pdu: ModbusPDU) -> ModbusPDU:
        if not sending or pdu.function_code != 43 or self.identifies:
            return pdu
        return ExceptionResponse(43, ExcCodes.ILLEGAL_FUNCTION, pdu.dev_id, pdu.transaction_id)

    def _table(self, table: str) -> list[SimData]:
        kind = DataType.BITS if table in ("coils", "discrete") else DataType.REGISTERS
        return [SimData(0, values=first_words(table), datatype=kind)]

    async def _begin(self) -> ModbusTcpServer | ModbusSerialServer:
        tables = (self._table("coils"), self._table("discrete"), self._table("holding"), self._table("inputs"))
        device = SimDevice(self._place.unit, simdata=tables, action=self._act)
        server: ModbusTcpServer | ModbusSerialServer
        if self._place.transport == "tcp":
            server = ModbusTcpServer(device, address=("127.0.0.1", self._place.port), trace_pdu=self._on_pdu)
        else:
            where: dict[str, Any] = {"port": self._place.line, "baudrate": self._place.baud}
            server = ModbusSerialServer(device, ignore_missing_devices=True, trace_pdu=self._on_pdu, **where)
        await server.serve_forever(background=True)
        return server

    def _do(self, what: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(what, self._loop).result(20)

    def _identify(self, names: tuple[str, str, str]) -> None:
        identity = ModbusControlBlock().Identity  # type: ignore[no-untyped-call]
        identity.VendorName, identity.ProductCode, identity.MajorMinorRevision = names

    def __enter__(self) -> PymodbusServer:
        self._identify(self.NAMES)
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
        self._identify(("", "", ""))

    def words(self, table: str, first: int, count: int) -> list[int]:
        return self._memory[table][first : first + count]


# ---- libmodbus -------------------------------------------------------------------------------------------------------


_TABLES_OF_LIBRARY = ("coils", "discrete", "inputs", "holding")


class _Mapping(ctypes.Structure):
    _fields_ = [
        *[(f"{what}_of_{table}", ctypes.c_int) for table in _TABLES_OF_LIBRARY for what in ("count", "first")],
        *[(table, ctypes.POINTER(ctypes.c_uint8)) for table in ("coils", "discrete")],
        *[(table, ctypes.POINTER(ctypes.c_uint16)) for table in ("inputs", "holding")],
    ]


class LibmodbusServer:
    """It serves one connection at a time; a new one takes its place."""

    def __init__(self, place: Place) -> None:
        self._library = libmodbus_library()
        self._place, self._context = place, libmodbus_context(self._library, place)
        self._library.modbus_set_response_timeout(self._context, 0, 20000)  # how long it discards what it does not know
        self._address = ctypes.c_void_p(self._library.modbus_mapping_new(16 * WORDS, 16 * WORDS, WORDS, WORDS))
        self._mapping = ctypes.cast(self._address, ctypes.POINTER(_Mapping)).contents
        self.refused: set[int] = set()
        self._end = threading.Event()
        for table in TABLES:
            self._fill(table)

    def _fill(self, table: str) -> None:
        memory, of_bits = getattr(self._mapping, table), table in ("coils", "discrete")
        for i, word in enumerate(first_words(table)):
            if of_bits:
                for bit in range(16):
                    memory[16 * i + bit] = word >> bit & 1
            else:
                memory[i] = word

    def words(self, table: str, first: int, count: int) -> list[int]:
        memory = getattr(self._mapping, table)
        if table in ("inputs", "holding"):
            return list(memory[first : first + count])
        return [sum(memory[16 * i + bit] << bit for bit in range(16)) for i in range(first, first + count)]

    def _reply(self) -> bool:
        """False: the connection has ended. A request that it does not know is discarded."""
        request = (ctypes.c_uint8 * 260)()
        size = self._library.modbus_receive(self._context, request)
        if size < 0:
            self._library.modbus_flush(self._context)
            return self._place.transport == "rtu"
        head = self._library.modbus_get_header_length(self._context)
        function, address = request[head], request[head + 1] << 8 | request[head + 2]
        if size > 0 and trap(function, address):
            self.refused.add(function)
            self._library.modbus_reply_exception(self._context, request, trap(function, address))
        elif size > 0:
            self._library.modbus_reply(self._context, request, size, self._address)
        return True

    def _accept(self, listening: ctypes.c_int) -> int:
        self._library.modbus_close(self._context)
        return int(self._library.modbus_tcp_accept(self._context, ctypes.byref(listening)))

    def _serve(self, listening: ctypes.c_int, using: int) -> None:
        while not self._end.is_set():
            files = [file for file in (listening.value, using) if file >= 0]
            ready = select.select(files, [], [], 0.05)[0]
            if listening.value in ready:
                using = self._accept(listening)
            elif ready and not self._reply():
                self._library.modbus_close(self._context)
                using = -1

    def __enter__(self) -> LibmodbusServer:
        self._listening, using = ctypes.c_int(-1), -1
        if self._place.transport == "tcp":
            self._listening = ctypes.c_int(self._library.modbus_tcp_listen(self._context, 5))
            assert self._listening.value >= 0
        else:
            assert self._library.modbus_connect(self._context) == 0
            using = self._library.modbus_get_socket(self._context)
        self._thread = threading.Thread(target=self._serve, args=(self._listening, using), daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._end.set()
        self._thread.join()
        self._library.modbus_close(self._context)
        self._library.modbus_mapping_free(self._address)
        self._library.modbus_free(self._context)
        if self._listening.value >= 0:
            os.close(self._listening.value)


SERVERS: dict[str, Callable[[Place], Server]] = {"pymodbus": PymodbusServer, "libmodbus": LibmodbusServer}
