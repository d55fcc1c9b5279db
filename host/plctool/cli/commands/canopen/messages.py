"""`plctool canopen emcy`, `pdo`: what nodes send by themselves."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from plctool.cli.commands.canopen.bus import (
    FOREVER,
    add_eds,
    add_stream,
    node_argument,
    open_bus,
    print_lines,
    usable_eds,
)
from plctool.cli.documents import Document
from plctool.cli.parser import Parser
from plctool.errors import DeviceError, UsageError

if TYPE_CHECKING:
    from pathlib import Path

    from plctool.canopen.bus import CanopenBus
    from plctool.io.canopen.eds import Eds


def add_emcy(action: Callable[..., Parser]) -> None:
    emcy = action("emcy", "print emergency messages", _emcy)
    emcy.add_argument("--node", dest="node_number", type=node_argument, metavar="NODE", help="only of this node")
    add_stream(emcy, "message")


def add_pdo(action: Callable[..., Parser]) -> None:
    pdo = action("pdo", "print the values in the PDOs of a node", _pdo)
    pdo.add_argument("node_number", type=node_argument, metavar="NODE")
    pdo.add_argument("--passive", action="store_true", help="send nothing: take the mapping from the EDS")
    add_eds(pdo)
    add_stream(pdo, "PDO")


def _emcy(args: argparse.Namespace) -> int:
    with open_bus(args) as bus:
        return print_lines(args, emergencies(bus, args.node_number), emergency_text)


def emergencies(bus: CanopenBus, node: int | None) -> Iterator[Document]:
    """Emergency messages as they come, of one node or of all."""
    from plctool.canopen.emcy import emergency_of
    from plctool.canopen.words import emcy_text, register_text

    begin = bus.now()
    for frame in bus.frames(FOREVER):
        found = emergency_of(frame)
        if found is None or node not in (None, found.node):
            continue
        yield {
            "time_s": round(frame.time - begin, 6),
            "node": found.node,
            "code": found.code,
            "text": emcy_text(found.code),
            "register": found.register,
            "register_text": register_text(found.register),
            "data": found.data.hex(),
        }


def emergency_text(document: Document) -> str:
    """A line: time, node, code and what it means."""
    register = f"; register: {document['register_text']}" if document["register"] else ""
    return (
        f"{document['time_s']:8.3f} s  node {document['node']}  {document['code']:04X}  {document['text']}"
        f"{register}; data {document['data']}"
    )


def _pdo(args: argparse.Namespace) -> int:
    if args.passive and args.eds is None:
        raise UsageError("--passive takes the mapping from an EDS; name one with --eds.", "usage")
    eds = _eds(args.eds)
    with open_bus(args) as bus:
        lines = pdos(bus, args.node_number, eds, args.timeout, passive=args.passive)
        return print_lines(args, lines, pdo_text)


def _eds(path: Path | None) -> Eds | None:
    return None if path is None else usable_eds(path)


def pdos(bus: CanopenBus, node: int, eds: Eds | None, timeout: float, *, passive: bool) -> Iterator[Document]:
    """The values of PDOs as they come. `passive`: their mapping is that of the EDS, and nothing is sent."""
    from plctool.canopen.pdo import RPDO, TPDO, naming_by, pdos_of_device, pdos_of_eds, values_in
    from plctool.canopen.sdo import SdoClient

    if passive and eds is not None:
        found = [pdo for base in (TPDO, RPDO) for pdo in pdos_of_eds(eds, node, base)]
    else:
        client = SdoClient(bus, node, timeout)
        found = [pdo for base in (TPDO, RPDO) for pdo in pdos_of_device(client, base)]
    by_identifier = {pdo.identifier: pdo for pdo in found}
    if not by_identifier:
        raise DeviceError(f"Node {node} has no PDO that is switched on.", "no-pdo")
    naming, begin = naming_by(eds), bus.now()
    for frame in bus.frames(FOREVER):
        pdo = by_identifier.get(frame.identifier)
        if pdo is None:
            continue
        parts = values_in(pdo, frame, naming)
        yield {
            "time_s": round(frame.time - begin, 6),
            "node": node,
            "pdo": pdo.name,
            "data": frame.data.hex(),
            "values": None
            if parts is None
            else [
                {"name": p.name, "value": p.value.hex() if isinstance(p.value, bytes) else p.value, "text": p.text}
                for p in parts
            ],
        }


def pdo_text(document: Document) -> str:
    """A line: time, PDO and its values."""
    head = f"{document['time_s']:8.3f} s  {document['pdo']}"
    if document["values"] is None:
        return f"{head}  {document['data'] or 'no data'}: shorter than its mapping"
    return "  ".join([head, *(f"{v['name']} = {v['text']}" for v in document["values"])])
