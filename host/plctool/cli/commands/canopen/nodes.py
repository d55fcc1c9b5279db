"""`plctool canopen scan`, `nmt`: the nodes on a bus and their state."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.commands.canopen.bus import add_link, node_argument, open_bus
from plctool.cli.documents import Document
from plctool.cli.output import table
from plctool.cli.parser import Parser

if TYPE_CHECKING:
    from plctool.canopen.bus import CanopenBus

_NMT = ("start", "stop", "preop", "reset", "reset-comm")


def add_scan(action: Callable[..., Parser]) -> None:
    scan = action("scan", "list the nodes with their state and identity", _scan)
    add_link(scan, "and for heartbeats", 1.2)


def add_nmt(action: Callable[..., Parser]) -> None:
    nmt = action("nmt", "change the state of a node or of all", _nmt)
    nmt.add_argument("command_name", choices=_NMT, metavar="|".join(_NMT))
    nmt.add_argument("node_number", type=node_or_all_argument, metavar="NODE|all")
    add_link(nmt, "for the heartbeat that shows the state", 1.2)


def node_or_all_argument(text: str) -> int:
    return 0 if text == "all" else node_argument(text)


def _scan(args: argparse.Namespace) -> int:
    with open_bus(args) as bus:
        document = scan(bus, args.timeout)
    return output.show(args, document, scan_text)


def scan(bus: CanopenBus, listen: float) -> Document:
    """The nodes that answer or send a heartbeat."""
    from plctool.canopen.scan import scan as nodes_on
    from plctool.canopen.sdo import DEFAULT_TIMEOUT
    from plctool.canopen.words import profile_text, state_text

    return {
        "nodes": [
            {
                "node": n.number,
                "state": None if n.state is None else state_text(n.state),
                "device_type": n.device_type,
                "profile": "" if n.device_type is None else profile_text(n.device_type),
                "vendor": n.vendor,
                "product": n.product,
                "revision": n.revision,
                "serial": n.serial,
                "name": n.name,
                "problem": n.problem,
            }
            for n in nodes_on(bus, listen, DEFAULT_TIMEOUT)
        ]
    }


def scan_text(document: Document) -> str:
    """A line for each node; numbers in hex as in data sheets."""
    columns = ["node", "state", "profile", "vendor", "product", "revision", "serial", "name"]
    if any(n["problem"] for n in document["nodes"]):
        columns.append("problem")
    numbers = ("vendor", "product", "revision", "serial")
    rows = [
        {
            **n,
            "state": n["state"] or "no heartbeat",
            **{k: "-" if n[k] is None else f"0x{n[k]:X}" for k in numbers},
        }
        for n in document["nodes"]
    ]
    return table(rows, columns)


def _nmt(args: argparse.Namespace) -> int:
    with open_bus(args) as bus:
        document = nmt(bus, args.command_name, args.node_number, args.timeout)
    return output.show(args, document, nmt_text)


def nmt(bus: CanopenBus, name: str, node: int, timeout: float) -> Document:
    """Sends a command; the states that heartbeats show afterwards."""
    from plctool.canopen.nmt import COMMANDS, command
    from plctool.canopen.words import state_text

    states = command(bus, COMMANDS[name], node, timeout)
    return {
        "command": name,
        "node": node or "all",
        "states": {str(number): state_text(state) for number, state in states.items()},
    }


def nmt_text(document: Document) -> str:
    """The state of each node that shows one."""
    if document["states"]:
        return "\n".join(f"node {node}: {state}" for node, state in document["states"].items())
    which = "No node" if document["node"] == "all" else f"Node {document['node']}"
    verb = "sends" if document["node"] == "all" else "does not send"
    return f"The command was sent. {which} {verb} a heartbeat, so the state is not known."
