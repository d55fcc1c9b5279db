"""`plctool canopen download`: the program of a node, by objects of its dictionary."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

from plctool.cli import output
from plctool.cli.arguments import add_image
from plctool.cli.builds import image_of
from plctool.cli.commands.canopen.bus import add_link, node_argument, open_bus
from plctool.cli.documents import Document
from plctool.cli.parser import Parser
from plctool.errors import DeviceError

_PROGRAM = 1  # the only one of a controller of this project


def add_download(action: Callable[..., Parser]) -> None:
    command = action("download", "replace the program of a node by 1F50h (CiA 302-3)", _download)
    command.add_argument("node_number", type=node_argument, metavar="NODE", help="1 to 127")
    add_image(command)
    command.add_argument("--stop", action="store_true", help="stop and clear the present program first")
    add_link(command, "for a reply", 5.0)


def _download(args: argparse.Namespace) -> int:
    from plctool.canopen.program import download, identification
    from plctool.canopen.sdo import SdoClient
    from plctool.image.file import describe_image, read_program

    path: Path = image_of(args)
    image = read_program(path)
    crc = int(describe_image(image)["crc"], 16)
    with open_bus(args) as bus:
        client = SdoClient(bus, args.node_number, args.timeout)
        begin = time.monotonic()
        download(client, image, _PROGRAM, stops=args.stop, patience=args.timeout)
        found = identification(client, _PROGRAM)
        if found not in (None, crc):
            raise DeviceError(
                f"Node {args.node_number} runs another program (1F56 is {found:08X}, not {crc:08X}).", "other-program"
            )
        document: Document = {
            "node": args.node_number, "file": str(path), "size": len(image), "crc": f"{crc:08X}",
            "seconds": round(time.monotonic() - begin, 3),
        }  # fmt: skip
    return output.show(args, document, _text)


def _text(d: Document) -> str:
    return f"node {d['node']}: {d['size']} bytes, CRC {d['crc']}, started after {d['seconds']:.1f} s"
