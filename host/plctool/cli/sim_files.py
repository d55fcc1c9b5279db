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
    fails. Raises UsageError for files that the device cannot have; subfolders and hidden files are left alone."""
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
    paths = [path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith(".")]
    return {path.name: read_regular(path, _MOST) for path in paths}


def _write(folder: Path, before: dict[str, bytes], after: dict[str, bytes]) -> None:
    for name, data in after.items():
        if before.get(name) != data:
            write_atomically(folder / name, data)
    for name in before.keys() - after.keys():
        (folder / name).unlink(missing_ok=True)
