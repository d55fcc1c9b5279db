"""The services of inputs and outputs (group 0x0B, docs/protocol.md): devices, their parameters, what is on a bus."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

from plctool.core import error_name, lib
from plctool.errors import DeviceError
from plctool.link import bintag, l7
from plctool.link.session import Session
from plctool.link.wire import Layout

NO_PARENT = int(lib.IO_CONFIG_NONE)
NEVER_MS = 0xFFFF_FFFF  # age of data that never came, or longer ago
_PENDING_POLL = 0.1  # s
_PENDING_LIMIT = 600.0  # s that a scan may take to go on: 247 silent units of a Modbus gateway
_ANSWER_POLL = 0.02  # s
_ANSWER_LIMIT = 40.0  # s that a parameter may take: a node is waited for, then it has up to 30 s
_MOST_MODULES = 1000  # on one bus; a Modbus line has 247

_STATE = Layout("IO_STATE")
_PARAMETER = Layout("IO_PARAMETER")
_MODULE = Layout("IO_MODULE")


@dataclass(frozen=True)
class IoDevice:
    """A connector of the application. `flags`: CF_*; `errors` since it was loaded; `age_ms` of its data, None if there
    were none; `skipped`: how often a task found its driver busy."""

    index: int
    name: str
    driver: str
    parent: int | None
    flags: int
    errors: int
    age_ms: int | None
    skipped: int

    @property
    def state(self) -> str:
        """In words."""
        flags = self.flags
        if not flags & lib.CF_ENABLE:
            return "disabled"
        if not flags & lib.CF_DRIVER_AVAILABLE:
            return "no driver"
        if flags & lib.CF_CONNECTOR_BUS_ERROR:
            return "not found" if not flags & lib.CF_CONNECTOR_FOUND else "bus error"
        if flags & lib.CF_CONNECTOR_ERROR:
            return "error"
        return "ok" if flags & lib.CF_CONNECTOR_ACTIVE else "starting"


@dataclass(frozen=True)
class IoModule:
    """What a scan found. `slot`: its address on the bus."""

    slot: int
    name: str
    vendor: int
    product: int
    revision: int


def list_devices(session: Session) -> list[IoDevice]:
    """All connectors of the application, in the order of the description."""
    found: list[IoDevice] = []
    while batch := _list_from(session, found[-1].index + 1 if found else 0):
        found += batch
    return found


def _list_from(session: Session, start: int) -> list[IoDevice]:
    tags = _call(session, lib.SRV_IO_LIST, bintag.u32(lib.TAG_IO_START, start))
    found = []
    for entry in tags.containers(lib.TAG_IO_ENTRY):
        state = _STATE.unpack(entry.bytes(lib.TAG_IO_STATE, _STATE.size))
        if state.index < start:  # asked again from there, it would never end
            continue
        name, driver = entry.text(lib.TAG_IO_NAME), entry.text(lib.TAG_IO_DRIVER)
        parent = None if state.parent == NO_PARENT else state.parent
        age = None if state.age_ms == NEVER_MS else state.age_ms
        found.append(IoDevice(state.index, name, driver, parent, state.flags, state.errors, age, state.skipped))
    return found


def read_parameter(session: Session, connector: int, number: int, bits: int) -> bytes:
    """The first `bits` of a parameter. Raises DeviceError if there is none, or its driver does not let it be read."""
    place = _PARAMETER.pack(connector=connector, id=number, bits=bits)
    tags = _answered(session, lib.SRV_IO_READ_PARAMETER, bintag.raw(lib.TAG_IO_PARAMETER, place))
    _check(tags, f"reading of parameter {number}")
    size = -(-bits // 8)
    return tags.bytes(lib.TAG_IO_DATA, size)[:size]


def write_parameter(session: Session, connector: int, number: int, bits: int, data: bytes) -> None:
    """Sets the first `bits` of a parameter."""
    place = _PARAMETER.pack(connector=connector, id=number, bits=bits)
    content = (bintag.raw(lib.TAG_IO_PARAMETER, place), bintag.raw(lib.TAG_IO_DATA, data))
    _check(_answered(session, lib.SRV_IO_WRITE_PARAMETER, *content), f"writing of parameter {number}")


def _answered(session: Session, service: int, *tags: bintag.Tag) -> bintag.Tags:
    """The reply; one that the device on the bus has to give first is asked for again and again."""
    deadline = time.monotonic() + _ANSWER_LIMIT
    while True:
        reply = _call(session, service, *tags)
        if reply.u16(lib.TAG_IO_RESULT) != lib.ERR_PENDING or time.monotonic() >= deadline:
            return reply
        time.sleep(_ANSWER_POLL)


def identify(session: Session, connector: int) -> None:
    """The device shows itself, by a light for example."""
    tags = _call(session, lib.SRV_IO_IDENTIFY, bintag.u32(lib.TAG_IO_CONNECTOR, connector))
    _check(tags, "request to identify")


def scan(session: Session, connector: int) -> Iterator[IoModule]:
    """What is on a bus, each when it is found. Raises DeviceError if the driver cannot scan, or does not come to an
    end."""
    start, deadline = 0, time.monotonic() + _PENDING_LIMIT
    while start <= _MOST_MODULES and time.monotonic() < deadline:
        bus, first = bintag.u32(lib.TAG_IO_CONNECTOR, connector), bintag.u32(lib.TAG_IO_START, start)
        tags = _call(session, lib.SRV_IO_SCAN, bus, first)
        result = tags.u16(lib.TAG_IO_RESULT)
        if result not in (lib.ERR_OK, lib.ERR_PENDING, lib.ERR_NO_OBJECT):
            _check(tags, "scan")
        contents = list(_contents(tags, lib.TAG_IO_MODULE, _MODULE.size))
        for content in contents:
            module = _MODULE.unpack(content)
            name = content[_MODULE.size :].split(b"\0")[0].decode("latin-1")
            yield IoModule(module.slot, name, module.vendor, module.product, module.revision)
            start, deadline = start + 1, time.monotonic() + _PENDING_LIMIT
        if result == lib.ERR_NO_OBJECT:
            return
        if result == lib.ERR_PENDING:
            time.sleep(_PENDING_POLL)
        elif not contents:
            break
    raise DeviceError("The scan does not come to an end; look at the log of the device.", "scan", lib.ERR_TIMEOUT)


def _call(session: Session, service: int, *tags: bintag.Tag) -> bintag.Tags:
    try:
        return session.recover(lambda: session.call(lib.SG_IOMGR, service, tags))
    except DeviceError as error:
        if error.result not in (lib.ERR_L7_UNKNOWNCMDGROUP, lib.ERR_L7_UNKNOWNCMD):
            raise
        message = "This controller has no I/O manager; its firmware needs CmpIoMgrEmbedded (docs/porting.md)."
        raise DeviceError(message, "no-io", error.result) from None


def _contents(tags: bintag.Tags, wanted: int, size: int) -> list[bytes]:
    """The contents of all elements of one kind that are long enough."""
    return [content for tag, content in tags if tag == wanted and isinstance(content, bytes) and len(content) >= size]


_ADVICE = {
    "ERR_INVALIDID": "there is no such device any more",
    "ERR_NO_OBJECT": "it has no driver, or no such parameter",
    "ERR_NOT_SUPPORTED": "its driver does not do that",
    "ERR_DEVICE": "the device refuses; the log has its reason",
    "ERR_OUT_OF_LIMITS": "it has another length; give its type by --type",
    "ERR_TIMEOUT": "the device on the bus does not reply",
    "ERR_NOBUFFER": "another tool is asking a device, try again",
    "ERR_PENDING": "the device has not answered yet, try again",
}


def _check(tags: bintag.Tags, action: str) -> None:
    result = tags.u16(lib.TAG_IO_RESULT)
    l7.check_result(result, action, _ADVICE.get(error_name(result), ""))
