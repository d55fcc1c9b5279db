"""The file services (group 8, docs/protocol.md): what a device keeps for its tools, its program and its log."""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from plctool.core import lib
from plctool.errors import DeviceError, UsageError
from plctool.link import bintag, l7
from plctool.link.channel import ChannelLost
from plctool.link.connection import ERASE_PATIENCE, SLOW_PATIENCE
from plctool.link.services import look
from plctool.link.session import Session
from plctool.link.wire import Layout

SOURCE_NAME = "Source.zip"
SYMBOLS_NAME = "Application.sym.gz"

_T = TypeVar("_T")
_CONTENT = Layout("FILE_CONTENT")
_POSITION = Layout("FILE_POSITION")
_TRIES = 4  # of a file whose channel was lost, or that changed while it was read
_BLOCK_OVERHEAD = 48  # layer 7 header and tags around a part, bytes
_MOST_BYTES = 1 << 28  # of a file, whatever a device says
_PART = "[A-Za-z0-9_-][A-Za-z0-9._-]*"
_NAME = re.compile(rf"(?=.{{1,{lib.FILE_NAME_MAX}}}\Z){_PART}(?:/{_PART})*")
_FOLDER = re.compile(rf"(?=.{{1,{lib.FILE_NAME_MAX}}}\Z)(?:{_PART}/)+")

_WHY = {
    lib.ERR_NO_OBJECT: "it has no such file; 'plctool files list' shows what there is",
    lib.ERR_PARAMETER: (
        f"no file can have this name: up to {lib.FILE_NAME_MAX} letters, digits and . _ -, with / after each folder"
    ),
    lib.ERR_DUPLICATE: "a folder has this name, or a file that of its folder; take another one",
    lib.ERR_ENTRIES_REMAINING: "the folder is not empty; delete its files first",
    lib.ERR_DISK_FULL: "there is no room for it; delete others with 'plctool files delete'",
    lib.ERR_OPERATION_DENIED: "the device makes this file itself; it can only be read",
    lib.ERR_NO_CONSISTENCY: "it changed while it was read; try again",
    lib.ERR_INVALID_STATE: "another tool or the program is writing a file; try again when it is done",
    lib.ERR_FT_CRC_MISMATCH: "it did not arrive as it was sent; try again",
    lib.ERR_CALL_AGAIN: "the program runs; stop it with 'plctool stop', and put the file again",
    lib.ERR_APP_NOT_LOADED: "the device has no program with retain variables; flash the one that saved the file",
    lib.ERR_VERSION_MISMATCH: "another program saved it; flash that one, or write single values with 'plctool write'",
    lib.ERR_CRC_FAILED: "it is damaged, or not a file of retain variables; take one of 'plctool files get Retain.bin'",
    lib.ERR_DEVICE: "its flash has failed, or it has no room for files",
}

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class DeviceFile:
    """A file on a device; `fixed`: the device makes it itself."""

    name: str
    size: int
    crc: int
    fixed: bool


@dataclass(frozen=True)
class FileList:
    """`room`: bytes of the largest file that can be added."""

    files: list[DeviceFile]
    room: int


def list_files(session: Session) -> FileList:
    found: dict[str, DeviceFile] = {}
    start = 0
    while True:
        position = bintag.u32(lib.TAG_FILE_START, start)
        tags = session.recover(partial(_call, session, lib.SRV_FILE_DIRECTORY, position))
        _check(tags, "list of files")
        for batch in tags.containers(lib.TAG_FILE_LIST):
            for entry in batch.containers(lib.TAG_FILE_ENTRY):
                content = _CONTENT.unpack(entry.bytes(lib.TAG_FILE_ENTRY_CONTENT, _CONTENT.size))
                name = entry.text(lib.TAG_FILE_ENTRY_NAME)
                fixed = bool(entry.u32(lib.TAG_FILE_ENTRY_FIXED))
                found[name] = DeviceFile(name, content.size, content.crc, fixed)
        after = tags.u32(lib.TAG_FILE_START)
        if after <= start:
            return FileList(list(found.values()), tags.u32(lib.TAG_FILE_ROOM))
        start = after


def read_file(session: Session, name: str, progress: Progress = lambda done, total: None) -> bytes:
    """The content of a file. Raises DeviceError when there is none, or it does not stay the same long enough."""
    _check_name(name)
    with session.transferring(f"reading {name}"):
        return _again(session, lambda: _read_once(session, name, progress))


def _read_once(session: Session, name: str, progress: Progress) -> bytes:
    action = f"reading of {name}"
    started = _started(_call(session, lib.SRV_FILE_START_UPLOAD, bintag.text(lib.TAG_FILE_NAME, name)), action)
    content = _CONTENT.unpack(started.bytes(lib.TAG_FILE_CONTENT, _CONTENT.size))
    handle = started.u32(lib.TAG_FILE_HANDLE)
    if content.size > _MOST_BYTES:
        raise DeviceError(f"The device says that {name} has {content.size} bytes, which cannot be.", "bad-file")
    data = b""
    while len(data) < content.size:
        position = _POSITION.pack(handle=handle, offset=len(data))
        tags = _call(session, lib.SRV_FILE_UPLOAD, bintag.raw(lib.TAG_FILE_POSITION, position))
        _check(tags, action)
        count = tags.u32(lib.TAG_FILE_COUNT)
        if not 0 < count <= content.size - len(data):
            break
        data += tags.bytes(lib.TAG_FILE_POSITION, count)[:count]
        progress(len(data), content.size)
    if len(data) != content.size or zlib.crc32(data) != content.crc:
        l7.check_result(lib.ERR_FT_CRC_MISMATCH, action, _WHY[lib.ERR_FT_CRC_MISMATCH])
    _call(session, lib.SRV_FILE_END, bintag.u32(lib.TAG_FILE_END, handle))
    return data


def write_file(session: Session, name: str, data: bytes, progress: Progress = lambda done, total: None) -> None:
    """Puts a file in place of the previous one of its name, which stays until all of the new one is there."""
    _check_name(name)
    with session.transferring(f"writing {name}"):
        _again(session, lambda: _write_once(session, name, data, progress))


def _write_once(session: Session, name: str, data: bytes, progress: Progress) -> None:
    action = f"writing of {name}"
    content = bintag.raw(lib.TAG_FILE_CONTENT, _CONTENT.pack(crc=zlib.crc32(data), size=len(data)))
    started = _call(session, lib.SRV_FILE_START_DOWNLOAD, bintag.text(lib.TAG_FILE_NAME, name), content)
    handle = _started(started, action).u32(lib.TAG_FILE_HANDLE)
    block = session.connection.best_size - _BLOCK_OVERHEAD
    for offset in range(0, len(data), block):
        part = data[offset : offset + block]
        position = _POSITION.pack(handle=handle, offset=offset)
        _check(_call(session, lib.SRV_FILE_DOWNLOAD, bintag.raw(lib.TAG_FILE_POSITION, position + part)), action)
        progress(offset + len(part), len(data))
    end = bintag.u32(lib.TAG_FILE_END, handle)
    _check(_call(session, lib.SRV_FILE_END, end, patience=SLOW_PATIENCE), action)


def delete_file(session: Session, name: str) -> None:
    """Deletes a file, or a folder that is empty: its name ends with a /."""
    if not _FOLDER.fullmatch(name):
        _check_name(name)
    look(session)
    named = bintag.text(lib.TAG_FILE_NAME, name)

    def delete() -> None:
        _check(_call(session, lib.SRV_FILE_DELETE, named, patience=SLOW_PATIENCE), f"deleting of {name}")

    session.finish(delete, lib.ERR_NO_OBJECT)


def _check_name(name: str) -> None:
    if not _NAME.fullmatch(name):
        raise UsageError(f"{name!r} is not the name of a file on a device: {_WHY[lib.ERR_PARAMETER]}.", "bad-name")


def _again(session: Session, action: Callable[[], _T]) -> _T:
    """From the beginning when the channel was lost, or the file changed meanwhile: handles end with their session."""
    for left in reversed(range(_TRIES)):
        try:
            session.ensure()
            return action()
        except ChannelLost as error:
            if not left or error.code == "no-answer":
                raise
        except DeviceError as error:
            if not left or error.result not in (lib.ERR_NO_CONSISTENCY, lib.ERR_INVALID_HANDLE):
                raise
    raise AssertionError("the last try returns or raises")


def _call(session: Session, service: int, *tags: bintag.Tag, patience: float = ERASE_PATIENCE) -> bintag.Tags:
    try:
        return session.call(lib.SG_FILE_TRANSFER, service, tags, patience)
    except DeviceError as error:
        if error.result not in (lib.ERR_L7_UNKNOWNCMDGROUP, lib.ERR_L7_UNKNOWNCMD):
            raise
        raise DeviceError(
            "The firmware of this device keeps no files; build one with FILE_STORE_FILES (docs/porting.md).",
            "no-files",
            error.result,
        ) from None


def _check(tags: bintag.Tags, action: str) -> None:
    if tags.find(lib.TAG_FILE_RESULT) is not None:
        result = tags.u16(lib.TAG_FILE_RESULT)
        l7.check_result(result, action, _WHY.get(result, ""))


def _started(tags: bintag.Tags, action: str) -> bintag.Tags:
    started = tags.container(lib.TAG_FILE_STARTED)
    _check(started, action)
    return started
