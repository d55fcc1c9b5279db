"""What `plctool canopen` does: each action reads its arguments, has the document made, and shows it."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import canopen_documents as documents
from plctool.cli import output
from plctool.cli.links import find_link
from plctool.cli.overwriting import check_not_read
from plctool.errors import UsageError

if TYPE_CHECKING:
    from plctool.canopen.bus import CanopenBus
    from plctool.io.canopen.eds import Eds

Show = Callable[..., int]
"""Prints a document or its text, as `main._show` does."""
EXIT_OK, EXIT_USAGE = 0, 2


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


def _check(args: argparse.Namespace, show: Show) -> int:
    document, texts = documents.check(args.eds)
    show(document, lambda d: "\n".join([*texts, documents.check_text(d)]), colours=True)
    return EXIT_USAGE if any(d["severity"] == "error" for d in document["diagnostics"]) else EXIT_OK


def _scan(args: argparse.Namespace, show: Show) -> int:
    with _bus(args) as bus:
        document = documents.scan(bus, args.timeout)
    return show(document, documents.scan_text)


def _nmt(args: argparse.Namespace, show: Show) -> int:
    with _bus(args) as bus:
        document = documents.nmt(bus, args.command_name, args.node_number, args.timeout)
    return show(document, documents.nmt_text)


def _sdo(args: argparse.Namespace, show: Show) -> int:
    access = _access(args, args.object)
    if args.verb == "read":
        if args.value is not None:
            raise UsageError("'sdo read' takes no value; write 'sdo write' to set one.", "usage")
        if args.file is not None:
            check_not_read(args.file, [args.eds] if args.eds else [], "--file value.bin")
        with _bus(args) as bus:
            document = documents.sdo_read(bus, args.node_number, access, args.timeout, args.file, not args.no_block)
        return show(document, documents.sdo_text)
    if (args.value is None) == (args.file is None):
        raise UsageError("Give what to write: VALUE, or --file FILE.", "usage")
    data = documents.sdo_data(access, args.value, args.file)
    with _bus(args) as bus:
        document = documents.sdo_write(bus, args.node_number, access, data, args.timeout, not args.no_block)
    return show(document, documents.sdo_text)


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


def _emcy(args: argparse.Namespace, show: Show) -> int:
    with _bus(args) as bus:
        return _stream(args, documents.emergencies(bus, args.node_number), documents.emergency_text)


def _pdo(args: argparse.Namespace, show: Show) -> int:
    if args.passive and args.eds is None:
        raise UsageError("--passive takes the mapping from an EDS; name one with --eds.", "usage")
    eds = _eds(args.eds)
    with _bus(args) as bus:
        lines = documents.pdos(bus, args.node_number, eds, args.timeout, passive=args.passive)
        return _stream(args, lines, documents.pdo_text)


def _eds(path: Path | None) -> Eds | None:
    return None if path is None else documents.usable_eds(path)


def _watch(args: argparse.Namespace, show: Show) -> int:
    accesses = [_access(args, place) for place in args.objects]
    with _bus(args) as bus:
        lines = documents.watch(bus, args.node_number, accesses, args.interval, args.timeout)
        return _stream(args, lines, documents.watch_text)


def _lss(args: argparse.Namespace, show: Show) -> int:
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
            return show(documents.lss_scan(master), documents.lss_scan_text)
        return show(documents.lss_set(master, args.lss_action, number, identity), documents.lss_set_text)


CANOPEN_ACTIONS: dict[str, Callable[[argparse.Namespace, Show], int]] = {
    "check": _check, "scan": _scan, "nmt": _nmt, "sdo": _sdo, "emcy": _emcy, "pdo": _pdo, "watch": _watch, "lss": _lss,
}  # fmt: skip
