"""`plctool source`: the sources of the program, kept on the device."""

from __future__ import annotations

import argparse
import gzip
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli.arguments import (
    add_board,
    add_build_options,
    add_dialect,
    add_io_files,
    add_link,
    add_sources,
    add_target,
)
from plctool.cli.builds import settings_with_dialect
from plctool.cli.connections import ShowProgress, with_progress
from plctool.cli.documents import Document
from plctool.cli.overwriting import output_or
from plctool.cli.parser import Parser
from plctool.cli.source_archive import archive_of, unpacked
from plctool.debug.symbols import find_symbols
from plctool.errors import DeviceError
from plctool.files import file_path
from plctool.link.file_services import SOURCE_NAME, SYMBOLS_NAME

if TYPE_CHECKING:
    from plctool.cli.projects import Settings
    from plctool.cli.source_archive import Archive
    from plctool.device import Plc


def source_arguments(command: Parser) -> None:
    action = command.adder_of_actions()
    get = action("get", "write the sources that the device keeps into a folder", _get)
    get.add_argument("-o", "--output", type=file_path, metavar="DIR", help="default: source")
    add_link(get)
    put = action("put", "put the sources of the program that is on the device there as well", _put)
    put.set_defaults(no_warn=[], werror=None)
    add_sources(put)
    add_target(put, "processor, where it is not that of the board in plc.toml")
    add_board(put, "that the program was built for, such as mps2-an385/full")
    add_build_options(put)
    add_dialect(put)
    add_io_files(put)
    add_link(put)


def _get(args: argparse.Namespace) -> int:
    folder = output_or(args, "source")
    return with_progress(args, lambda plc, show: get_source(plc, folder, show), source_text)


def _put(args: argparse.Namespace) -> int:
    settings = settings_with_dialect(args)
    return with_progress(
        args,
        lambda plc, show: put_source(plc, settings, show),
        lambda d: f"{len(d['files'])} files of the program with CRC {d['crc']} are on the device.",
    )


def prepared_source(settings: Settings, crc: int, image: Path | None = None) -> tuple[Archive, bytes]:
    """The archive of the sources of an image, and its symbols, which may be beside it. Raises UsageError unless they
    make that image."""
    symbols = find_symbols(crc, image)
    text = symbols.to_json().encode()
    replaced = symbols.online.get("base")
    base = None if replaced is None else find_symbols(replaced)
    return archive_of(settings, crc, symbols.target, base), gzip.compress(text, mtime=0)


def store_source(
    plc: Plc, prepared: tuple[Archive, bytes], progress: ShowProgress = lambda done, total: None
) -> Document:
    """Puts sources and symbols on a device."""
    archive, symbols = prepared
    data = archive.pack()
    plc.write_file(SOURCE_NAME, data, progress)
    plc.write_file(SYMBOLS_NAME, symbols, progress)
    return {"crc": f"{archive.crc:08X}", "files": sorted(archive.files), "bytes": len(data) + len(symbols)}


def put_source(plc: Plc, settings: Settings, progress: ShowProgress) -> Document:
    """The sources of the program that is on the device."""
    return store_source(plc, prepared_source(settings, _program(plc)), progress)


def get_source(plc: Plc, output: Path, progress: ShowProgress) -> Document:
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


def source_text(document: Document) -> str:
    words = shlex.join(document["build"])
    return f"{len(document['files'])} files in {document['folder']}. The same image again, there: plctool build {words}"
