"""What the inputs and outputs of a program take of a firmware: drivers, and what these have room for.

Optional devices do not count: the program runs without them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

from plctool.core import ffi, lib
from plctool.image.limits import ROOM, Need
from plctool.io.configuration import Configuration, ConnectorEntry

GPIO, MODBUS = "IoDrvGpio", "IoDrvModbus"
DRIVERS = (GPIO, MODBUS, "IoDrvSim", "IoDrvSysfs")
"""Those of this project, each a component of that name."""

IO_MANAGER = "CmpIoMgrEmbedded"
DRIVER_OF = {
    name: GPIO if name in ("gpio_groups", "events") else MODBUS if name.startswith("modbus") else IO_MANAGER
    for name in ROOM
}
"""The component that has so much room."""

_CLIENTS = (lib.MODBUS_ROLE_SERIAL_CLIENT, lib.MODBUS_ROLE_TCP_CLIENT)
_TCP = (lib.MODBUS_ROLE_TCP_CLIENT, lib.MODBUS_ROLE_TCP_SERVER)
_OF_BITS = (lib.MODBUS_READ_COILS, lib.MODBUS_READ_DISCRETE_INPUTS, lib.MODBUS_WRITE_COIL, lib.MODBUS_WRITE_COILS)


def needs_of_io(configuration: Configuration) -> dict[str, Need]:
    """What the drivers have to have room for, by the names of `ROOM`."""
    found: Counter[str] = Counter(connectors=len(configuration.connectors))
    for connector in required(configuration):
        if connector.driver == GPIO:
            found["gpio_groups"] += 1
            found["events"] += sum(p.id - lib.GPIO_EVENT in range(lib.IO_GPIO_LINES) for p in connector.parameters)
        elif connector.driver == MODBUS:
            found += _of_line(connector) if connector.parent is None else _of_device(connector)
    return {name: Need(amount) for name, amount in found.items()}


def required(configuration: Configuration) -> Iterator[ConnectorEntry]:
    """The connectors that the program does not run without."""
    wanted: list[bool] = []
    for connector in configuration.connectors:
        own = connector.flags & (lib.CF_ENABLE | lib.CF_OPTIONAL) == lib.CF_ENABLE
        wanted.append(own and (connector.parent is None or wanted[connector.parent]))
        if wanted[-1]:
            yield connector


def _of_line(line: ConnectorEntry) -> Counter[str]:
    role = next((int.from_bytes(p.value, "little") for p in line.parameters if p.id == lib.MODBUS_PARAM_ROLE), 0)
    found = Counter(["modbus_lines" if role in _CLIENTS else "modbus_servers"])
    found["modbus_tcp"] += role in _TCP
    for data in _structures(line, lib.MODBUS_PARAM_RANGE, "MODBUS_RANGE"):
        found["modbus_ranges"] += 1
        found["modbus_data"] += -(-int(data.bits) // 8)
    return found


def _of_device(device: ConnectorEntry) -> Counter[str]:
    found = Counter(["modbus_devices"])
    for job in _structures(device, lib.MODBUS_PARAM_JOB, "MODBUS_JOB"):
        found["modbus_jobs"] += 1
        found["modbus_data"] += _size(job.function, job.read_count) + 2 * _size(job.function, job.write_count)
    return found


def _size(function: int, count: int) -> int:
    """Bytes of `count` bits or registers."""
    return -(-count // 8) if function in _OF_BITS else 2 * count


def _structures(connector: ConnectorEntry, first: int, kind: str) -> Iterator[Any]:
    """The parameters that are structures, numbered from `first` without gaps."""
    values = {p.id: p.value for p in connector.parameters}
    while first in values and len(values[first]) == ffi.sizeof(kind):
        yield ffi.from_buffer(f"{kind} *", values[first])
        first += 1
