"""`plctool flash --online-change --back`: the program before the last online change, with the values of today.

SPDX-License-Identifier: Apache-2.0

The sources of a project that is flashed are kept beside its symbols, in the cache. So the previous program is built
again, as a change of the one that runs: whatever both have keeps its value.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli.source_archive import Archive, collected, unpacked, unpacked_settings
from plctool.errors import DeviceError, UsageError
from plctool.files import read_regular, write_atomically

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.debug.symbols import SymbolTable

_SUFFIX = ".src"
_MAX_BYTES = 1 << 28


def keep_sources(settings: Settings | None, image: Path) -> None:
    """Keeps the sources of an image that a project has made. If that fails, nothing is said: there is no way back
    then."""
    from plctool.cli.fresh_image import fingerprint
    from plctool.debug.symbols import load_symbols, symbol_path

    if settings is None:
        return
    with suppress(OSError, UsageError, ValueError):
        symbols = load_symbols(symbol_path(image))
        if symbols.made_of == fingerprint(settings):  # nothing was saved since
            keep(collected(settings, symbols.image_crc, symbols.target))


def keep(archive: Archive) -> None:
    with suppress(OSError, UsageError):
        path = _path(archive.crc)
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(path, archive.pack())


def _path(crc: int) -> Path:
    from plctool.debug.symbols import cache_path

    return cache_path(crc).with_suffix(_SUFFIX)


def previous_sources(symbols: SymbolTable) -> Archive:
    """The sources of the program that the one with these symbols has replaced. Raises UsageError if they are not
    known."""
    crc = symbols.online.get("base")
    if crc is None:
        raise UsageError(
            "The program that runs has not replaced another one in an online change, so there is no way back. Download "
            "the program that you want with 'plctool flash'.",
            "no-way-back",
        )
    try:
        archive = unpacked(read_regular(_path(crc), _MAX_BYTES))
    except (OSError, DeviceError):
        raise UsageError(
            f"This computer does not have the sources of the previous program (CRC {crc:08X}): it was not flashed as a "
            "project from here. Undo the change in your sources and use 'plctool flash --online-change'.",
            "no-way-back",
        ) from None
    return archive


@contextmanager
def settings_for_previous(symbols: SymbolTable) -> Iterator[tuple[Settings, Archive]]:
    """The settings that build the previous program in place of the one with these symbols, while its sources are in a
    folder for a time."""
    archive = previous_sources(symbols)
    with tempfile.TemporaryDirectory(prefix="plctool-back-") as folder:
        place = Path(folder) / "program"
        with unpacked_settings(archive, place) as settings:
            output = Path(os.path.abspath(settings.output))
            yield replace(settings, base=symbols, output=output), archive
