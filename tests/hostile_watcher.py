"""Requests of a hostile tool that forces and traces: places outside areas, lists without sense, names with markup."""

from __future__ import annotations

import random
from contextlib import suppress

from plctool.core import lib
from plctool.debug.forced import ForcedPlace
from plctool.device import Plc
from plctool.errors import PlcError
from plctool.link import bintag
from plctool.link.monitoring import force_memory, unforce_memory
from plctool.link.session import Session
from plctool.link.wire import Layout

_CONFIG = Layout("TRACE_CONFIG")
_PLACE = Layout("MON2_PLACE")
_NAMES = (
    b"",
    b"night",
    b"<b>x</b>",
    b"'\"><script>",
    b"../../etc/x",
    b"a\nb",
    b"\xff\xfe",
    b"%s%n%s%n",
    b"=1+1",
    b"x" * 16,
)


def act(plc: Plc, session: Session, image_crc: int, chooser: random.Random) -> None:
    """One request. Raises PlcError if the controller refuses it."""
    action = chooser.randrange(9)
    if action < 2:
        places = [_place(chooser) for _ in range(chooser.choice((1, 1, 1, 3, 200)))]
        chooser.choice((force_memory, force_memory, unforce_memory))(session, image_crc, places)
    elif action == 2:
        entries = chooser.randbytes(chooser.randrange(64))
        tags = [
            bintag.raw(lib.TAG_MON2_APPLICATION, chooser.randbytes(8)),
            bintag.raw(lib.TAG_MON2_FORCED, entries),
        ]
        session.call(lib.SG_MONITORING2, chooser.choice((lib.SRV_MON2_FORCE, lib.SRV_MON2_UNFORCE)), tags)
    elif action < 6:
        plc.create_trace(_damaged(_config(image_crc, chooser), chooser))
    elif action == 6:
        plc.read_trace(_packet(chooser), _number(chooser), [1] * chooser.randrange(97))
    elif action == 7:
        plc.delete_trace(_packet(chooser))
    else:
        kept = b"".join((bytes([chooser.randrange(256)]), _config(image_crc, chooser)))
        plc.write_file(f"trace.{chooser.choice('abc')}", _damaged(kept, chooser))


def end_all(plc: Plc) -> None:
    """What a user does who finds the controller so."""
    plc.unforce()
    packet = 0
    while (found := plc.next_trace(packet)) is not None:
        packet = found[0]
        with suppress(PlcError):  # it may end by itself
            plc.delete_trace(packet)


def _number(chooser: random.Random) -> int:
    return chooser.choice((0, 1, 8, chooser.randrange(1 << 10), 0x7FFFFFFF, 0xFFFFFFFF, chooser.randrange(1 << 32)))


def _packet(chooser: random.Random) -> int:
    return chooser.choice((0, 1, 2, 3, _number(chooser)))


def _place(chooser: random.Random) -> ForcedPlace:
    hops = tuple(_number(chooser) for _ in range(chooser.randrange(lib.PLACE_POINTERS + 1)))
    size = chooser.choice((1, 1, 2, 4, 8))
    area = chooser.choice((0, 0, 1, 2, 3, 4, 5, 9, lib.TRACE_SYSTEM, 0xFF))
    if chooser.random() < 0.5:
        return ForcedPlace(0, chooser.randrange(16), (), 1, 0xFF, chooser.randbytes(1))
    return ForcedPlace(area, _number(chooser), hops, size, chooser.choice((0xFF, 0xFF, 1, 0)), chooser.randbytes(8))


def _members(chooser: random.Random) -> dict[str, object]:
    place = _place(chooser)
    offsets = b"".join(offset.to_bytes(4, "little") for offset in (place.offset, *place.hops)).ljust(16, b"\0")
    size = chooser.choice((place.size, 0, 3, 255))
    return {
        "area": place.area, "pointers": chooser.choice((len(place.hops), 4, 255)), "size": size, "mask": place.mask,
        "offset": offsets,
    }  # fmt: skip


def _config(image_crc: int, chooser: random.Random) -> bytes:
    """Of a packet that is mostly one of bytes that are there, so that many are taken and record."""
    odd = chooser.random() < 0.5
    count = chooser.choice((1, 4, lib.TRACE_MAX_RECORDS, 0) if odd else (1, 4, 16))
    plain = {"area": 0, "pointers": 0, "size": 1, "mask": 0xFF, "offset": bytes(16)}
    head = _CONFIG.pack(
        image_crc=image_crc, name=chooser.choice(_NAMES)[:16], flags=chooser.randrange(32 if odd else 8),
        comparison=chooser.randrange(256 if odd else 8), task=chooser.choice((0, 255)) if odd else 0, records=count,
        every=_number(chooser) if odd else 1, samples=_number(chooser) if odd else 9,
        before=_number(chooser) if odd else 2,
        constant=chooser.randrange(1 << 64), **(_members(chooser) if odd else plain),
    )  # fmt: skip
    return head + b"".join(
        _PLACE.pack(**(_members(chooser) if odd and chooser.random() < 0.2 else plain)) for _ in range(count)
    )


def _damaged(config: bytes, chooser: random.Random) -> bytes:
    """Some bytes are others, or the end is missing."""
    if chooser.random() < 0.1:
        return config[: chooser.randrange(len(config) + 1)]
    changed = bytearray(config)
    for _ in range(chooser.choice((0, 0, 0, 1, 3))):
        changed[chooser.randrange(len(changed))] = chooser.randrange(256)
    return bytes(changed)
