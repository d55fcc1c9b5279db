"""Reads a library that is a .zip. Nothing is unpacked to disk, and what it can make this process do is limited.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import lzma
import stat
import zipfile
import zlib
from functools import lru_cache
from pathlib import Path, PurePosixPath

from plctool.errors import UsageError
from plctool.project import LIBRARY_FILE

MAX_FILES = 10_000
MAX_BYTES = 64 << 20
"""Unpacked, of all files together."""

_ENCRYPTED = 1
_BROKEN = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError, RuntimeError, ValueError)


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
            infos = [info for info in archive.infolist() if not info.is_dir()]
            _check(path, infos)
            wanted = [info for info in infos if _is_wanted(info.filename)]
            return _without_folder(path, {info.filename: archive.read(info) for info in wanted})
    except UsageError:
        raise
    except _BROKEN as error:
        raise _refused(path, f"cannot be read as a .zip: {error}; make it again") from None


def _refused(path: Path, why: str) -> UsageError:
    return UsageError(f"{path} {why}.", "bad-library")


def _check(path: Path, infos: list[zipfile.ZipInfo]) -> None:
    """Before anything is unpacked. The sizes are those that it states; what unpacks to more is no valid .zip."""
    if len(infos) > MAX_FILES:
        raise _refused(path, f"has {len(infos)} files; a library has at most {MAX_FILES}")
    size = sum(info.file_size for info in infos)
    if size > MAX_BYTES:
        raise _refused(path, f"has {size >> 20} MiB of files; a library has at most {MAX_BYTES >> 20} MiB")
    names = set()
    for info in infos:
        name = info.filename
        if _leaves(name) or _leaves(info.orig_filename) or stat.S_ISLNK(info.external_attr >> 16):
            raise _refused(path, f"has the file '{name}', which leads out of it; make it again without that")
        if info.flag_bits & _ENCRYPTED:
            raise _refused(path, "is encrypted; make it again without a password")
        if name.casefold() in names:
            raise _refused(path, f"has the file '{name}' twice; make it again")
        names.add(name.casefold())


def _leaves(name: str) -> bool:
    """Whether a name is that of a file elsewhere, on any system."""
    parts = name.replace("\\", "/").split("/")
    return ".." in parts or parts[0] == "" or ":" in parts[0] or "\0" in name


def _is_wanted(name: str) -> bool:
    from plctool.compiler.source_files import READERS

    path = PurePosixPath(name)
    return path.name == LIBRARY_FILE or path.suffix.lower() in READERS


def _without_folder(path: Path, files: dict[str, bytes]) -> dict[Path, bytes]:
    """Archives of whole folders, such as those of version control, have it in front of all names."""
    if LIBRARY_FILE not in files:
        tops = {name.partition("/")[0] for name in files}
        if len(tops) == 1:
            top = tops.pop()
            files = {name.removeprefix(f"{top}/"): data for name, data in files.items()}
    return {path / name: data for name, data in sorted(files.items())}
