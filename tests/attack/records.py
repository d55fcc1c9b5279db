"""Hostile records in the logs of commits and retain variables, whose CRC is right."""

from __future__ import annotations

import random
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

from campaign import BEFORE, NEWEST, NOTHING, STOPPED, Campaign, Case, Fallen
from look import Seen
from simulated import Flash, Geometry
from verdict import check_can_be_flashed, look_again
from workshop import GOOD_NAMES

from plctool.core import ffi, lib
from plctool.link.services import AppState

COUNT = 300
ALIGN = 16  # FILE_ALIGN: where records begin
WORDS = (0, 1, 2, 3, 0xFE, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFF0, 0xFFFFFFFF)
LOGS = ("commit", "retain")
NO_SLOT = 0xFF  # as the first byte of a commit record: there is no program, by the user's will


@dataclass(frozen=True)
class Record:
    """One that is at `offset` of the flash."""

    offset: int
    sequence: int
    tag: int
    data: bytes

    @property
    def end(self) -> int:
        return self.offset + -(-(int(lib.FLASH_LOG_HEAD_SIZE) + len(self.data)) // ALIGN) * ALIGN

    def encode(self, size: int | None = None) -> bytes:
        """The bytes in flash; `size`: what the head says, if not the truth."""
        head = ffi.new("FLASH_LOG_HEAD *")
        head.magic, head.sequence, head.tag = lib.FLASH_LOG_MAGIC, self.sequence, self.tag
        head.size = len(self.data) if size is None else size
        words = bytes(ffi.buffer(head))[: ffi.offsetof("FLASH_LOG_HEAD", "crc")]
        head.crc = zlib.crc32(words + self.data)
        return bytes(ffi.buffer(head)) + self.data


def records(content: bytes) -> Iterator[Record]:
    """All valid records in a flash, in the order of their places."""
    offset = 0
    while offset + lib.FLASH_LOG_HEAD_SIZE <= len(content):
        head = ffi.new("FLASH_LOG_HEAD *")
        ffi.buffer(head)[:] = content[offset : offset + lib.FLASH_LOG_HEAD_SIZE]
        begin = offset + int(lib.FLASH_LOG_HEAD_SIZE)
        record = Record(offset, head.sequence, head.tag, content[begin : begin + head.size])
        if head.magic == lib.FLASH_LOG_MAGIC and record.encode() == content[offset : begin + head.size]:
            yield record
            offset = record.end
        else:
            offset += ALIGN


class Records(Campaign):
    name = "record"
    promise = "a record may hold anything: a whole program runs, or it is stopped with the reason"
    short = 15

    def cases(self) -> list[Case]:
        return [
            Case(f"hostile record {number} in the {log} log", (log, number))
            for number in range(COUNT)
            for log in (LOGS[number % 2],)
        ]

    def run(self, case: Case) -> str:
        log, number = case.data
        geometry = Geometry()
        content = bytearray(self.shop.history(geometry, "good1", "good2"))
        hostile = _spoil(random.Random(f"{self.shop.seed} {number}"), content, self._newest(content, log))
        may_be_none = log == "commit" and any(record.data[0] == NO_SLOT for record in hostile)
        flash = Flash(geometry)
        flash.load(bytes(content))
        outcome = self._judge(look_again(self.shop, flash), log, may_be_none)
        check_can_be_flashed(self.shop, flash)
        return outcome

    def _newest(self, content: bytearray, log: str) -> Record:
        """The newest record of a log: those of commits name images by their CRC."""
        crcs = [self.shop[name].crc.to_bytes(4, "little") for name in GOOD_NAMES]
        found = [r for r in records(bytes(content)) if any(crc in r.data for crc in crcs) == (log == "commit")]
        return max(found, key=lambda r: r.sequence)

    def _judge(self, seen: Seen, log: str, may_be_none: bool) -> str:
        """Values of retain variables may be anything then, so they are not looked at."""
        if may_be_none and seen.state is AppState.NONE:
            return NOTHING
        program = self.shop.by_crc(seen.crc)
        if seen.state is AppState.RUN and program and seen.cycles:
            if program.name == "good2":
                return NEWEST
            if log == "commit" and program.name == "good1":
                return BEFORE
        if log == "commit" and seen.state is AppState.STOP and seen.causes:
            return STOPPED
        raise Fallen(f"after a hostile record: {seen}")


def _spoil(rng: random.Random, content: bytearray, newest: Record) -> list[Record]:
    """Puts hostile records in place of the newest one of a log, or after it; returns them."""
    hostile: list[Record] = []
    at = newest.offset if rng.random() < 0.3 else newest.end
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        record = replace(newest, offset=at, sequence=_sequence(rng, newest.sequence), data=_data(rng, newest.data))
        if rng.random() < 0.2:
            record = replace(record, tag=rng.choice((0, record.tag + 1, rng.getrandbits(32))) & 0xFFFFFFFF)
        size = rng.choice((None, None, None, None, rng.choice(WORDS)))
        encoded = record.encode(size)
        if record.end > len(content):
            break
        hostile.append(record)
        content[at : at + len(encoded)] = encoded
        at = record.end
    return hostile


def _sequence(rng: random.Random, newest: int) -> int:
    step = rng.choice((1, 1, 1, 1, 2, 0, -1, 1000, 0x7FFFFFFE, 0x7FFFFFFF, 0x80000000, rng.getrandbits(32)))
    return (newest + step) & 0xFFFFFFFF


def _data(rng: random.Random, newest: bytes) -> bytes:
    data = bytearray(newest)
    for _ in range(rng.choice((1, 1, 2, 4))):
        choice = rng.random()
        at = rng.randrange(len(data))
        if choice < 0.4:
            data[at & ~3 : (at & ~3) + 4] = rng.choice(WORDS).to_bytes(4, "little")
        elif choice < 0.8:
            data[at] = rng.choice((0, 1, 2, 3, 4, 5, 6, 7, 0x7F, 0x80, 0xFE, 0xFF, rng.getrandbits(8)))
        elif choice < 0.9:
            data = bytearray(rng.randbytes(len(data)))
        else:
            data = data[: rng.randrange(1, len(data) + 1)] + rng.randbytes(rng.choice((0, 0, 4, 64)))
    return bytes(data)
