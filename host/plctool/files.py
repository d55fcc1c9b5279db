"""Reading and writing files, with errors that say what to do; locations in them."""

from __future__ import annotations

import errno
import os
import shlex
import stat
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from plctool.errors import UsageError

STDIN = STDOUT = Path("-")  # in place of the path of an input, an output
MAX_TEXT = 32 << 20
MAX_SETTINGS = 1 << 20
MAX_BINARY = 256 << 20
"""Bytes that are read of a source or a library, of a TOML file, and of an image or its symbols."""
_PART = 1 << 20  # bytes that are read at once: a file may grow, and those of /proc do not know their size
_SHOWN = 80  # characters of an invalid path


class Pos(NamedTuple):
    """A place in a source file; `line` and `column` count from 1."""

    file: str
    line: int
    column: int


def cache_folder() -> Path:
    """The folder of what plctool keeps to be quicker, or to know images again: $XDG_CACHE_HOME/plctool."""
    root = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(root) / "plctool"


def usable_path(text: str) -> Path:
    """A path that a user gave. Raises UsageError if no file can have it: it is too long, has a NUL or
    is a link to itself."""
    try:
        os.stat(text)
    except ValueError:
        raise _no_path(text, "it has a character that no name has") from None
    except OSError as error:
        if error.errno in (errno.ENAMETOOLONG, errno.ELOOP):
            raise _no_path(text, error.strerror or "it is refused") from None
    return Path(text)


def _no_path(text: str, why: str) -> UsageError:
    shown = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
    shown = "".join(c if c.isprintable() else "?" for c in shown)
    return UsageError(f"{shown} cannot be the path of a file: {why}; give another one.", "path")


def path_error(error: OSError) -> UsageError:
    """What to say of a file that the system refuses, where nothing better is known."""
    return UsageError(f"{os.fsdecode(error.filename)} cannot be used: {error.strerror}.", "path")


def is_inside(path: Path, folder: Path) -> bool:
    """True if a path lies in a folder after all links have been followed, whether it exists or not."""
    root = os.path.realpath(folder)
    try:
        return os.path.commonpath([root, os.path.realpath(path)]) == root
    except ValueError:  # different drives
        return False


def check_inside(path: Path, folder: Path) -> None:
    """Raises UsageError if a file that a checked-out project names lies outside the project (docs/security.md)."""
    if not is_inside(path, folder):
        real = os.path.realpath(path)
        way = f", a link to {real}," if path.is_symlink() else ""
        raise UsageError(
            f"{path}{way} is outside {os.path.realpath(folder)}, so it is not used; copy it there, or name it on the "
            "command line.",
            "outside",
        )


def read_regular(path: Path, most: int) -> bytes:
    """The bytes of a file. Raises OSError for what cannot be read, is a device or a pipe, or has more than `most`
    bytes; `strerror` says what to do."""
    mode = os.stat(path).st_mode  # before it is opened: that waits for the other end of a pipe
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is a device or a pipe; give a regular file", str(path))
    data = bytearray()
    with open(path, "rb") as file:
        while len(data) <= most and (part := file.read(_PART)):
            data += part
    if len(data) > most:
        raise OSError(
            errno.EFBIG, f"it has more than {most >> 20} MiB; split it or take out what is not needed", str(path)
        )
    return bytes(data)


def write_atomically(path: Path, data: bytes) -> None:
    """The file has the old or the new content, whatever happens on the way; a link to it stays one. What is no file but
    a device or a pipe, such as /dev/stdout, is written to."""
    try:
        path = Path(os.path.realpath(path)) if path.is_file() else path
        if path.exists() and not path.is_file() and not path.is_dir():
            path.write_bytes(data)
            return
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        file = tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False)  # noqa: SIM115
        try:
            with file:
                file.write(data)
            os.chmod(file.name, 0o644)
            os.replace(file.name, path)
        except BaseException:
            os.unlink(file.name)
            raise
    except FileNotFoundError:
        raise UsageError(
            f"{path} cannot be written: the folder {path.parent} does not exist; make it first.", "cannot-write"
        ) from None
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}.", "cannot-write") from None


def write_output(path: Path, data: bytes) -> None:
    """Writes what a command is for: to a file, or to the standard output if that is what its user named."""
    if path != STDOUT:
        write_atomically(path, data)
        return
    sys.stdout.flush()
    sys.stdout.buffer.write(data)


def file_path(text: str) -> Path:
    """The path of an output that only a file or folder can be. Raises UsageError for the standard output."""
    if text == str(STDOUT):
        raise UsageError("- is no file, and this cannot be written to the standard output; name a file.", "bad-output")
    return usable_path(text)


def read_utf8(path: Path, code: str) -> str:
    """The text of a file, perhaps with a byte order mark. Raises UsageError with that code for one that is none."""
    try:
        data = read_regular(path, MAX_SETTINGS)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.", code) from None
    return decode_utf8(data, path, code)


def decode_utf8(data: bytes, path: Path, code: str) -> str:
    """The same for what was read of a file."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is not UTF-8 at byte {error.start}; save it as UTF-8.", code) from None


def read_image(path: Path) -> bytes:
    """The bytes of an image file, whatever they are."""
    try:
        return read_regular(path, MAX_BINARY)
    except IsADirectoryError:
        build = f"plctool build {shlex.quote(str(path))} -o app.cdl"
        raise UsageError(f"{path} is a folder; make an image of its sources first: {build}.", "no-image") from None
    except OSError as error:
        raise UsageError(f"The image {path} cannot be read: {error.strerror}.", "no-image") from None


def make_folder(path: Path) -> None:
    """Makes a folder and those it is in, unless they are there."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"The folder {path} cannot be made: {error.strerror}.", "cannot-write") from None
