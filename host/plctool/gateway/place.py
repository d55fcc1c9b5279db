"""Where the gateway of a line is found: a folder of the user's own, and in it a socket, locks and a log per line."""

from __future__ import annotations

import hashlib
import os
import socket
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows, where runtime_folder() says that there is no gateway
    fcntl = None  # type: ignore[assignment]

_ADDRESS_MAX = 100  # bytes of a socket's path that every system takes, its NUL included
_NAME_MAX = 24  # of the line's own name, in the names of files
_LOCK_POLL = 0.005  # seconds


class NoGateway(Exception):
    """A gateway is not possible here; the message says why. The line is used directly then."""


@dataclass(frozen=True)
class Place:
    """The files of the gateway of one line. `line` is the real path of the device, so that links to it meet."""

    folder: Path
    line: str

    @property
    def _stem(self) -> str:
        name = "".join(c if c.isalnum() else "-" for c in Path(self.line).name)[:_NAME_MAX]
        return f"{name}-{hashlib.sha256(self.line.encode(errors='surrogateescape')).hexdigest()[:12]}"

    @property
    def socket(self) -> Path:
        return self.folder / f"{self._stem}.sock"

    @property
    def lock(self) -> Path:
        """Held by the gateway as long as it lives; its process number and its line are in it."""
        return self.folder / f"{self._stem}.lock"

    @property
    def start_lock(self) -> Path:
        """Held by the tool that starts a gateway."""
        return self.folder / f"{self._stem}.start"

    @property
    def log(self) -> Path:
        return self.folder / f"{self._stem}.log"


def find_place(port: str) -> Place:
    """The place of the line that a port's name means. Raises NoGateway when there can be no gateway for it."""
    if "://" in port:
        raise NoGateway("only ports of this machine have a gateway")
    return Place(runtime_folder(), os.path.realpath(port))


def runtime_folder() -> Path:
    """A folder that only this user can use, made if it is missing. Raises NoGateway."""
    if fcntl is None or not hasattr(socket, "AF_UNIX"):
        raise NoGateway("this system has no local sockets")
    failure = "no folder for it"
    for base, name in _bases():
        folder = base / name
        if len(os.fsencode(folder)) + _NAME_MAX + 20 > _ADDRESS_MAX:
            continue
        try:
            with suppress(FileExistsError):
                folder.mkdir(mode=0o700)
            _check_ours(folder)
        except (OSError, NoGateway) as error:
            failure = str(error)
        else:
            return folder
    raise NoGateway(failure)


def _bases() -> Iterator[tuple[Path, str]]:
    """Folders to try and the name in each. A tool without the session's environment, such as one of cron, finds the
    same one."""
    uid = os.getuid()
    named = os.environ.get("XDG_RUNTIME_DIR", "")
    for folder in (named, f"/run/user/{uid}"):
        if os.path.isabs(folder) and os.path.isdir(folder):
            yield Path(folder), "plctool"
    yield Path("/tmp"), f"plctool-{uid}"


def _check_ours(folder: Path) -> None:
    """Raises NoGateway if another user could put a socket there and so receive programs."""
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid() or status.st_mode & 0o077:
        raise NoGateway(f"{folder} is not a folder of this user alone (mode 0700)")


def running() -> list[Holder]:
    """The gateways of this user, by line."""
    try:
        locks = runtime_folder().glob("*.lock")
        found = filter(None, map(find_holder, locks))
        return sorted(found, key=lambda holder: holder.line)
    except (NoGateway, OSError):
        return []


@contextmanager
def locked(path: Path, patience: float) -> Iterator[int]:
    """Holds the lock of a file; gives its descriptor. Raises TimeoutError after `patience` seconds."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        end = time.monotonic() + patience
        while not _try_lock(descriptor):
            if time.monotonic() >= end:
                raise TimeoutError(f"{path} is locked")
            time.sleep(_LOCK_POLL)
        yield descriptor
    finally:
        os.close(descriptor)


def _try_lock(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


@dataclass(frozen=True)
class Holder:
    """The process that holds a gateway's lock."""

    pid: int
    line: str


def find_holder(lock: Path) -> Holder | None:
    """Who holds a gateway's lock; None when the gateway has ended, however it did."""
    try:
        with locked(lock, 0):
            return None
    except TimeoutError:
        with suppress(OSError, ValueError):
            pid, line = lock.read_text(errors="surrogateescape").split(" ", 1)
            return Holder(int(pid), line)
        return None
    except OSError:
        return None
