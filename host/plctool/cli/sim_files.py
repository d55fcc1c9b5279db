"""The files of a simulated device in a folder, as `plctool run --files` says."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.errors import DeviceError, UsageError
from plctool.files import make_folder, read_regular, write_atomically

if TYPE_CHECKING:
    from plctool.sim import Simulator

_MOST = 1 << 20  # bytes of a file: the device has no room for a larger one


@contextmanager
def device_files(plc: Simulator, folder: Path) -> Iterator[None]:
    """Gives the device the files of the folder, and afterwards the folder what the program made of them, also if it
    fails. Raises UsageError for files that the device cannot have; hidden files, empty folders and links are left
    alone."""
    before = _read(folder)
    for name, data in before.items():
        try:
            plc.put_file(name, data)
        except DeviceError as error:
            raise UsageError(
                f"{folder / name} cannot be a file of the device ({error}); move it elsewhere.", "bad-files"
            ) from None
    try:
        yield
    finally:
        _write(folder, before, plc.files())


def _read(folder: Path) -> dict[str, bytes]:
    make_folder(folder)
    return {str(path.relative_to(folder).as_posix()): read_regular(path, _MOST) for path in _files_in(folder)}


def _files_in(folder: Path) -> Iterator[Path]:
    """The files in a folder and in those below it, without links."""
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or path.is_symlink():
            continue
        if path.is_dir():
            yield from _files_in(path)
        elif path.is_file():
            yield path


def _write(folder: Path, before: dict[str, bytes], after: dict[str, bytes]) -> None:
    for name in before.keys() - after.keys():
        (folder / name).unlink(missing_ok=True)
    for name, data in after.items():
        if name.endswith("/"):
            make_folder(_without_links(folder, name))
        elif before.get(name) != data:
            path = _without_links(folder, name)
            make_folder(path.parent)
            write_atomically(path, data)


def _without_links(folder: Path, name: str) -> Path:
    """Where a file or a folder of the device is. Raises UsageError if a link leads away from there."""
    path = folder
    for part in name.rstrip("/").split("/"):
        path /= part
        if path.is_symlink():
            raise UsageError(
                f"{path} is a link, and the program has a file of this name; remove the link.", "bad-files"
            )
    return path
