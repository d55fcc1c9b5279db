"""`plctool canopen`: CANopen devices on a bus, and EDS files."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import canopen_documents as documents
from plctool.cli import output
from plctool.cli.arguments import DEFAULT_INTERVAL, count, duration_s, option_helps, utf8
from plctool.cli.links import find_link
from plctool.cli.output import EXIT_OK, EXIT_USAGE
from plctool.cli.overwriting import check_not_read
from plctool.cli.parser import Parser
from plctool.errors import UsageError
from plctool.files import usable_path
from plctool.link.transports import TRANSPORTS

if TYPE_CHECKING:
    from plctool.canopen.bus import CanopenBus
    from plctool.io.canopen.eds import Eds


def canopen_arguments(command: Parser) -> None:
    action = command.adder_of_actions()

    check = action("check", "print every diagnostic of an EDS or DCF", _check)
    check.add_argument("eds", type=usable_path, metavar="FILE.eds|.dcf")

    scan = action("scan", "list the nodes with their state and identity", _scan)
    _add_link(scan, "and for heartbeats", 1.2)

    nmt = action("nmt", "change the state of a node or of all", _nmt)
    nmt.add_argument("command_name", choices=_NMT, metavar="|".join(_NMT))
    nmt.add_argument("node_number", type=_node_or_all, metavar="NODE|all")
    _add_link(nmt, "for the heartbeat that shows the state", 1.2)

    sdo = action("sdo", "read or write an object of a node", _sdo)
    sdo.add_argument("verb", choices=["read", "write"], metavar="read|write")
    sdo.add_argument("node_number", type=_node, metavar="NODE", help="1 to 127")
    sdo.add_argument("object", type=_object, metavar="INDEX[:SUB]", help="in hex: 6041, 1018:01")
    sdo.add_argument("value", nargs="?", type=utf8, metavar="VALUE", help="to write, unless --file has it")
    sdo.add_argument("--type", metavar="TYPE", help="U16, INTEGER32, REAL32, STRING and so on, if no EDS says it")
    sdo.add_argument("--file", type=usable_path, metavar="FILE", help="write its bytes, or read into it")
    sdo.add_argument("--no-block", action="store_true", help="do not try block transfer")
    _add_eds(sdo)
    _add_link(sdo, "for a reply", 1.0)

    emcy = action("emcy", "print emergency messages", _emcy)
    emcy.add_argument("--node", dest="node_number", type=_node, metavar="NODE", help="only of this node")
    _add_stream(emcy, "message")
    pdo = action("pdo", "print the values in the PDOs of a node", _pdo)
    pdo.add_argument("node_number", type=_node, metavar="NODE")
    pdo.add_argument("--passive", action="store_true", help="send nothing: take the mapping from the EDS")
    _add_eds(pdo)
    _add_stream(pdo, "PDO")
    watch = action("watch", "print values of objects periodically", _watch)
    watch.add_argument("node_number", type=_node, metavar="NODE")
    watch.add_argument("objects", nargs="+", type=_object, metavar="INDEX[:SUB]")
    watch.add_argument("--type", metavar="TYPE", help="of all of them, if no EDS says it")
    watch.add_argument(
        "--interval",
        type=duration_s,
        default=DEFAULT_INTERVAL,
        metavar="S",
        help=f"seconds; default: {DEFAULT_INTERVAL}",
    )
    _add_eds(watch)
    _add_stream(watch, "reading")

    lss = action("lss", "find nodes without a number; set numbers and bit rates", _lss)
    lss.add_argument("lss_action", choices=["scan", "set-node", "set-bitrate"], metavar="scan|set-node|set-bitrate")
    lss.add_argument("number", nargs="?", type=count, metavar="NODE|KBIT", help="the new node number, or kbit/s")
    lss.add_argument(
        "identity", nargs="?", type=utf8, metavar="VENDOR:PRODUCT:REVISION:SERIAL",
        help="which device, as 'lss scan' lists it; default: the only one without a number",
    )  # fmt: skip
    lss.add_argument("--yes", action="store_true", help="set-bitrate: the device cannot be reached at the old one")
    lss.add_argument(
        "--question", type=duration_s, default=0.05, metavar="S", help="time for a reply of a scan; default: 0.05"
    )
    _add_link(lss, "for a reply to a setting", 1.0)


_NMT = ("start", "stop", "preop", "reset", "reset-comm")


def _add_eds(parser: Parser) -> None:
    parser.add_argument("--eds", type=usable_path, metavar="FILE", help="EDS or DCF with names, types and limits")


def _add_stream(parser: Parser, what: str) -> None:
    parser.json_line_for_each(what)
    parser.add_argument("--count", type=count, metavar="N", help="lines; default: until Ctrl-C")
    _add_link(parser, "for a reply", 1.0)


def _add_link(parser: Parser, what: str, default: float) -> None:
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


def _node(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and 1 <= int(text[:4]) <= 127):
        raise argparse.ArgumentTypeError(f"'{text}' is not the number of a node, 1 to 127")
    return int(text)


def _node_or_all(text: str) -> int:
    return 0 if text == "all" else _node(text)


def _object(text: str) -> tuple[int, int]:
    """Index and sub-index of 6041, 0x6041, 1018:01."""
    found = re.fullmatch(r"(?:0x)?([0-9a-f]{4})(?::(?:0x)?([0-9a-f]{1,2}))?", text, re.IGNORECASE)
    if found is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not an object; write its index in hex: 6041 or 1018:01")
    return int(found[1], 16), int(found[2] or "0", 16)


def _bus(args: argparse.Namespace) -> CanopenBus:
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


def _check(args: argparse.Namespace) -> int:
    document, texts = documents.check(args.eds)
    output.show(args, document, lambda d: "\n".join([*texts, documents.check_text(d)]), colours=True)
    return EXIT_USAGE if any(d["severity"] == "error" for d in document["diagnostics"]) else EXIT_OK


def _scan(args: argparse.Namespace) -> int:
    with _bus(args) as bus:
        document = documents.scan(bus, args.timeout)
    return output.show(args, document, documents.scan_text)


def _nmt(args: argparse.Namespace) -> int:
    with _bus(args) as bus:
        document = documents.nmt(bus, args.command_name, args.node_number, args.timeout)
    return output.show(args, document, documents.nmt_text)


def _sdo(args: argparse.Namespace) -> int:
    access = _access(args, args.object)
    if args.verb == "read":
        if args.value is not None:
            raise UsageError("'sdo read' takes no value; write 'sdo write' to set one.", "usage")
        if args.file is not None:
            check_not_read(args.file, [args.eds] if args.eds else [], "--file value.bin")
        with _bus(args) as bus:
            document = documents.sdo_read(bus, args.node_number, access, args.timeout, args.file, not args.no_block)
        return output.show(args, document, documents.sdo_text)
    if (args.value is None) == (args.file is None):
        raise UsageError("Give what to write: VALUE, or --file FILE.", "usage")
    data = documents.sdo_data(access, args.value, args.file)
    with _bus(args) as bus:
        document = documents.sdo_write(bus, args.node_number, access, data, args.timeout, not args.no_block)
    return output.show(args, document, documents.sdo_text)


def _access(args: argparse.Namespace, place: tuple[int, int]) -> documents.Access:
    return documents.access_to(place, args.type, args.eds)


def _stream(args: argparse.Namespace, lines: Iterable[documents.Document], text: Callable[..., str]) -> int:
    """Prints a line for each document, at once, until the count is reached or Ctrl-C."""
    left = args.count
    with suppress(KeyboardInterrupt):
        for document in lines:
            output.say(output.as_json(document) if args.json else text(output.shown(document)))
            left = None if left is None else left - 1
            if left == 0:
                break
    return EXIT_OK


def _emcy(args: argparse.Namespace) -> int:
    with _bus(args) as bus:
        return _stream(args, documents.emergencies(bus, args.node_number), documents.emergency_text)


def _pdo(args: argparse.Namespace) -> int:
    if args.passive and args.eds is None:
        raise UsageError("--passive takes the mapping from an EDS; name one with --eds.", "usage")
    eds = _eds(args.eds)
    with _bus(args) as bus:
        lines = documents.pdos(bus, args.node_number, eds, args.timeout, passive=args.passive)
        return _stream(args, lines, documents.pdo_text)


def _eds(path: Path | None) -> Eds | None:
    return None if path is None else documents.usable_eds(path)


def _watch(args: argparse.Namespace) -> int:
    accesses = [_access(args, place) for place in args.objects]
    with _bus(args) as bus:
        lines = documents.watch(bus, args.node_number, accesses, args.interval, args.timeout)
        return _stream(args, lines, documents.watch_text)


def _lss(args: argparse.Namespace) -> int:
    from plctool.canopen.lss import BIT_RATES, LssMaster, parse_identity

    number, is_scan = args.number, args.lss_action == "scan"
    if is_scan != (number is None):
        raise UsageError("Write 'lss scan', 'lss set-node NODE' or 'lss set-bitrate KBIT'.", "usage")
    if args.lss_action == "set-node" and number > 127:
        raise UsageError(f"{number} is not the number of a node, 1 to 127.", "usage")
    if args.lss_action == "set-bitrate" and number not in BIT_RATES:
        rates = ", ".join(str(rate) for rate in BIT_RATES if rate)
        raise UsageError(f"{number} kbit/s is not a bit rate of CANopen: {rates}.", "usage")
    if args.lss_action == "set-bitrate" and not args.yes:
        raise UsageError(
            f"After its next power-up the device is on the bus with {number} kbit/s only. Add --yes to set that.",
            "usage",
        )
    identity = None if args.identity is None else parse_identity(args.identity)
    with _bus(args) as bus:
        master = LssMaster(bus, args.timeout, args.question)
        if is_scan:
            return output.show(args, documents.lss_scan(master), documents.lss_scan_text)
        return output.show(args, documents.lss_set(master, args.lss_action, number, identity), documents.lss_set_text)
