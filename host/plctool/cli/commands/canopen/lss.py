"""`plctool canopen lss`: numbers and bit rates of nodes."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.arguments import count, duration_s, utf8
from plctool.cli.commands.canopen.bus import add_link, open_bus
from plctool.cli.documents import Document
from plctool.cli.parser import Parser
from plctool.errors import DeviceError, UsageError

if TYPE_CHECKING:
    from plctool.canopen.lss import Identity, LssMaster


def add_lss(action: Callable[..., Parser]) -> None:
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
    add_link(lss, "for a reply to a setting", 1.0)


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
    with open_bus(args) as bus:
        master = LssMaster(bus, args.timeout, args.question)
        if is_scan:
            return output.show(args, lss_scan(master), lss_scan_text)
        return output.show(args, lss_set(master, args.lss_action, number, identity), lss_set_text)


def lss_scan(master: LssMaster) -> Document:
    """The devices without a number."""
    try:
        found = list(master.find_all())
    finally:
        master.release()
    return {"devices": [{**vars(identity), "identity": str(identity)} for identity in found]}


def lss_scan_text(document: Document) -> str:
    """The identity of each device, as `lss set-node` takes it."""
    return "\n".join(d["identity"] for d in document["devices"]) or "No device without a node number answers."


def lss_set(master: LssMaster, action: str, number: int, identity: Identity | None) -> Document:
    """Gives a device a node number or a bit rate, and has it stored. `identity` None: the only one without a number.
    Raises UsageError if there are several, DeviceError if it refuses."""
    chosen = _only_one(master) if identity is None else identity
    try:
        master.select(chosen)
        if action == "set-node":
            master.set_node(number)
            if (shown := master.node()) != number:
                raise DeviceError(f"The device took node number {number}, but reports {shown}.", "lss-refused")
        else:
            master.set_bit_rate(number)
        master.store()
    finally:
        master.release()
    return {"identity": str(chosen), "node" if action == "set-node" else "bitrate_kbit": number, "stored": True}


def _only_one(master: LssMaster) -> Identity:
    try:
        found = list(master.find_all())
    finally:
        master.release()
    if not found:
        raise DeviceError("No device without a node number answers; name the device by its identity.", "lss-none")
    if len(found) > 1:
        names = ", ".join(map(str, found))
        raise UsageError(f"{len(found)} devices have no node number; name one of them: {names}.", "lss-several")
    return found[0]


def lss_set_text(document: Document) -> str:
    """What the device has taken."""
    if "node" in document:
        return f"{document['identity']} is node {document['node']} now, and keeps that."
    return f"{document['identity']} uses {document['bitrate_kbit']} kbit/s after its next power-up."
