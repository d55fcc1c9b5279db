"""What the settings of a client and of a server have in common: their serial lines, addresses and parameters."""

from __future__ import annotations

import ipaddress
from typing import Any

from plctool.core import ffi, lib
from plctool.iec.types import BYTE, UDINT, ArrayType, StringType
from plctool.io.modbus.hosts import read_host, split_place, what_to_write
from plctool.io.model import Connector, Parameter
from plctool.io.names import MAX_LINE, MAX_NAME, is_line
from plctool.io.tables import Table

DRIVER = "IoDrvModbus"
MAX_UNIT = int(lib.MODBUS_MAX_UNIT)  # of a serial line
_PARITIES = {"none": 0, "even": 1, "odd": 2}
_BAUDS = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600)


def number_parameter(number: int, value: int, name: str = "") -> Parameter:
    """Number `number` of the driver; `name`: that of the setting it is from."""
    return Parameter(number, UDINT, value, name)


def text_parameter(number: int, value: str, name: str = "") -> Parameter:
    """The same for a text."""
    return Parameter(number, StringType(len(value)), value, name)


def structure_parameter(number: int, value: Any) -> Parameter:
    """The same for a struct of Modbus.h."""
    data = bytes(ffi.buffer(value))
    return Parameter(number, ArrayType(BYTE, ((0, len(data) - 1),)), data)


def counters(*names: str) -> dict[str, int]:
    """Numbers of parameters that the driver counts, by the names that users give them (`plctool io param get`)."""
    return {name: int(getattr(lib, f"MODBUS_PARAM_{name.upper()}")) for name in names}


def default_name(table: Table, key: str) -> str:
    """What a line is called that has no name."""
    found = table.text(key)
    return f"modbus_{(found or 'line').rpartition('/')[2].strip('[]')}"[:MAX_NAME]


def serial_settings(table: Table, connector: Connector) -> tuple[int, int]:
    """Adds the parameters of a serial line; its baud, and the bits of a character."""
    bauds = {str(b): b for b in _BAUDS}
    port = table.text("port", required="/dev/ttyS1") or "?"
    if "://" in port:
        hint = "" if "server" in table.name else _network_hint(port)
        table.error(f"'{port}' is not a serial line of the controller{hint}", "port")
    elif not is_line(port):
        table.error(f"port has 1 to {MAX_LINE} ASCII characters", "port")
    connector.takes = f"the line {port}"
    baud = table.number("baud", _BAUDS[0], _BAUDS[-1], 19200, unit="baud") or 19200
    if str(baud) not in bauds:
        table.error(f"{baud} is not a speed of serial lines: write {', '.join(bauds)}", "baud")
    parity = table.choice("parity", _PARITIES, _PARITIES["even"])
    stop_bits = table.number("stop_bits", 1, 2, 1) or 1
    connector.parameters += [
        text_parameter(int(lib.MODBUS_PARAM_LINE), port, "port"),
        number_parameter(int(lib.MODBUS_PARAM_BAUD), baud, "baud"),
        number_parameter(int(lib.MODBUS_PARAM_PARITY), parity or 0, "parity"),
        number_parameter(int(lib.MODBUS_PARAM_STOP_BITS), stop_bits, "stop_bits"),
        number_parameter(int(lib.MODBUS_PARAM_RS485), int(table.flag("drive")), "drive"),
    ]
    return baud, 9 + (parity != 0) + stop_bits


def _network_hint(url: str) -> str:
    """What to write in place of a URL, with which other software names a serial server in the network."""
    host, port = split_place(url) or ("192.168.0.7", None)
    keys = f'host = "{host}"' + (f", port = {port}" if port else "")
    return f': write it as [[modbus.tcp]] with {keys} and framing = "rtu"'


def host_parameters(table: Table) -> tuple[bool, list[Parameter]]:
    """Where a client connects to. True: the host is found by name, else by its IPv4 address."""
    text = table.text("host", required="192.168.0.7")
    host = read_host(text) if text is not None else None
    if text is not None and host is None:
        shown = text if len(text) <= MAX_LINE else f"{text[:MAX_LINE]}..."
        table.error(f"'{shown}' is not an address or a name: {what_to_write(text)}", "host")
    port = _port_parameter(table)
    if host is not None and host.ipv4 is None:
        return True, [port, text_parameter(int(lib.MODBUS_PARAM_HOST), host.name, "host")]
    address = host.ipv4 if host is not None and host.ipv4 is not None else 0
    return False, [number_parameter(int(lib.MODBUS_PARAM_ADDRESS), address, "host"), port]


def own_address_parameters(table: Table) -> list[Parameter]:
    """Where a server listens: an IPv4 address of the controller, and the port."""
    found = table.text("address", "0.0.0.0") or ""
    try:
        address = int(ipaddress.IPv4Address(found))
    except ValueError:
        of_host, colon, of_port = found.partition(":")
        hint = f'write address = "{of_host}" and port = {of_port}'
        if not colon or not of_port.isdecimal():
            hint = 'write for example "192.168.0.7"'
        table.error(f"'{found}' is not an IPv4 address: {hint}", "address")
        address = 0
    return [number_parameter(int(lib.MODBUS_PARAM_ADDRESS), address, "address"), _port_parameter(table)]


def _port_parameter(table: Table) -> Parameter:
    port = table.number("port", 1, 65535, int(lib.MODBUS_PORT))
    return number_parameter(int(lib.MODBUS_PARAM_PORT), port or int(lib.MODBUS_PORT), "port")
