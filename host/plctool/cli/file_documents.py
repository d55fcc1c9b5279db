"""What `plctool files` and `plctool source` do; each returns its JSON document."""

from __future__ import annotations

import gzip
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli.io_documents import Document
from plctool.cli.source_archive import Archive, archive_of, unpacked
from plctool.debug.symbols import find_symbols
from plctool.errors import DeviceError, UsageError
from plctool.files import write_output
from plctool.link.file_services import SOURCE_NAME, SYMBOLS_NAME

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.device import Plc

Progress = Callable[[int, int], None]


def list_files(plc: Plc) -> Document:
    found = plc.files()
    files = [{"name": f.name, "size": f.size, "crc": f"{f.crc:08X}", "fixed": f.fixed} for f in found.files]
    return {"files": files, "room": found.room}


def get_file(plc: Plc, name: str, path: Path, progress: Progress) -> Document:
    data = plc.read_file(name, progress)
    write_output(path, data)
    return {"name": name, "file": str(path), "size": len(data)}


def put_file(plc: Plc, path: Path, name: str | None, progress: Progress) -> Document:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.", "no-file") from None
    plc.write_file(name or path.name, data, progress)
    return {"name": name or path.name, "file": str(path), "size": len(data)}


def delete_file(plc: Plc, name: str) -> Document:
    plc.delete_file(name)
    return {"name": name, "deleted": True}


def prepared_source(settings: Settings, crc: int, image: Path | None = None) -> tuple[Archive, bytes]:
    """The archive of the sources of an image, and its symbols, which may be beside it. Raises UsageError unless they
    make that image."""
    symbols = find_symbols(crc, image)
    text = symbols.to_json().encode()
    return archive_of(settings, crc, symbols.target), gzip.compress(text, mtime=0)


def store_source(plc: Plc, prepared: tuple[Archive, bytes], progress: Progress = lambda done, total: None) -> Document:
    """Puts sources and symbols on a device."""
    archive, symbols = prepared
    data = archive.pack()
    plc.write_file(SOURCE_NAME, data, progress)
    plc.write_file(SYMBOLS_NAME, symbols, progress)
    return {"crc": f"{archive.crc:08X}", "files": sorted(archive.files), "bytes": len(data) + len(symbols)}


def put_source(plc: Plc, settings: Settings, progress: Progress) -> Document:
    """The sources of the program that is on the device."""
    return store_source(plc, prepared_source(settings, _program(plc)), progress)


def get_source(plc: Plc, output: Path, progress: Progress) -> Document:
    """Raises DeviceError when they are those of another program."""
    crc = _program(plc)
    archive = unpacked(plc.read_file(SOURCE_NAME, progress))
    if archive.crc != crc:
        raise DeviceError(
            f"The sources on the device are of another program (CRC {archive.crc:08X}) than the one that it has "
            f"({crc:08X}); 'plctool files get {SOURCE_NAME}' gets them anyway.",
            "other-source",
        )
    files = archive.unpack(output)
    return {
        "folder": str(output),
        "files": [str(file) for file in files],
        "crc": f"{archive.crc:08X}",
        "build": archive.build,
    }


def _program(plc: Plc) -> int:
    crc = plc.raw_status().image_crc
    if crc == 0:
        raise DeviceError("The device has no program; flash one first.", "app-not-loaded")
    return crc


def list_text(document: Document) -> str:
    lines = [f"{f['size']:>9}  {f['name']}{'  (made by the device)' if f['fixed'] else ''}" for f in document["files"]]
    return "\n".join([*lines, f"{document['room']:>9}  bytes are free for one more file"])


def source_text(document: Document) -> str:
    words = shlex.join(document["build"])
    return f"{len(document['files'])} files in {document['folder']}. The same image again, there: plctool build {words}"
