"""Monitoring: reads, writes and forces the memory of the application (codesys-v3-protocol 4.9 and docs/protocol.md)."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from plctool.core import lib
from plctool.debug.forced import ForcedPlace, ForceList
from plctool.errors import DeviceError
from plctool.link import bintag, l7
from plctool.link.session import Session
from plctool.link.wire import Layout

APP_CHANGED = "app-changed"  # code of the error when the application is not the one of the symbols
_VALUE_HEAD = Layout("MON2_VALUE")  # before each value
_APPLICATION = Layout("MON2_APPLICATION")
_FORCED = Layout("MON2_FORCED")
_OFFSETS = struct.Struct("<4I")
_FAR = 0x10000  # offsets from here on take 32 bits
_MESSAGE_OVERHEAD = 96  # layer 7 header, application tag and list heads, bytes
_TRIES = 5  # to read values while no task runs
_ALL_BITS = 0xFF


@dataclass(frozen=True)
class AreaRange:
    """`size` bytes of memory area `area` (APP_AREA_*) from `offset` on. With `hops` a pointer is there; the value is
    `hops[0]` bytes after where that leads, and so on."""

    area: int
    offset: int
    size: int
    hops: tuple[int, ...] = ()

    def part(self, at: int, size: int) -> AreaRange:
        """`size` bytes from byte `at` on."""
        if self.hops:
            return AreaRange(self.area, self.offset, size, (*self.hops[:-1], self.hops[-1] + at))
        return AreaRange(self.area, self.offset + at, size)


@dataclass(frozen=True)
class Contents:
    """What was read, in order; None where a pointer leads to no memory of the application. `consistent`: no task was
    in its cycle meanwhile. `forced`: the serial number of the list of forced variables; None if it is empty."""

    values: list[bytes | None]
    consistent: bool
    forced: int | None = None


def read_memory(session: Session, image_crc: int, ranges: Sequence[AreaRange]) -> Contents:
    """The bytes of every range of the application with this CRC, as `Reader` reads them."""
    return Reader(ranges).read(session, image_crc)


class Reader:
    """Reads the same ranges again and again; what it asks for is encoded once."""

    def __init__(self, ranges: Sequence[AreaRange]) -> None:
        self._ranges = ranges
        self._room = 0  # bytes of a message, for which the rest was made
        self._parts: list[int] = []  # of each range, if one has more than one
        self._batches: list[_Batch] = []

    def read(self, session: Session, image_crc: int) -> Contents:
        """As many in one request as fit. What fits one request is asked for again, a few times, until it is consistent.

        Raises DeviceError when one cannot be read, or when the device has another application.
        """
        session.recover(session.application)
        self._prepare(session.connection.buffer_size - _MESSAGE_OVERHEAD)
        batches = self._batches
        in_one_access = len(batches) == 1 and batches[0].is_one_access
        contents = Contents([], True)
        for _ in range(_TRIES):
            found = [session.recover(partial(_read_batch, session, image_crc, batch)) for batch in batches]
            values = [value for part in found for value in part.values]
            consistent = len(found) < 2 and all(part.consistent for part in found)
            forced = found[-1].forced if found else None
            contents = Contents(self._joined(values), consistent or in_one_access, forced)
            if contents.consistent or len(batches) > 1:
                break
        return contents

    def _prepare(self, room: int) -> None:
        if room == self._room:
            return
        longest = room - _VALUE_HEAD.size
        cut = [[r.part(at, min(longest, r.size - at)) for at in range(0, r.size, longest)] for r in self._ranges]
        self._parts = [] if all(len(parts) == 1 for parts in cut) else [len(parts) for parts in cut]
        self._batches = list(_batches([piece for parts in cut for piece in parts], room))
        self._room = room

    def _joined(self, values: list[bytes | None]) -> list[bytes | None]:
        """The values of the ranges, of those of their parts."""
        if not self._parts:
            return values
        rest = iter(values)
        return [_whole([next(rest) for _ in range(count)]) for count in self._parts]


def _whole(parts: Sequence[bytes | None]) -> bytes | None:
    found = [part for part in parts if part is not None]
    return b"".join(found) if len(found) == len(parts) else None


class _Batch:
    """Pieces that are read by one request, and their list in it."""

    def __init__(self, pieces: Sequence[AreaRange], variables: bytes) -> None:
        self.pieces = pieces
        self.variables = variables
        self._layout = struct.Struct("<" + "".join(f"{_VALUE_HEAD.codes}{piece.size}s" for piece in pieces))
        self._heads = (tuple(range(len(pieces))), tuple(piece.size for piece in pieces))

    @property
    def is_one_access(self) -> bool:
        return len(self.pieces) == 1 and self.pieces[0].size in (1, 2, 4)

    def values(self, content: bytes) -> list[bytes | None]:
        """What a reply has of them."""
        if len(content) >= self._layout.size:
            found = self._layout.unpack_from(content)
            if (found[0::3], found[1::3]) == self._heads:
                return list(found[2::3])
        return self._partly(content)

    def _partly(self, content: bytes) -> list[bytes | None]:
        """The same if some of them could not be read."""
        values: list[bytes | None] = []
        for index, piece in enumerate(self.pieces):
            if len(content) < _VALUE_HEAD.size:
                break
            head = _VALUE_HEAD.unpack(content)
            content = content[_VALUE_HEAD.size :]
            if head.id == index | lib.MON2_ID_FAILED:
                if not _leads_nowhere(piece, head.size):  # in its place is the error
                    raise _monitoring_error("read", head.size)
                values.append(None)
            elif head.id != index or head.size != piece.size or len(content) < piece.size:
                break
            else:
                values.append(content[: piece.size])
                content = content[piece.size :]
        if len(values) != len(self.pieces):
            raise bintag.malformed("values are missing")
        return values


def _batches(pieces: Sequence[AreaRange], room: int) -> Iterator[_Batch]:
    """The pieces, as many together as fit a request and its reply; at least one."""
    batch: list[AreaRange] = []
    request, reply = b"", 0
    for piece in pieces:
        variable, size = _read_variable(piece), _VALUE_HEAD.size + piece.size
        if batch and max(len(request) + len(variable), reply + size) > room:
            yield _Batch(batch, request)
            batch, request, reply = [], b"", 0
        batch.append(piece)
        request, reply = request + variable, reply + size
    if batch:
        yield _Batch(batch, request)


def _read_variable(piece: AreaRange) -> bytes:
    variable = [
        bintag.raw(lib.TAG_MON2_VAR_SIZE, _short(piece.size)),
        bintag.raw(lib.TAG_MON2_VAR_CODE, _address_code(piece)),
    ]
    return bintag.encode([bintag.Tag(lib.TAG_MON2_READ_VAR, bintag.encode(variable, aligned=False))], aligned=False)


def _short(value: int) -> bytes:
    return value.to_bytes(1 if value < 0x100 else 2 if value < 0x10000 else 4, "little")


def _address_code(where: AreaRange) -> bytes:
    """Byte code that leaves the address of a variable: load the offset, make it relative to the area; for each hop
    dereference and add."""
    code = _load(where.offset) + bytes([lib.MON2_OP_RAO, where.area])
    for hop in where.hops:
        code += bytes([lib.MON2_OP_DER, lib.MON2_POINTER_SIZE]) + _load(hop) + bytes([lib.MON2_OP_ADD])
    return code


def _load(value: int) -> bytes:
    if value < _FAR:
        return struct.pack("<BH", lib.MON2_OP_LD16, value)
    return struct.pack("<BI", lib.MON2_OP_LD32, value)


def _read_batch(session: Session, image_crc: int, batch: _Batch) -> Contents:
    tags = session.call(
        lib.SG_MONITORING2,
        lib.SRV_MON2_READ,
        [_application_tag(session, image_crc), bintag.Tag(lib.TAG_MON2_READ_LIST, batch.variables)],
    )
    _check_monitoring(session, tags, "read")
    values = batch.values(tags.bytes(lib.TAG_MON2_VALUES))
    forced = None if tags.find(lib.TAG_MON2_FORCE_SERIAL) is None else tags.u32(lib.TAG_MON2_FORCE_SERIAL)
    return Contents(values, tags.find(lib.TAG_MON2_CONSISTENT) is not None, forced)


def _leads_nowhere(piece: AreaRange, error: int) -> bool:
    """Whether the value of a pointer is the reason for an error."""
    outside = (lib.MONITORING_ERR_INVALID_POINTER, lib.MONITORING_ERR_INVALID_INDEX)
    return bool(piece.hops) and error in outside


@dataclass(frozen=True)
class Write:
    """`value` for a range; of a single byte only the bits in `mask`."""

    where: AreaRange
    value: bytes
    mask: int = _ALL_BITS


def write_memory(session: Session, image_crc: int, values: Sequence[Write]) -> int:
    """Writes all values, in one request if they fit, to the application with this CRC; in parts what is too long for
    one. Returns the number of requests.

    Not repeated when it is unknown whether they were written.
    """
    session.recover(session.application)
    room = session.connection.buffer_size - _MESSAGE_OVERHEAD
    message, requests = b"", 0
    parts = (part for value in values for part in _parts(value, room))
    for index, write in enumerate(parts):
        entry = _entry(write, index)
        if message and len(message) + len(entry) > room:
            _write_batch(session, image_crc, message)
            message, requests = b"", requests + 1
        message += entry
    if message:
        _write_batch(session, image_crc, message)
        requests += 1
    return requests


def _entry(write: Write, number: int) -> bytes:
    code = _address_code(write.where)
    if write.mask != _ALL_BITS:
        code += bytes([lib.MON2_OP_MASK, write.mask])
    return _VALUE_HEAD.pack(id=number, size=len(write.value)) + write.value + struct.pack("<H", len(code)) + code


def _parts(write: Write, room: int) -> Iterator[Write]:
    """A value in parts that fit a request."""
    further = len(_load(_FAR)) - len(_load(0))  # an offset may need a longer code
    most = room - _VALUE_HEAD.size - struct.calcsize("<H") - len(_address_code(write.where)) - further
    if len(write.value) <= most:
        yield write
        return
    for at in range(0, len(write.value), most):
        value = write.value[at : at + most]
        yield Write(write.where.part(at, len(value)), value, write.mask)


def _write_batch(session: Session, image_crc: int, entries: bytes) -> None:
    reply = _send_list(session, image_crc, lib.SRV_MON2_WRITE, bintag.raw(lib.TAG_MON2_WRITE_LIST, entries))
    _check_monitoring(session, reply, "write")


def _send_list(session: Session, image_crc: int, service: int, entries: bintag.Tag) -> bintag.Tags:
    def request() -> bintag.Tags:
        return session.call(lib.SG_MONITORING2, service, [_application_tag(session, image_crc), entries])

    return session.recover(request, repeatable=False)


# ---- forced variables ------------------------------------------------------------------------------------------------


def force_memory(session: Session, image_crc: int, places: Sequence[ForcedPlace]) -> None:
    """Forces the values in the application with this CRC: all of them, or none if they fit one request.

    Not repeated when it is unknown whether it was done. Raises DeviceError, whose result is MONITORING_ERR_*.
    """
    _change_forces(session, image_crc, lib.SRV_MON2_FORCE, places)


def unforce_memory(session: Session, image_crc: int, places: Sequence[ForcedPlace]) -> None:
    """Ends the force of these places."""
    _change_forces(session, image_crc, lib.SRV_MON2_UNFORCE, places)


def _change_forces(session: Session, image_crc: int, service: int, places: Sequence[ForcedPlace]) -> None:
    session.recover(session.application)
    most = (session.connection.buffer_size - _MESSAGE_OVERHEAD) // _FORCED.size
    entries = [_forced_entry(place) for place in places]
    for first in range(0, len(entries), most):
        forced = bintag.raw(lib.TAG_MON2_FORCED, b"".join(entries[first : first + most]))
        with _explained():
            reply = _send_list(session, image_crc, service, forced)
        _check_monitoring(session, reply, "force")


def _forced_entry(place: ForcedPlace) -> bytes:
    if len(place.hops) > lib.PLACE_POINTERS:
        raise _monitoring_error("force", lib.MONITORING_ERR_NESTING_DEPTH)
    offsets = (place.offset, *place.hops, *(0,) * (lib.PLACE_POINTERS - len(place.hops)))
    return _FORCED.pack(
        area=place.area,
        pointers=len(place.hops),
        size=place.size,
        mask=place.mask,
        offset=_OFFSETS.pack(*offsets),
        value=int.from_bytes(place.value, "little"),
    )


def read_forced(session: Session) -> ForceList:
    """What is forced."""

    def request(start: int) -> bintag.Tags:
        return session.call(lib.SG_MONITORING2, lib.SRV_MON2_FORCE_LIST, [bintag.u32(lib.TAG_MON2_FORCE_START, start)])

    with _explained():
        reply = session.recover(lambda: request(0))
    serial, room = reply.u32(lib.TAG_MON2_FORCE_SERIAL), reply.u32(lib.TAG_MON2_FORCE_MAX)
    places: list[ForcedPlace] = []
    while found := [_forced_place(entry) for entry in _FORCED.unpack_each(reply.find(lib.TAG_MON2_FORCED) or b"")]:
        places += found
        if len(places) >= room:
            break
        reply = session.recover(partial(request, len(places)))
    return ForceList(serial, room, places)


def _forced_place(entry: Any) -> ForcedPlace:
    offset, *hops = _OFFSETS.unpack(entry.offset)
    return ForcedPlace(
        entry.area,
        offset,
        tuple(hops[: entry.pointers]),
        entry.size,
        entry.mask,
        entry.value.to_bytes(8, "little")[: entry.size],
    )


@contextmanager
def _explained() -> Iterator[None]:
    """Says of a firmware without these services how it gets them."""
    try:
        yield
    except DeviceError as error:
        if error.result != lib.ERR_L7_UNKNOWNCMD:
            raise
        raise DeviceError(
            "This firmware cannot force variables, or is older than this plctool. Build it with FORCE_MAX and "
            "HAS_CmpForce (docs/force.md).",
            "no-force",
            error.result,
        ) from None


def _application_tag(session: Session, image_crc: int) -> bintag.Tag:
    application = session.application()
    if application.image_crc != image_crc:
        raise _application_changed(session)
    content = _APPLICATION.pack(session=application.session, data_guid=application.data_guid)
    return bintag.raw(lib.TAG_MON2_APPLICATION, content)


def _application_changed(session: Session) -> DeviceError:
    session.forget_application()
    return DeviceError("Another application was loaded meanwhile; try again with its symbols.", APP_CHANGED)


def _check_monitoring(session: Session, tags: bintag.Tags, action: str) -> None:
    if tags.find(lib.TAG_MON2_ERROR) is None:
        return
    error = tags.u32(lib.TAG_MON2_ERROR)
    if error == lib.ERR_APP_INVALID_DATAID:
        raise _application_changed(session)
    if error > lib.MONITORING_ERR_UNKNOWN:
        l7.check_result(error, action)
    raise _monitoring_error(action, error)


def _monitoring_error(action: str, error: int) -> DeviceError:
    name = l7.monitoring_error_name(error)
    if action == "write" and error == lib.MONITORING_ERR_UNSUPPORTED_OPERATOR:
        hint = "Its firmware may be too old to write single bits: write the whole byte or word."
        return DeviceError(f"The device refused the write: {name}. {hint}", l7.slug(name), error)
    if error == lib.MONITORING_ERR_OPERATION_DENIED:
        l7.check_result(lib.ERR_OPERATION_DENIED, action)
    outside = error in (lib.MONITORING_ERR_INVALID_AREA, lib.MONITORING_ERR_INVALID_INDEX)
    hint = " The program has no memory at one of the addresses." if outside else ""
    return DeviceError(f"The device refused the {action}: {name}.{hint}", l7.slug(name), error)
