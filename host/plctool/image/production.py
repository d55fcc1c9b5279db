"""What a production programmer burns: the flash of a device with its program, and with its firmware if wanted.

Where programs have a memory of their own, such as a serial EEPROM, a file is what that memory contains. Its addresses
are not those of the processor, so that the firmware is not in it, and only read for the facts of its board.

It is what the device itself leaves after a download that was not started yet: the image and its seal in slot A, and a
first commit record. What the programmer must not leave as it was is there as erased bytes: the logs, the catalog of
files, and the beginning of slot B.
"""

from __future__ import annotations

import io
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from intelhex import HexReaderError, IntelHex

from plctool.core import ffi, lib
from plctool.errors import UsageError
from plctool.files import write_atomically
from plctool.iec.types import align_up
from plctool.image.board import COMMIT, RETAIN, SLOT_A, SLOT_B, Board, Firmware, Flash, Segment
from plctool.image.file import TAG, built_for, describe_image, image_crc, parse_image, target_name

BIN, HEX = ".bin", ".hex"
_HEX_TYPE, _HEX_END = slice(7, 9), "01"  # where a line of a .hex says what it is, and that it is the last one
_FIRST = 1  # number of the first seal, and of the first record
_MOST_BIN = 64 * 1024 * 1024  # bytes; a file with more of them has mostly gaps
_ALIGN = int(lib.FILE_ALIGN)
_CATALOG_SECTORS = 2


@dataclass(frozen=True)
class Piece:
    """Bytes at an address, and what they are."""

    what: str
    segment: Segment


def production_pieces(image: bytes, board: Board, firmware: Firmware | None) -> list[Piece]:
    """All that is burned, by address: the firmware too, unless programs have a memory of their own. Raises UsageError
    when the image is for another processor, and when the firmware is where the programs are. Whether the image fits
    the board is for `io.fit`."""
    parsed = parse_image(image)
    if parsed.device_id != board.images_for:
        raise UsageError(
            f"The image is for {target_name(parsed.device_id)}, {board.title} needs {target_name(board.images_for)}; "
            f"build it {built_for(board.images_for)}.",
            "other-target",
        )
    pieces = list(_flash_pieces(image, board))
    if firmware is not None and board.flash.address is not None:
        _check_apart(firmware, board.flash, board.flash.address)
        pieces += [Piece("firmware", segment) for segment in firmware.segments]
    return sorted(pieces, key=lambda piece: piece.segment.address)


def _check_apart(firmware: Firmware, flash: Flash, address: int) -> None:
    """The firmware is nowhere in the sectors for programs and logs of the flash, which is at an address of the
    processor; beside them it may be, in a chip that has one flash for all."""
    used = _used(flash, address)
    for segment in firmware.segments:
        over = next((run for run in used if segment.address < run[1] and run[0] < segment.end), None)
        if over is not None:
            raise UsageError(
                f"The firmware at 0x{segment.address:08X} to 0x{segment.end - 1:08X} is over the flash for programs at "
                f"0x{over[0]:08X} to 0x{over[1] - 1:08X}; give the firmware less room in its "
                "linker script, or the programs another BOARD_FLASH_ADDRESS.",
                "overlap",
            )


def _used(flash: Flash, address: int) -> list[tuple[int, int]]:
    """Where programs, logs and files are: begin and end of each run of sectors."""
    runs: list[tuple[int, int]] = []
    for file in sorted(flash.parts(), key=lambda file: file.offset):
        begin, end = address + file.offset, address + file.offset + file.size
        if runs and runs[-1][1] == begin:
            begin = runs.pop()[0]
        runs.append((begin, end))
    return runs


def _flash_pieces(image: bytes, board: Board) -> Iterator[Piece]:
    flash = board.flash
    base = flash.address or 0

    def piece(what: str, file: int, data: bytes) -> Piece:
        return Piece(what, Segment(base + flash.files[file].offset, data))

    padding = bytes([flash.erased]) * (align_up(len(image), _ALIGN) - len(image))
    yield piece("program", SLOT_A, image + padding + _seal(image_crc(image)))
    yield piece("empty slot", SLOT_B, bytes([flash.erased]) * flash.sector_size)
    record = _commit_record(image, board)
    yield piece("commit log", COMMIT, record.ljust(flash.files[COMMIT].size, bytes([flash.erased])))
    yield piece("retain log", RETAIN, bytes([flash.erased]) * flash.files[RETAIN].size)
    if flash.store is not None:
        catalog = bytes([flash.erased]) * min(_CATALOG_SECTORS * flash.sector_size, flash.store.size)
        yield Piece("catalog of files", Segment(base + flash.store.offset, catalog))


def _seal(crc: int) -> bytes:
    seal = ffi.new("APP_SEAL *", {"number": _FIRST, "crc": crc})
    seal.check = lib.AppSealCheck(seal)
    return bytes(ffi.buffer(seal))


def _commit_record(image: bytes, board: Board) -> bytes:
    slots = [{"size": len(image), "crc": image_crc(image)}, {}]
    state = [lib.SLOT_TRIAL, lib.SLOT_EMPTY]
    commit = ffi.new("COMMIT *", {"active": SLOT_A, "state": state, "number": _FIRST, "slot": slots})
    data = bytes(ffi.buffer(commit)).ljust(board.record, b"\0")
    tag = lib.COMMIT_TAG + board.flash.files[SLOT_B].offset
    head = ffi.new(
        "FLASH_LOG_HEAD *", {"magic": lib.FLASH_LOG_MAGIC, "sequence": _FIRST, "tag": tag, "size": len(data)}
    )
    head.crc = zlib.crc32(bytes(ffi.buffer(head))[: ffi.offsetof("FLASH_LOG_HEAD", "crc")] + data)
    return bytes(ffi.buffer(head)) + data


# ---- files ----------------------------------------------------------------------------------------------------------


def write_production(path: Path, pieces: Iterable[Piece], board: Board) -> int | None:
    """Writes .hex: the pieces, or else everything from the first to the last byte. Returns the address that a .bin
    belongs to. Raises UsageError."""
    segments = [piece.segment for piece in pieces]
    if path.suffix.lower() == HEX:
        write_atomically(path, _hex(segments))
        return None
    start, end = _range(segments, board, path)
    write_atomically(path, _bin(segments, board.flash.erased, start, end))
    return start


def _hex(segments: list[Segment]) -> bytes:
    content, text = IntelHex(), io.StringIO()
    for segment in segments:
        content.frombytes(segment.data, segment.address)
    content.write_hex_file(text)
    return text.getvalue().encode("ascii")


def _range(segments: list[Segment], board: Board, path: Path) -> tuple[int, int]:
    """Begin and end of a .bin: with firmware, or in a memory of their own, all of the flash; else what programs and
    logs have of it, because firmware may be in the other sectors. Raises UsageError when that is no single range."""
    flash, base = board.flash, board.flash.address or 0
    used = _used(flash, base)
    if flash.address is None or any(_is_outside(segment, used) for segment in segments):
        start, end = min(base, segments[0].address), max(base + flash.size, segments[-1].end)
    elif len(used) == 1:
        return used[0]
    else:
        raise UsageError(
            f"A .bin has no gaps: it would erase 0x{used[0][1]:08X} to 0x{used[1][0] - 1:08X}, which is not for "
            f"programs: firmware may be there. Give its ELF file with --firmware, or write {path.with_suffix(HEX)}.",
            "bad-output",
        )
    if end - start > _MOST_BIN:
        raise UsageError(
            f"From 0x{start:08X} to 0x{end - 1:08X} is too much for a .bin, which has no gaps; write "
            f"{path.with_suffix(HEX)}, or leave --firmware out.",
            "bad-output",
        )
    return start, end


def _is_outside(segment: Segment, used: list[tuple[int, int]]) -> bool:
    return not any(begin <= segment.address < end for begin, end in used)


def _bin(segments: list[Segment], erased: int, start: int, end: int) -> bytes:
    data = bytearray([erased]) * (end - start)
    for segment in segments:
        data[segment.address - start : segment.end - start] = segment.data
    return bytes(data)


def is_production(path: Path) -> bool:
    """Whether the name is that of such a file."""
    return path.suffix.lower() in (BIN, HEX)


def describe_production(path: Path, data: bytes) -> dict[str, Any]:
    """What `plctool info` shows of a .bin or .hex: the parts with content, and the programs with their seals.
    "addresses" of a .bin are those in the "file": they count from its beginning. Raises UsageError when no program is
    in it."""
    segments = list(_segments(path, data))
    programs = [program for segment in segments for program in _programs(segment)]
    if not programs and data.startswith(b":") and path.suffix.lower() == BIN:
        raise UsageError(f"{path} looks like an Intel HEX file; name it {path.with_suffix(HEX)}.", "bad-image")
    if not programs:
        raise UsageError(
            f"{path} has no program of plctool in it, or not all of one; make it with 'plctool image'.", "bad-image"
        )
    parts = [{"address": f"{s.address:08X}", "size": len(s.data)} for s in segments]
    addresses = "file" if path.suffix.lower() == BIN else "memory"
    return {"file": str(path), "addresses": addresses, "parts": parts, "programs": programs}


def _segments(path: Path, data: bytes) -> Iterator[Segment]:
    if path.suffix.lower() == BIN:
        yield Segment(0, data)
        return
    content = IntelHex()
    try:
        text = data.decode("ascii")
        content.loadhex(io.StringIO(text))
    except HexReaderError as error:
        line = f" in line {error.line}" if hasattr(error, "line") else ""
        raise UsageError(f"{path} is not an Intel HEX file, or damaged{line}; write it again.", "bad-image") from None
    except UnicodeDecodeError:
        raise UsageError(
            f"{path} is not an Intel HEX file, or damaged; write it again, or name it {path.with_suffix(BIN)} if it is "
            "the bytes of a memory.",
            "bad-image",
        ) from None
    if not any(line[_HEX_TYPE] == _HEX_END for line in text.splitlines()):
        raise UsageError(f"{path} is cut off: its end record is missing; write or copy it again.", "bad-image")
    for start, end in content.segments():
        yield Segment(start, bytes(content.tobinarray(start=start, end=end - 1)))


def _programs(segment: Segment) -> Iterator[dict[str, Any]]:
    data, at = segment.data, 0
    while (at := data.find(TAG, at)) >= 0:
        image = _image_at(data, at)
        if image is None:
            at += len(TAG)
            continue
        yield {"address": f"{segment.address + at:08X}", "seal": _seal_number(data, at, image), **describe_image(image)}
        at += len(image)


def _image_at(data: bytes, at: int) -> bytes | None:
    size = ffi.offsetof("CDL_HEADER", "total_size")
    image = data[at : at + int.from_bytes(data[at + size : at + size + 4], "little")]
    try:
        parse_image(image)
    except UsageError:
        return None
    return image


def _seal_number(data: bytes, at: int, image: bytes) -> int | None:
    """The number of the seal after an image; None if there is no valid one: a device would not run it."""
    start = at + align_up(len(image), _ALIGN)
    seal = ffi.new("APP_SEAL *")
    raw = data[start : start + ffi.sizeof("APP_SEAL")]
    ffi.buffer(seal)[: len(raw)] = raw
    valid = seal.number and seal.crc == image_crc(image) and seal.check == lib.AppSealCheck(seal)
    return int(seal.number) if valid else None
