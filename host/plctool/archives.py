"""Unpacks what others have packed: libraries that are a .zip, and the sources and symbols that a device keeps.

Nothing is unpacked to disk, and what an archive can make this process do is limited. Its reader decides what an error
is called.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import io
import stat
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable
from pathlib import PurePosixPath

MAX_FILES = 10_000
MAX_BYTES = 64 << 20
"""Unpacked, of all files together."""

_ENCRYPTED = 1
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Those of which zipfile unpacks no more than it is asked for."""
_OTHER_METHODS = {9: "deflate64", zipfile.ZIP_BZIP2: "bzip2", zipfile.ZIP_LZMA: "LZMA"}
_ENTRY = b"PK\1\2"  # begins each entry of the list of files
_BROKEN = (
    zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, OverflowError, RuntimeError, ValueError,
)  # fmt: skip
_GZIP = 16 + zlib.MAX_WBITS


class ArchiveError(Exception):
    """Why an archive is refused, as the end of a sentence that begins with its name, and what to do about it."""

    def __init__(self, why: str, advice: str = "make it again", *, too_large: bool = False) -> None:
        super().__init__(f"{why}; {advice}")
        self.why = why
        self.advice = advice
        self.too_large = too_large


def read_archive(data: bytes, wanted: Callable[[str], bool] = lambda name: True) -> dict[str, bytes]:
    """The files of a .zip whose names are wanted. Raises ArchiveError for one that is not a .zip, is too large, is
    compressed otherwise than by deflate, or has links, two files of one name or files outside itself."""
    _check_count(data.count(_ENTRY))
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            infos = [info for info in archive.infolist() if not info.filename.endswith("/")]
            _check(infos)
            return {info.filename: _content(archive, info) for info in infos if wanted(info.filename)}
    except _BROKEN as error:
        raise ArchiveError(f"cannot be read as a .zip: {error}") from None


def inflate(data: bytes, most: int, *, gzip: bool = False) -> bytes:
    """The content of a zlib or gzip stream. Raises ArchiveError if it is damaged or has more than `most` bytes."""
    stream = zlib.decompressobj(_GZIP if gzip else zlib.MAX_WBITS)
    try:
        content = stream.decompress(data, most + 1)
    except zlib.error as error:
        raise ArchiveError(f"cannot be unpacked: {error}") from None
    if len(content) > most:
        raise ArchiveError(f"unpacks to more than {most} bytes", too_large=True)
    if not stream.eof:
        raise ArchiveError("ends too early")
    return content


def inflate_all(parts: Iterable[bytes], most: int) -> list[bytes]:
    """The contents of several zlib streams, which have `most` bytes together. Raises ArchiveError as `inflate` does."""
    contents: list[bytes] = []
    for part in parts:
        contents.append(inflate(part, most))
        most -= len(contents[-1])
    return contents


def _content(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> bytes:
    """A file, of which no more is unpacked than the size that was checked."""
    with archive.open(info) as file:
        data = file.read(info.file_size)
    if len(data) != info.file_size:
        raise zipfile.BadZipFile(f"the size of '{info.filename}' is not {info.file_size}")
    return data


def _check_count(files: int) -> None:
    if files > MAX_FILES:
        raise ArchiveError(f"has {files} files, of at most {MAX_FILES}", too_large=True)


def _check(infos: list[zipfile.ZipInfo]) -> None:
    """Before anything is unpacked. The sizes are those that it states; a file of another size is no valid .zip."""
    _check_count(len(infos))
    size = sum(info.file_size for info in infos)
    if size > MAX_BYTES:
        raise ArchiveError(
            f"unpacks to {size} bytes, of at most {MAX_BYTES} bytes ({MAX_BYTES >> 20} MiB)", too_large=True
        )
    names: set[str] = set()
    for info in infos:
        _check_file(info)
        key = str(PurePosixPath(info.filename)).casefold()
        if key in names:
            raise ArchiveError(f"has the file '{info.filename}' twice")
        names.add(key)


def _check_file(info: zipfile.ZipInfo) -> None:
    name = info.filename
    if not name.isprintable():
        raise ArchiveError(f"has the file {name!a}, with control characters", "make it again without these")
    if _leaves(name) or _leaves(info.orig_filename) or stat.S_ISLNK(info.external_attr >> 16):
        raise ArchiveError(f"has the file '{name}', which leads out of it", "make it again without that")
    if info.flag_bits & _ENCRYPTED:
        raise ArchiveError("is encrypted", "make it again without a password")
    if info.compress_type not in _METHODS:
        what = _OTHER_METHODS.get(info.compress_type, str(info.compress_type))
        raise ArchiveError(f"has the file '{name}' in the compression {what}", "make it again with 'deflate'")


def _leaves(name: str) -> bool:
    """True for the name of a file elsewhere, on any system, and for the settings of git, which name commands."""
    parts = name.replace("\\", "/").split("/")
    return ".." in parts or parts[0] == "" or ":" in name or "\0" in name or ".git" in map(str.casefold, parts)
