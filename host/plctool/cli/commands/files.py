"""`plctool files`: the files of a device."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.arguments import add_link, utf8
from plctool.cli.connections import ShowProgress, on_device, with_progress
from plctool.cli.documents import Document
from plctool.cli.overwriting import output_or
from plctool.cli.parser import Parser
from plctool.errors import UsageError
from plctool.files import STDOUT, usable_path, write_output

if TYPE_CHECKING:
    from plctool.device import Plc


def files_arguments(command: Parser) -> None:
    action = command.adder_of_actions()
    add_link(action("list", "list the files", _list))
    get = action("get", "copy a file from the device", _get)
    get.add_argument("name", type=utf8, metavar="NAME", help="as 'plctool files list' shows it")
    get.add_argument(
        "-o", "--output", type=usable_path, metavar="FILE",
        help="- for the standard output; default: its name without folders, in this folder",
    )  # fmt: skip
    add_link(get)
    put = action("put", "copy a file to the device, in place of the previous one of its name", _put)
    put.add_argument("file", type=usable_path, metavar="FILE")
    put.add_argument("--name", type=utf8, metavar="NAME", help="on the device; default: that of the file")
    add_link(put)
    delete = action("delete", "delete a file of the device, or a folder that is empty", _delete)
    delete.add_argument("name", type=utf8, metavar="NAME", help="as 'plctool files list' shows it")
    add_link(delete)


def _list(args: argparse.Namespace) -> int:
    return on_device(args, list_files, list_text)


def _get(args: argparse.Namespace) -> int:
    output.check_one_output(args)
    return with_progress(
        args,
        lambda plc, show: get_file(plc, args.name, output_or(args, args.name.rpartition("/")[2]), show),
        lambda d: f"{d['name'] if d['file'] == str(STDOUT) else d['file']}: {d['size']} bytes",
        output.beside_output(args),
    )


def _put(args: argparse.Namespace) -> int:
    return with_progress(
        args,
        lambda plc, show: put_file(plc, args.file, args.name, show),
        lambda d: f"{d['name']}: {d['size']} bytes",
    )


def _delete(args: argparse.Namespace) -> int:
    return on_device(args, lambda plc: delete_file(plc, args.name), lambda d: f"{d['name']} is deleted.")


def list_files(plc: Plc) -> Document:
    found = plc.files()
    files = [{"name": f.name, "size": f.size, "crc": f"{f.crc:08X}", "fixed": f.fixed} for f in found.files]
    return {"files": files, "room": found.room}


def get_file(plc: Plc, name: str, path: Path, progress: ShowProgress) -> Document:
    data = plc.read_file(name, progress)
    write_output(path, data)
    return {"name": name, "file": str(path), "size": len(data)}


def put_file(plc: Plc, path: Path, name: str | None, progress: ShowProgress) -> Document:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror}.", "no-file") from None
    plc.write_file(name or path.name, data, progress)
    return {"name": name or path.name, "file": str(path), "size": len(data)}


def delete_file(plc: Plc, name: str) -> Document:
    plc.delete_file(name)
    return {"name": name, "deleted": True}


def list_text(document: Document) -> str:
    lines = [f"{f['size']:>9}  {f['name']}{'  (made by the device)' if f['fixed'] else ''}" for f in document["files"]]
    return "\n".join([*lines, f"{document['room']:>9}  bytes are free for one more file"])
