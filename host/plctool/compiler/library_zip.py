"""Reads a library that is a .zip. Nothing is unpacked to disk, and what it can make this process do is limited.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import stat
import struct
import zipfile
import zlib
from functools import lru_cache
from pathlib import Path, PurePosixPath

from plctool.errors import UsageError
from plctool.project import LIBRARY_FILE

MAX_FILES = 10_000
MAX_BYTES = 64 << 20
"""Unpacked, of all files together."""

_SMALLER = "make it again without what is no source, or give it as a folder"
_ENCRYPTED = 1
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Those of which zipfile unpacks no more than it is asked for."""
_OTHER_METHODS = {9: "deflate64", zipfile.ZIP_BZIP2: "bzip2", zipfile.ZIP_LZMA: "LZMA"}
_BROKEN = (
    zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, OverflowError, RuntimeError, ValueError,
)  # fmt: skip


def is_zip(path: Path) -> bool:
    """Whether a path names a .zip."""
    return path.suffix.lower() == ".zip"


def read_zip(path: Path) -> dict[Path, bytes]:
    """The sources in a .zip and its library.toml, by `util.zip/pump.st`; of one whose files are all in one folder,
    without that. Raises UsageError for what is not a .zip, is too large or has files outside itself."""
    try:
        changed = path.stat().st_mtime_ns
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.", "bad-library") from None
    return _read(path, changed)


@lru_cache(maxsize=16)
def _read(path: Path, changed: int) -> dict[Path, bytes]:
    try:
        with zipfile.ZipFile(path) as archive:
            infos = [info for info in archive.infolist() if not info.filename.endswith("/")]
            _check(path, infos)
            wanted = [info for info in infos if _is_wanted(info.filename)]
            return _without_folder(path, {info.filename: _content(archive, info) for info in wanted})
    except UsageError:
        raise
    except _BROKEN as error:
        raise _refused(path, f"cannot be read as a .zip: {error}; make it again") from None


def _content(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> bytes:
    """A file, of which no more is unpacked than the size that was checked."""
    with archive.open(info) as file:
        data = file.read(info.file_size)
    if len(data) != info.file_size:
        raise zipfile.BadZipFile(f"the size of '{info.filename}' is not {info.file_size}")
    return data


def _refused(path: Path, why: str) -> UsageError:
    return UsageError(f"{path} {why}.", "bad-library")


def _check(path: Path, infos: list[zipfile.ZipInfo]) -> None:
    """Before anything is unpacked. The sizes are those that it states; a file of another size is no valid .zip."""
    if len(infos) > MAX_FILES:
        raise _refused(path, f"has {len(infos)} files; a library has at most {MAX_FILES}: {_SMALLER}")
    size = sum(info.file_size for info in infos)
    if size > MAX_BYTES:
        limit = f"{MAX_BYTES} bytes ({MAX_BYTES >> 20} MiB)"
        raise _refused(path, f"unpacks to {size} bytes; a library has at most {limit}: {_SMALLER}")
    names: set[str] = set()
    for info in infos:
        name, key = info.filename, str(PurePosixPath(info.filename)).casefold()
        if not name.isprintable():
            raise _refused(path, f"has the file {name!a}, with control characters; make it again without these")
        if _leaves(name) or _leaves(info.orig_filename) or stat.S_ISLNK(info.external_attr >> 16):
            raise _refused(path, f"has the file '{name}', which leads out of it; make it again without that")
        if info.flag_bits & _ENCRYPTED:
            raise _refused(path, "is encrypted; make it again without a password")
        if info.compress_type not in _METHODS:
            what = _OTHER_METHODS.get(info.compress_type, str(info.compress_type))
            raise _refused(path, f"has the file '{name}' in the compression {what}; make it again with 'deflate'")
        if key in names:
            raise _refused(path, f"has the file '{name}' twice; make it again")
        names.add(key)


def _leaves(name: str) -> bool:
    """Whether a name is that of a file elsewhere, on any system."""
    parts = name.replace("\\", "/").split("/")
    return ".." in parts or parts[0] == "" or ":" in parts[0] or "\0" in name


def _is_wanted(name: str) -> bool:
    from plctool.compiler.source_files import READERS

    path = PurePosixPath(name)
    if path.parts[:1] == ("__MACOSX",):  # what macOS knows of the files beside them
        return False
    return path.name == LIBRARY_FILE or path.suffix.lower() in READERS


def _without_folder(path: Path, files: dict[str, bytes]) -> dict[Path, bytes]:
    """Archives of whole folders, such as those of version control, have it in front of all names."""
    if LIBRARY_FILE not in files:
        tops = {name.partition("/")[0] for name in files}
        if len(tops) == 1:
            top = tops.pop()
            files = {name.removeprefix(f"{top}/"): data for name, data in files.items()}
    return {path / name: data for name, data in sorted(files.items())}
