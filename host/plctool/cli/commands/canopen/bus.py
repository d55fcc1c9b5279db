"""The bus of a command, and the arguments that several actions have."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.arguments import count, duration_s, option_helps
from plctool.cli.documents import Document
from plctool.cli.links import find_link
from plctool.cli.output import EXIT_OK
from plctool.cli.parser import Parser
from plctool.errors import UsageError
from plctool.files import usable_path
from plctool.io.canopen.eds import Eds, load_eds
from plctool.link.transports import TRANSPORTS

if TYPE_CHECKING:
    from plctool.canopen.bus import CanopenBus

FOREVER = 1e9  # seconds


def add_eds(parser: Parser) -> None:
    parser.add_argument("--eds", type=usable_path, metavar="FILE", help="EDS or DCF with names, types and limits")


def add_stream(parser: Parser, what: str) -> None:
    parser.json_line_for_each(what)
    parser.add_argument("--count", type=count, metavar="N", help="lines; default: until Ctrl-C")
    add_link(parser, "for a reply", 1.0)


def add_link(parser: Parser, what: str, default: float) -> None:
    link = parser.add_argument_group("bus")
    can = TRANSPORTS["can"]
    link.add_argument("--can", metavar=can.shape, help="any interface of python-can; default: as for other commands")
    link.add_argument("--bitrate", metavar="N", help=can.options["bitrate"].help)
    parser.add_argument(
        "--timeout", type=duration_s, default=default, metavar="S", help=f"seconds to wait {what}; default: {default:g}"
    )
    flags = [kind.flag for kind in TRANSPORTS.values() if kind.flag]
    others = {name.replace("-", "_"): None for name in [*flags, *option_helps()]}
    parser.set_defaults(**{name: None for name in others if name not in ("can", "bitrate")})


def node_argument(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and 1 <= int(text[:4]) <= 127):
        raise argparse.ArgumentTypeError(f"'{text}' is not the number of a node, 1 to 127")
    return int(text)


def open_bus(args: argparse.Namespace) -> CanopenBus:
    """Opens the bus of a command. Raises UsageError if none is named, LinkError if it does not open."""
    from plctool.canopen.bus import open_canopen

    link = find_link(args)
    if link is None or link.scheme != "can":
        named = "" if link is None else f", not {link}"
        raise UsageError(f"CANopen needs a CAN bus{named}: write for example --can socketcan:can0.", "no-link")
    first, slash, _ = str(link.options["bitrate"]).partition("/")
    if slash:
        raise UsageError(f"CANopen uses classic CAN; write --bitrate {first}.", "no-such-link")
    return open_canopen(link.place, int(first))


def print_lines(args: argparse.Namespace, lines: Iterable[Document], text: Callable[..., str]) -> int:
    """Prints a line for each document, at once, until the count is reached or Ctrl-C."""
    left = args.count
    with suppress(KeyboardInterrupt):
        for document in lines:
            output.say(output.as_json(document) if args.json else text(output.shown(document)))
            left = None if left is None else left - 1
            if left == 0:
                break
    return EXIT_OK


def usable_eds(path: Path) -> Eds:
    """An EDS for names and types; its doubts are what `check` prints. Raises UsageError if nothing in it is usable."""
    eds = load_eds(path)
    if not eds.objects:
        raise UsageError(f"{path} describes no objects; see 'plctool canopen check {path}'.", "bad-eds")
    return eds
