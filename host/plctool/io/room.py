"""What the inputs and outputs of a program take of a firmware: drivers, and what these have room for.

Drivers take devices in their order. So optional ones count where one that is required comes after them; of the others
the program runs without those that find no room.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

from plctool.core import ffi, lib
from plctool.image.limits import ROOM, Need
from plctool.io.configuration import Configuration, ConnectorEntry

GPIO, MODBUS = "IoDrvGpio", "IoDrvModbus"
DRIVERS = (GPIO, MODBUS, "IoDrvCanopen", "IoDrvSim", "IoDrvSysfs")
"""Those of this project, each a component of that name."""

IO_MANAGER = "CmpIoMgrEmbedded"
DRIVER_OF = {
    name: GPIO if name in ("gpio_groups", "events") else MODBUS if name.startswith("modbus") else IO_MANAGER
    for name in ROOM
}
"""The component that has so much room."""

_TCP_CLIENTS = (
    lib.MODBUS_ROLE_TCP_CLIENT,
    lib.MODBUS_ROLE_RTU_TCP_CLIENT,
    lib.MODBUS_ROLE_NAMED_TCP_CLIENT,
    lib.MODBUS_ROLE_NAMED_RTU_TCP_CLIENT,
)
_CLIENTS = (lib.MODBUS_ROLE_SERIAL_CLIENT, *_TCP_CLIENTS)
_TCP = (*_TCP_CLIENTS, lib.MODBUS_ROLE_TCP_SERVER)
_OF_BITS = (lib.MODBUS_READ_COILS, lib.MODBUS_READ_DISCRETE_INPUTS, lib.MODBUS_WRITE_COIL, lib.MODBUS_WRITE_COILS)


def needs_of_io(configuration: Configuration) -> dict[str, Need]:
    """What the drivers have to have room for, by the names of `ROOM`."""
    taken: Counter[str] = Counter()
    needed: Counter[str] = Counter(connectors=len(configuration.connectors))
    for connector, is_required in _used(configuration):
        uses = _uses(connector)
        taken += uses
        if is_required:
            needed |= Counter({name: taken[name] for name, amount in uses.items() if amount})
    return {name: Need(amount) for name, amount in needed.items()}


def required(configuration: Configuration) -> Iterator[ConnectorEntry]:
    """The connectors that the program does not run without."""
    return (connector for connector, is_required in _used(configuration) if is_required)


def _used(configuration: Configuration) -> Iterator[tuple[ConnectorEntry, bool]]:
    """The connectors that are not switched off, and whether the program does not run without them."""
    known: list[tuple[bool, bool]] = []
    for connector in configuration.connectors:
        is_on, is_required = (True, True) if connector.parent is None else known[connector.parent]
        is_on = is_on and bool(connector.flags & lib.CF_ENABLE)
        is_required = is_required and is_on and not connector.flags & lib.CF_OPTIONAL
        known.append((is_on, is_required))
        if is_on:
            yield connector, is_required


def _uses(connector: ConnectorEntry) -> Counter[str]:
    """What its driver takes for it."""
    if connector.driver == GPIO:
        events = sum(p.id - lib.GPIO_EVENT in range(lib.IO_GPIO_LINES) for p in connector.parameters)
        return Counter(gpio_groups=1, events=events)
    if connector.driver == MODBUS:
        return _of_line(connector) if connector.parent is None else _of_device(connector)
    return Counter()


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
