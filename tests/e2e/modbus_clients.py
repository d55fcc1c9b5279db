"""Modbus clients of others, each with the same functions: pymodbus, libmodbus, mbpoll. They ask one unit."""

from __future__ import annotations

import ctypes
import ctypes.util
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

import pytest
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.pdu import ModbusPDU

from plctool.testing.waiting import eventually

PATIENCE_S = 10
_EXCEPTIONS = 112345678  # errno of libmodbus: this and the code of an exception
_WORDS = ("Illegal function", "Illegal data address", "Illegal data value")  # of libmodbus, exceptions 1 to 3


class Refused(Exception):
    """The server replied with an exception."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code}")
        self.code = code


@dataclass(frozen=True)
class Place:
    """Where a server is: a TCP port of this machine, or a serial line."""

    transport: str  # "tcp" or "rtu"
    port: int
    line: str
    baud: int
    unit: int


class Client(Protocol):
    """Addresses are those that are sent. A bit is 0 or 1. All raise Refused."""

    def read(self, function: int, address: int, count: int) -> list[int]:
        """By function 1 to 4."""

    def write(self, function: int, address: int, values: list[int]) -> None:
        """By function 5, 6, 15 or 16."""

    def mask(self, address: int, and_mask: int, or_mask: int) -> None: ...

    def read_write(self, address: int, count: int, write_address: int, values: list[int]) -> list[int]: ...

    def server_id(self) -> str: ...

    def identification(self) -> list[str]:
        """Vendor, product and version."""

    def loopback(self, word: int) -> int:
        """By function 8, diagnostic 0."""

    def send(self, pdu: bytes) -> None:
        """Sends a request as it is."""


# ---- pymodbus --------------------------------------------------------------------------------------------------------


class _Raw(ModbusPDU):
    def __init__(self, pdu: bytes, unit: int) -> None:
        super().__init__(dev_id=unit)
        self.function_code = pdu[0]
        self._data = pdu[1:]

    def encode(self) -> bytes:
        return self._data


class Pymodbus:
    """A client of pymodbus."""

    def __init__(self, client: Any, unit: int) -> None:
        self._client, self._unit = client, {"device_id": unit}

    def _checked(self, reply: Any) -> Any:
        if reply.isError():
            raise Refused(reply.exception_code)
        return reply

    def read(self, function: int, address: int, count: int) -> list[int]:
        names = ("read_coils", "read_discrete_inputs", "read_holding_registers", "read_input_registers")
        reply = self._checked(getattr(self._client, names[function - 1])(address, count=count, **self._unit))
        return [int(bit) for bit in reply.bits[:count]] if function < 3 else list(reply.registers)

    def write(self, function: int, address: int, values: list[int]) -> None:
        what: list[Any] = [value != 0 for value in values] if function in (5, 15) else list(values)
        names = {5: "write_coil", 6: "write_register", 15: "write_coils", 16: "write_registers"}
        self._checked(getattr(self._client, names[function])(address, what if function > 6 else what[0], **self._unit))

    def mask(self, address: int, and_mask: int, or_mask: int) -> None:
        masks = {"and_mask": and_mask, "or_mask": or_mask}
        self._checked(self._client.mask_write_register(address=address, **masks, **self._unit))

    def read_write(self, address: int, count: int, write_address: int, values: list[int]) -> list[int]:
        ask = self._client.readwrite_registers
        where = {"read_address": address, "read_count": count, "write_address": write_address}
        return list(self._checked(ask(**where, values=values, **self._unit)).registers)

    def server_id(self) -> str:
        reply = self._checked(self._client.report_device_id(**self._unit))
        # It takes the last byte for the state, which the standard has before the name.
        return str(reply.identifier[2:].decode()) + "?"

    def identification(self) -> list[str]:
        found = self._checked(self._client.read_device_information(**self._unit)).information
        return [found[i].decode() for i in range(3)]

    def loopback(self, word: int) -> int:
        reply = self._checked(self._client.diag_query_data(word.to_bytes(2, "big"), **self._unit))
        return int.from_bytes(reply.message, "big")

    def send(self, pdu: bytes) -> None:
        self._checked(self._client.execute(False, _Raw(pdu, self._unit["device_id"])))


@contextmanager
def pymodbus(place: Place) -> Iterator[Client]:
    client: Any
    if place.transport == "tcp":
        client = ModbusTcpClient("127.0.0.1", port=place.port, timeout=PATIENCE_S, retries=1)
    else:
        client = ModbusSerialClient(place.line, baudrate=place.baud, timeout=PATIENCE_S, retries=1)
    eventually(client.connect)
    yield Pymodbus(client, place.unit)
    client.close()


# ---- libmodbus -------------------------------------------------------------------------------------------------------


def libmodbus_library() -> ctypes.CDLL:
    """The C library; skips the test if it is not installed."""
    try:
        library = ctypes.CDLL(ctypes.util.find_library("modbus") or "libmodbus.so.5", use_errno=True)
    except OSError:
        pytest.skip("libmodbus is not installed: apt-get install libmodbus5")
    for name in ("modbus_new_tcp", "modbus_new_rtu", "modbus_mapping_new"):
        getattr(library, name).restype = ctypes.c_void_p
    return library


def libmodbus_context(library: ctypes.CDLL, place: Place) -> ctypes.c_void_p:
    """Of a client or a server, with time enough for a busy machine."""
    if place.transport == "tcp":
        found = library.modbus_new_tcp(b"127.0.0.1", place.port)
    else:
        found = library.modbus_new_rtu(place.line.encode(), place.baud, ctypes.c_char(b"N"), 8, 1)
    context = ctypes.c_void_p(found)
    library.modbus_set_slave(context, place.unit)
    library.modbus_set_response_timeout(context, PATIENCE_S, 0)
    library.modbus_set_byte_timeout(context, PATIENCE_S, 0)
    return context


class Libmodbus:
    """A client of libmodbus."""

    def __init__(self, library: ctypes.CDLL, context: ctypes.c_void_p, place: Place) -> None:
        self._library, self._context, self._place = library, context, place

    def _ask(self, name: str, *args: Any) -> int:
        done = int(getattr(self._library, name)(self._context, *args))
        if done < 0 and ctypes.get_errno() > _EXCEPTIONS:
            raise Refused(ctypes.get_errno() - _EXCEPTIONS)
        assert done >= 0, f"{name}: errno {ctypes.get_errno()}"
        return done

    def read(self, function: int, address: int, count: int) -> list[int]:
        name = ("read_bits", "read_input_bits", "read_registers", "read_input_registers")[function - 1]
        found = ((ctypes.c_uint8 if function < 3 else ctypes.c_uint16) * count)()
        assert self._ask(f"modbus_{name}", address, count, found) == count
        return list(found)

    def write(self, function: int, address: int, values: list[int]) -> None:
        count = len(values)
        if function in (5, 6):
            self._ask("modbus_write_bit" if function == 5 else "modbus_write_register", address, values[0])
        elif function == 15:
            assert self._ask("modbus_write_bits", address, count, (ctypes.c_uint8 * count)(*values)) == count
        else:
            assert self._ask("modbus_write_registers", address, count, (ctypes.c_uint16 * count)(*values)) == count

    def mask(self, address: int, and_mask: int, or_mask: int) -> None:
        self._ask("modbus_mask_write_register", address, ctypes.c_uint16(and_mask), ctypes.c_uint16(or_mask))

    def read_write(self, address: int, count: int, write_address: int, values: list[int]) -> list[int]:
        found, sent = (ctypes.c_uint16 * count)(), (ctypes.c_uint16 * len(values))(*values)
        ask = "modbus_write_and_read_registers"
        assert self._ask(ask, write_address, len(sent), sent, address, count, found) == count
        return list(found)

    def server_id(self) -> str:
        found = (ctypes.c_uint8 * 256)()
        size = self._ask("modbus_report_slave_id", len(found), found)
        assert found[1] == 0xFF, "the program runs"
        return bytes(found[2:size]).decode()

    def identification(self) -> list[str]:
        raise NotImplementedError

    def loopback(self, word: int) -> int:
        raise NotImplementedError

    def send(self, pdu: bytes) -> None:
        sent, reply = (ctypes.c_uint8 * 260)(self._place.unit, *pdu), (ctypes.c_uint8 * 260)()
        self._ask("modbus_send_raw_request", sent, 1 + len(pdu))
        self._ask("modbus_receive_confirmation", reply)
        at = 7 if self._place.transport == "tcp" else 1
        if reply[at] & 0x80:
            assert reply[at] == pdu[0] | 0x80
            raise Refused(reply[at + 1])


@contextmanager
def libmodbus(place: Place) -> Iterator[Client]:
    library = libmodbus_library()
    context = libmodbus_context(library, place)
    eventually(lambda: library.modbus_connect(context) == 0)
    yield Libmodbus(library, context, place)
    library.modbus_close(context)
    library.modbus_free(context)


# ---- mbpoll ----------------------------------------------------------------------------------------------------------


class Mbpoll:
    """The command; one call is one request. It chooses 5 and 6 by itself for one value, 15 and 16 for more."""

    def __init__(self, place: Place) -> None:
        if place.transport == "tcp":
            self._command = ["mbpoll", "-m", "tcp", "-p", str(place.port), "127.0.0.1"]
        else:
            self._command = ["mbpoll", "-m", "rtu", "-b", str(place.baud), "-P", "none", place.line]
        self._command += ["-a", str(place.unit), "-0", "-1", "-o", str(PATIENCE_S)]

    def _ask(self, *args: object) -> str:
        command = [*self._command, *map(str, args)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
        output = done.stdout + done.stderr
        for code, words in enumerate(_WORDS, 1):
            if words in output:
                raise Refused(code)
        assert done.returncode == 0, output
        return output

    def read(self, function: int, address: int, count: int) -> list[int]:
        table = {1: "0", 2: "1", 3: "4:hex", 4: "3:hex"}[function]
        found = re.findall(r"^\[\d+\]:\s+(\w+)", self._ask("-t", table, "-r", address, "-c", count), re.MULTILINE)
        return [int(value, 16) for value in found]

    def write(self, function: int, address: int, values: list[int]) -> None:
        assert (len(values) == 1) == (function < 7)
        self._ask("-t", "0" if function in (5, 15) else "4", "-r", address, *values)

    def mask(self, address: int, and_mask: int, or_mask: int) -> None:
        raise NotImplementedError

    def read_write(self, address: int, count: int, write_address: int, values: list[int]) -> list[int]:
        raise NotImplementedError

    def server_id(self) -> str:
        output = self._ask("-u")
        assert re.search(r"Status: On\b", output), output
        found = re.search(r"Data\s*: (.*)", output)
        assert found, output
        return found[1].strip()

    def identification(self) -> list[str]:
        raise NotImplementedError

    def loopback(self, word: int) -> int:
        raise NotImplementedError

    def send(self, pdu: bytes) -> None:
        raise NotImplementedError


@contextmanager
def mbpoll(place: Place) -> Iterator[Client]:
    if shutil.which("mbpoll") is None:
        pytest.skip("mbpoll is not installed: apt-get install mbpoll")
    yield Mbpoll(place)


CLIENTS = {"pymodbus": pymodbus, "libmodbus": libmodbus, "mbpoll": mbpoll}
