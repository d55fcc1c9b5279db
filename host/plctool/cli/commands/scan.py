"""`plctool scan`: the devices that answer."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from plctool.cli import output
from plctool.cli.arguments import add_link
from plctool.cli.connections import gateway_wanted, me
from plctool.cli.documents import Document
from plctool.cli.links import all_links, find_link
from plctool.cli.output import table
from plctool.cli.parser import Parser
from plctool.errors import LinkError, PlcError
from plctool.link.transports import Link

if TYPE_CHECKING:
    from plctool.link.names import Node


def scan_arguments(command: Parser) -> None:
    command.add_argument("--long", action="store_true", help="also show the state and the program of each device")
    add_link(command)
    command.set_defaults(action=_scan)


def _scan(args: argparse.Namespace) -> int:
    link = find_link(args)
    if link is None:
        document = scan_all(all_links(args), gateway_wanted(args), me(args), args.long)
    else:
        document = scan(link, gateway_wanted(args), me(args), args.long)
    return output.show(args, document, devices_text)


def scan(link: Link, gateway: bool | None, tool: str, long: bool = False) -> Document:
    """Returns the controllers that answer on a link; if `long`, with what each of them runs. Raises LinkError when
    there are none."""
    return {"devices": _devices_on(link, gateway, tool, long)}


def scan_all(links: Sequence[Link], gateway: bool | None, tool: str, long: bool = False) -> Document:
    """Returns the same for several links, which are asked at the same time, each device with its link. Raises
    LinkError when there are none, with the reason of each link."""
    from concurrent.futures import ThreadPoolExecutor

    def ask(link: Link) -> list[Document] | LinkError:
        try:
            return [
                {"link": f"{link.scheme}:{link.place}", **found} for found in _devices_on(link, gateway, tool, long)
            ]
        except LinkError as error:
            return error

    with ThreadPoolExecutor(max_workers=len(links)) as pool:
        answers = list(pool.map(ask, links))
    devices = [device for answer in answers if not isinstance(answer, LinkError) for device in answer]
    if not devices:
        reasons = " ".join(answer.message for answer in answers if isinstance(answer, LinkError))
        raise LinkError(f"No device answers on the links of this machine. {reasons}", "no-answer")
    return {"devices": devices}


def _devices_on(link: Link, gateway: bool | None, tool: str, long: bool) -> list[Document]:
    from plctool.device import scan as nodes_on
    from plctool.image.file import target_name

    return [
        {
            "address": node.address_text,
            "node_name": node.node_name,
            "device_name": node.device_name,
            "vendor_name": node.vendor_name,
            "target": target_name(node.target_id),
            "version": node.version,
            "serial_number": node.serial_number,
            **({"place": node.place} if node.place else {}),
            **({"problem": "a component failed to start: see plctool log"} if node.left_out else {}),
            **(_runs_on(link, node, gateway, tool) if long else {}),
        }
        for node in nodes_on(link, gateway=gateway, tool=tool)
    ]


def _runs_on(link: Link, node: Node, gateway: bool | None, tool: str) -> Document:
    """Returns the state of a device and its program. A device that does not say gives the reason in place of its
    state, so that the others are listed."""
    from plctool.cli.commands.device import status
    from plctool.device import connect

    try:
        with connect(_link_to(link, node), gateway=gateway, tool=tool) as plc:
            found = status(plc)
    except PlcError as error:
        return {"state": error.code, "program": "", "program_version": ""}
    program = found["program"] or {"name": "", "version": ""}
    return {"state": found["state"], "program": program["name"], "program_version": program["version"]}


def _link_to(link: Link, node: Node) -> Link:
    """Returns the link to one of the devices that a scan of `link` found."""
    if link.nodes is not None:
        return link.of_node(str(int.from_bytes(node.address, "big")))
    return replace(link, place=node.place) if node.place else link


def devices_text(document: dict[str, Any]) -> str:
    """A line for each device that a scan found; what only some of them say is empty for the others."""
    columns = dict.fromkeys(name for device in document["devices"] for name in device)
    return table([{name: device.get(name, "") for name in columns} for device in document["devices"]], columns)
