"""Objects that LLVM has made, in the user's cache folder, so that a build compiles what has changed only.

An object is found by a hash of all that it depends on, so that it is the one that LLVM would make again. It becomes
code of a controller. So the cache only has files that this user alone can write: what belongs to another user, or may
be written by one, is as good as not there, and so is what is damaged.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path

from plctool.files import cache_folder

LIMIT = 200 << 20  # bytes of all objects
LARGEST = 32 << 20  # bytes of one
_SHELVES = "0123456789abcdef"  # folders of the cache, by the first digit of a key: only one is looked at to make room
_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_DIGEST = sha256().digest_size
_READ = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0) | os.O_RDONLY
_FOLDER = _READ | getattr(os, "O_DIRECTORY", 0)
_NEW = os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_CLOEXEC", 0)


class ObjectCache:
    """The objects in a folder. `limit`: bytes that they may have together; the oldest go first."""

    def __init__(self, folder: Path | None = None, limit: int = LIMIT) -> None:
        self.folder = cache_folder() / "objects" if folder is None else folder
        self._shelf_limit = limit // len(_SHELVES)

    def get(self, key: str) -> bytes | None:
        """The object with this key; None if there is none, or none that can be trusted."""
        with self._shelf(key) as shelf:
            if shelf is None:
                return None
            try:
                content = _read(key, shelf)
            except OSError:
                return None
            data = content[_DIGEST:]
            if content[:_DIGEST] != _digest(key, data):
                return None
            with suppress(OSError):
                os.utime(key, dir_fd=shelf)
            return data

    def put(self, key: str, data: bytes) -> None:
        """Keeps an object. A cache that cannot be written stays as it is: everything works without one as well."""
        if len(data) > min(LARGEST, self._shelf_limit):
            return
        with self._shelf(key, make=True) as shelf:
            if shelf is None:
                return
            temporary = f".{key}.{os.getpid()}"
            try:
                with open(os.open(temporary, _NEW, 0o600, dir_fd=shelf), "wb") as file:
                    file.write(_digest(key, data) + data)
                os.replace(temporary, key, src_dir_fd=shelf, dst_dir_fd=shelf)
                _make_room(shelf, self._shelf_limit)
            except OSError:
                with suppress(OSError):
                    os.unlink(temporary, dir_fd=shelf)

    def usable(self) -> bool:
        """True if builds use this folder, or would make it."""
        if not hasattr(os, "getuid"):
            return False
        try:
            return _is_own(os.lstat(self.folder))
        except FileNotFoundError:
            return True
        except OSError:
            return False

    def size(self) -> tuple[int, int]:
        """How many objects there are, and their bytes."""
        sizes = [status.st_size for _, _, status in self._all()]
        return len(sizes), sum(sizes)

    def clear(self) -> tuple[int, int]:
        """Deletes all objects. Returns how many there were, and their bytes."""
        count = size = 0
        for shelf, name, status in self._all():
            with suppress(OSError):
                os.unlink(name, dir_fd=shelf)
                count, size = count + 1, size + status.st_size
        return count, size

    def _all(self) -> Iterator[tuple[int, str, os.stat_result]]:
        for digit in _SHELVES:
            with self._shelf(digit) as shelf:
                if shelf is not None:
                    yield from ((shelf, name, status) for name, status in _files(shelf))

    @contextmanager
    def _shelf(self, key: str, *, make: bool = False) -> Iterator[int | None]:
        """The folder for a key, opened; None if it cannot be used."""
        shelf = _opened(self.folder, self.folder / key[0], make)
        try:
            yield shelf
        finally:
            if shelf is not None:
                os.close(shelf)


def cache_of_user() -> ObjectCache | None:
    """The cache; None if it cannot be trusted, and where the system does not tell who owns a file."""
    cache = ObjectCache()
    return cache if cache.usable() else None


def _opened(folder: Path, shelf: Path, make: bool) -> int | None:
    """A folder within another, both of this user alone."""
    try:
        if make:
            folder.parent.mkdir(parents=True, exist_ok=True)
            for path in (folder, shelf):
                with suppress(FileExistsError):
                    path.mkdir(mode=0o700)
        outer = os.open(folder, _FOLDER)
        try:
            inner = os.open(shelf.name, _FOLDER, dir_fd=outer)
            if _is_own(os.fstat(outer)) and _is_own(os.fstat(inner)):
                return inner
            os.close(inner)
        finally:
            os.close(outer)
    except OSError:
        pass
    return None


def _is_own(status: os.stat_result) -> bool:
    """True for what this user alone can write and read."""
    return status.st_uid == os.geteuid() and not status.st_mode & _OTHERS


def _read(name: str, folder: int) -> bytes:
    """The content of a file. Raises OSError for one that is not this user's alone."""
    with open(os.open(name, _READ | getattr(os, "O_NONBLOCK", 0), dir_fd=folder), "rb") as file:
        status = os.fstat(file.fileno())
        if not (stat.S_ISREG(status.st_mode) and _is_own(status) and status.st_size <= LARGEST + _DIGEST):
            raise PermissionError(name)
        return file.read(LARGEST + _DIGEST)


def _digest(key: str, data: bytes) -> bytes:
    return sha256(key.encode() + b"\n" + data).digest()


def _files(folder: int) -> list[tuple[str, os.stat_result]]:
    """Names and facts of the files in a folder."""
    found = []
    for name in os.listdir(folder):
        with suppress(OSError):  # another build has just deleted it
            found.append((name, os.stat(name, dir_fd=folder, follow_symlinks=False)))
    return found


def _make_room(folder: int, limit: int) -> None:
    """Deletes the objects that were not used for the longest time, until the others have no more than `limit` bytes."""
    files = sorted(_files(folder), key=lambda file: file[1].st_mtime_ns, reverse=True)
    total = 0
    for name, status in files:
        total += status.st_size
        if total > limit:
            with suppress(OSError):
                os.unlink(name, dir_fd=folder)
