"""The services of breakpoints (docs/protocol.md, group 0x12)."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from plctool.core import lib
from plctool.debug.forced import ForcedPlace
from plctool.debug.halted import BpStatus
from plctool.debug.target import DeviceCondition
from plctool.errors import DeviceError
from plctool.link import bintag, l7
from plctool.link.session import Session
from plctool.link.wire import Layout

_RECORD = Layout("BP_RECORD")
_STATE = Layout("BP_STATE")
_OFFSETS = struct.Struct("<4I")
_HITS = struct.Struct("<II")
_OVERHEAD = 96  # of a message, bytes


def _call(session: Session, service: int, *tags: bintag.Tag) -> bintag.Tags:
    with _explained():
        return session.recover(lambda: session.call(lib.SG_APPLICATION_BP, service, list(tags)))


def _do(session: Session, service: int, action: str, *tags: bintag.Tag) -> bintag.Tags:
    reply = _call(session, service, *tags)
    result = reply.u16(lib.TAG_SERVICE_RESULT)
    if result == lib.ERR_NOT_SUPPORTED:
        raise not_supported("it runs programs in place from flash. Build its firmware with CodeInRam.c")
    l7.check_result(result, action)
    return reply


def not_supported(reason: str) -> DeviceError:
    """The error of a controller without traps."""
    return DeviceError(
        f"Breakpoints are not supported on this device: {reason} (docs/debugging.md), or debug the program in the "
        "simulator.",
        "no-breakpoints",
    )


@contextmanager
def _explained() -> Iterator[None]:
    try:
        yield
    except DeviceError as error:
        if error.result not in (lib.ERR_L7_UNKNOWNCMDGROUP, lib.ERR_L7_UNKNOWNCMD):
            raise
        reason = "its firmware has none. Build it with BP_MAX and HAS_CmpAppBP"
        raise not_supported(reason) from None


def attach(session: Session, *, keep: bool) -> None:
    """A debugger is here."""
    _do(session, lib.SRV_BP_ATTACH, "breakpoint", bintag.u32(lib.TAG_BP_KEEP, int(keep)))


def detach(session: Session) -> None:
    """All breakpoints end, and what is halted goes on."""
    _do(session, lib.SRV_BP_DETACH, "breakpoint")


def status(session: Session) -> BpStatus:
    """What the controller says; it also says to the controller that the debugger is still here."""
    reply = _call(session, lib.SRV_BP_STATUS)
    found = _STATE.unpack(reply.bytes(lib.TAG_BP_STATE, _STATE.size))
    return BpStatus(
        bool(found.supported),
        bool(found.attached),
        bool(found.halted),
        found.serial,
        found.code,
        found.task,
        None if found.code_offset == lib.APP_NO_CODE_OFFSET else found.code_offset,
        found.stack_size,
        found.stack,
        tuple(int.from_bytes(found.area[at : at + 8], "little") for at in range(0, len(found.area), 8)),
        found.breakpoints,
        found.room,
        found.traps,
        None if found.link == lib.APP_NO_CODE_OFFSET else found.link,
    )


def set_breakpoint(session: Session, offset: int, skip: int, condition: DeviceCondition | None) -> None:
    """Sets one, in place of the one at its offset."""
    _do(session, lib.SRV_BP_SET, "breakpoint", _record(offset, skip, condition))


def _record(offset: int, skip: int, condition: DeviceCondition | None) -> bintag.Tag:
    place = condition.place if condition else None
    hops = place.hops if place else ()
    content = _RECORD.pack(
        code_offset=offset,
        skip=skip,
        hits=0,
        relation=condition.relation if condition else lib.BP_ALWAYS,
        kind=condition.kind if condition else 0,
        area=place.area if place else 0,
        pointers=len(hops),
        size=place.size if place else 0,
        mask=place.mask if place else 0,
        offset=_OFFSETS.pack(*([place.offset if place else 0, *hops] + [0] * 4)[:4]),
        value=int.from_bytes(place.value if place else b"", "little"),
    )
    return bintag.raw(lib.TAG_BP_RECORD, content)


def clear_breakpoint(session: Session, offset: int) -> None:
    _do(session, lib.SRV_BP_CLEAR, "breakpoint", bintag.u32(lib.TAG_BP_OFFSET, offset))


def read_hits(session: Session) -> dict[int, int]:
    """How often each breakpoint was met."""
    found: dict[int, int] = {}
    while True:
        reply = _call(session, lib.SRV_BP_LIST, bintag.u32(lib.TAG_BP_START, len(found)))
        content = reply.find(lib.TAG_BP_OFFSETS)
        more = dict(_HITS.iter_unpack(content)) if isinstance(content, bytes) and len(content) % _HITS.size == 0 else {}
        if not more.keys() - found.keys():
            return found
        found |= more


def set_temporary(session: Session, offsets: Sequence[int]) -> None:
    """The temporary traps from now on."""
    for at, tag in _parts(session, offsets):
        _do(session, lib.SRV_BP_TEMPORARY, "step", tag, bintag.u32(lib.TAG_BP_MORE, int(at > 0)))


def _parts(session: Session, offsets: Sequence[int]) -> Iterator[tuple[int, bintag.Tag]]:
    """As many as fit into a message, and the index of the first."""
    most = (session.connection.buffer_size - _OVERHEAD) // 4
    for at in range(0, len(offsets), most):
        part = offsets[at : at + most]
        yield at, bintag.raw(lib.TAG_BP_OFFSETS, struct.pack(f"<{len(part)}I", *part))


def watch(session: Session, places: Sequence[ForcedPlace], offsets: Sequence[int]) -> None:
    """The variables that are compared from now on, and where. Raises DeviceError for firmware that does not."""
    more = bintag.u32(lib.TAG_BP_MORE, 1)
    try:
        _do(session, lib.SRV_BP_WATCH, "data breakpoint", bintag.u32(lib.TAG_BP_MORE, 0))
    except DeviceError:
        if places:
            raise
        return  # firmware without them has none to end
    for place in places:
        record = _record(0, 0, DeviceCondition(place, lib.BP_ALWAYS, 0))
        _do(session, lib.SRV_BP_WATCH, "data breakpoint", record, more)
    for _, tag in _parts(session, offsets):
        _do(session, lib.SRV_BP_WATCH, "data breakpoint", tag, more)


def go(session: Session, how: int, serial: int) -> None:
    """The halted task goes on from halt number `serial`."""
    _do(session, lib.SRV_BP_GO, "go", bintag.u32(lib.TAG_BP_HOW, how), bintag.u32(lib.TAG_BP_SERIAL, serial))


def pause(session: Session) -> None:
    _do(session, lib.SRV_BP_PAUSE, "pause")


def read_stack(session: Session, distance: int, size: int) -> bytes:
    """Bytes of the stack of the halted task, from `distance` bytes above its stack pointer on."""
    most = session.connection.buffer_size - _OVERHEAD
    parts = [(at, min(most, size - at)) for at in range(0, size, most)]
    return b"".join(_read_part(session, distance + at, length) for at, length in parts)


def _read_part(session: Session, distance: int, size: int) -> bytes:
    tags = [bintag.u32(lib.TAG_BP_DISTANCE, distance), bintag.u32(lib.TAG_BP_SIZE, size)]
    return _do(session, lib.SRV_BP_READ_STACK, "read", *tags).bytes(lib.TAG_BP_DATA, size)


def write_stack(session: Session, distance: int, data: bytes) -> None:
    tags = [bintag.u32(lib.TAG_BP_DISTANCE, distance), bintag.raw(lib.TAG_BP_DATA, data)]
    _do(session, lib.SRV_BP_WRITE_STACK, "write", *tags)
