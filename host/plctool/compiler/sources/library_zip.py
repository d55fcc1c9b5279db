"""Reads a library that is a .zip, in memory.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path, PurePosixPath

from plctool.archives import ArchiveError, read_archive
from plctool.errors import UsageError
from plctool.files import MAX_BINARY, read_regular
from plctool.project import LIBRARY_FILE

_SMALLER = "make it again without what is no source, or give it as a folder"


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
        return _without_folder(path, read_archive(read_regular(path, MAX_BINARY), _is_wanted))
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.", "bad-library") from None
    except ArchiveError as error:
        advice = _SMALLER if error.too_large else error.advice
        raise UsageError(f"{path} {error.why}; {advice}.", "bad-library") from None


def _is_wanted(name: str) -> bool:
    from plctool.compiler.sources.source_files import READERS

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
