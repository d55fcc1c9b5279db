"""`plctool canopen sdo`, `watch`: the objects of a node."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli import output
from plctool.cli.arguments import DEFAULT_INTERVAL, duration_s, utf8
from plctool.cli.commands.canopen.bus import (
    add_eds,
    add_link,
    add_stream,
    node_argument,
    open_bus,
    print_lines,
    usable_eds,
)
from plctool.cli.documents import Document
from plctool.cli.overwriting import check_not_read
from plctool.cli.parser import Parser
from plctool.errors import DeviceError, UsageError
from plctool.files import read_regular, usable_path, write_output
from plctool.io.canopen.data_types import DOMAIN, VISIBLE_STRING, DataType, type_named
from plctool.io.canopen.eds import READABLE, WRITABLE, Entry

if TYPE_CHECKING:
    from plctool.canopen.bus import CanopenBus

_STRINGS = (0x1008, 0x1009, 0x100A)  # objects of CiA 301 that are strings in every device


def add_sdo(action: Callable[..., Parser]) -> None:
    sdo = action("sdo", "read or write an object of a node", _sdo)
    sdo.add_argument("verb", choices=["read", "write"], metavar="read|write")
    sdo.add_argument("node_number", type=node_argument, metavar="NODE", help="1 to 127")
    sdo.add_argument("object", type=object_argument, metavar="INDEX[:SUB]", help="in hex: 6041, 1018:01")
    sdo.add_argument("value", nargs="?", type=utf8, metavar="VALUE", help="to write, unless --file has it")
    sdo.add_argument("--type", metavar="TYPE", help="U16, INTEGER32, REAL32, STRING and so on, if no EDS says it")
    sdo.add_argument("--file", type=usable_path, metavar="FILE", help="write its bytes, or read into it")
    sdo.add_argument("--no-block", action="store_true", help="do not try block transfer")
    add_eds(sdo)
    add_link(sdo, "for a reply", 1.0)


def add_watch(action: Callable[..., Parser]) -> None:
    watch = action("watch", "print values of objects periodically", _watch)
    watch.add_argument("node_number", type=node_argument, metavar="NODE")
    watch.add_argument("objects", nargs="+", type=object_argument, metavar="INDEX[:SUB]")
    watch.add_argument("--type", metavar="TYPE", help="of all of them, if no EDS says it")
    watch.add_argument(
        "--interval",
        type=duration_s,
        default=DEFAULT_INTERVAL,
        metavar="S",
        help=f"seconds; default: {DEFAULT_INTERVAL}",
    )
    add_eds(watch)
    add_stream(watch, "reading")


def object_argument(text: str) -> tuple[int, int]:
    """Index and sub-index of 6041, 0x6041, 1018:01."""
    found = re.fullmatch(r"(?:0x)?([0-9a-f]{4})(?::(?:0x)?([0-9a-f]{1,2}))?", text, re.IGNORECASE)
    if found is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not an object; write its index in hex: 6041 or 1018:01")
    return int(found[1], 16), int(found[2] or "0", 16)


def _sdo(args: argparse.Namespace) -> int:
    access = _access(args, args.object)
    if args.verb == "read":
        if args.value is not None:
            raise UsageError("'sdo read' takes no value; write 'sdo write' to set one.", "usage")
        if args.file is not None:
            check_not_read(args.file, [args.eds] if args.eds else [], "--file value.bin")
        with open_bus(args) as bus:
            document = sdo_read(bus, args.node_number, access, args.timeout, args.file, not args.no_block)
        return output.show(args, document, sdo_text)
    if (args.value is None) == (args.file is None):
        raise UsageError("Give what to write: VALUE, or --file FILE.", "usage")
    data = sdo_data(access, args.value, args.file)
    with open_bus(args) as bus:
        document = sdo_write(bus, args.node_number, access, data, args.timeout, not args.no_block)
    return output.show(args, document, sdo_text)


def sdo_read(bus: CanopenBus, node: int, access: Access, timeout: float, file: Path | None, block: bool) -> Document:
    """Reads an object; its bytes go to a file if there is one."""
    from plctool.canopen.sdo import SdoClient

    if access.entry is not None and access.entry.access not in READABLE:
        raise UsageError(f"{access.place} is {access.entry.access}: it can only be written.", "access")
    is_long = file is not None or access.type is DOMAIN
    size = 0 if access.type is None else access.type.size
    data = SdoClient(bus, node, timeout).read(access.index, access.sub, block=block and is_long, expected=size)
    if file is not None:
        write_output(file, data)
        return {**_about(node, access), "size": len(data), "file": str(file)}
    return {**_about(node, access), **_value(node, access, data)}


def _about(node: int, access: Access) -> Document:
    return {"node": node, "object": access.place, "name": access.name}


def _value(node: int, access: Access, data: bytes) -> Document:
    """The value in the bytes of a device: by its type, else a number without sign if it has 1, 2, 4 or 8 bytes."""
    if access.type is None:
        if len(data) in (1, 2, 4, 8):
            number = int.from_bytes(data, "little")
            return {"value": number, "text": f"{number} (0x{number:0{2 * len(data)}X})", "data": data.hex()}
        return {"value": data.hex(), "text": data.hex(" ") or "no bytes", "data": data.hex()}
    try:
        value = access.type.decode(data)
    except ValueError as error:
        raise DeviceError(f"{access.place} of node {node} has another type: {error}.", "bad-type") from None
    text = access.type.text(value)
    if access.type.kind == "unsigned" and isinstance(value, int):
        text += f" (0x{value:0{2 * access.type.size}X})"
    return {"value": value.hex() if isinstance(value, bytes) else value, "text": text, "data": data.hex()}


def sdo_data(access: Access, text: str | None, file: Path | None) -> bytes:
    """The bytes to write, checked against type, access and limits. Raises UsageError."""
    entry = access.entry
    if entry is not None and entry.access not in WRITABLE:
        raise UsageError(f"{access.place} is {entry.access}: it cannot be written.", "access")
    if file is not None:
        return _bytes_of(file)
    if access.type is None:
        raise UsageError(f"Say the type of {access.place}: --type U16, for example, or --eds FILE.", "bad-type")
    try:
        value = access.type.parse(text or "")
    except ValueError as error:
        raise UsageError(f"{access.place}: {error}.", "bad-value") from None
    for limit, what in ((entry.low, "below its low limit"), (entry.high, "above its high limit")) if entry else ():
        bound = None if limit is None or limit.node_id else limit.value
        if isinstance(value, int | float) and isinstance(bound, int | float):
            outside = value < bound if limit is entry.low else value > bound  # type: ignore[union-attr]
            if outside:
                raise UsageError(f"{access.place}: {text} is {what} {bound}.", "bad-value")
    return access.type.encode(value)


def _bytes_of(file: Path) -> bytes:
    from plctool.canopen.sdo import MAX_VALUE

    try:
        return read_regular(file, MAX_VALUE)
    except OSError as error:
        raise UsageError(f"{file} cannot be read: {error.strerror}.", "no-file") from None


def sdo_write(bus: CanopenBus, node: int, access: Access, data: bytes, timeout: float, block: bool) -> Document:
    """Writes an object."""
    from plctool.canopen.sdo import SdoClient

    SdoClient(bus, node, timeout).write(access.index, access.sub, data, block=block)
    return {**_about(node, access), "size": len(data), "written": True}


def sdo_text(document: Document) -> str:
    """`6041:00 Statusword = 39 (0x0027)`."""
    name = " ".join(filter(None, (document["object"], document["name"])))
    if "text" in document:
        return f"{name} = {document['text']}"
    if "file" in document:
        return f"{document['file']}: {document['size']} bytes of {name}"
    return f"{name}: {document['size']} bytes written"


def _watch(args: argparse.Namespace) -> int:
    accesses = [_access(args, place) for place in args.objects]
    with open_bus(args) as bus:
        lines = watch(bus, args.node_number, accesses, args.interval, args.timeout)
        return print_lines(args, lines, watch_text)


def watch(
    bus: CanopenBus, node: int, accesses: Sequence[Access], interval: float, timeout: float
) -> Iterator[Document]:
    """Values of objects, read one after the other each `interval` seconds."""
    from plctool.canopen.sdo import SdoClient

    client, begin = SdoClient(bus, node, timeout), bus.now()
    following = begin
    while True:
        for _ in bus.frames(following - bus.now()):
            pass
        following = max(following + interval, bus.now())
        moment = bus.now() - begin
        values = []
        for access in accesses:
            size = 0 if access.type is None else access.type.size
            data = client.read(access.index, access.sub, expected=size)
            values.append({"object": access.place, "name": access.name, **_value(node, access, data)})
        yield {"time_s": round(moment, 6), "node": node, "values": values}


def watch_text(document: Document) -> str:
    """A line: time and values."""
    return "  ".join([f"{document['time_s']:8.3f} s", *map(sdo_text, document["values"])])


def _access(args: argparse.Namespace, place: tuple[int, int]) -> Access:
    return access_to(place, args.type, args.eds)


@dataclass(frozen=True)
class Access:
    """An object that a user names, with what is known of it."""

    index: int
    sub: int
    type: DataType | None
    entry: Entry | None = None

    @property
    def place(self) -> str:
        """`6041:00`."""
        return f"{self.index:04X}:{self.sub:02X}"

    @property
    def name(self) -> str:
        """What the EDS calls it, "" without one."""
        return "" if self.entry is None else self.entry.name


def access_to(place: tuple[int, int], type_name: str | None, path: Path | None) -> Access:
    """An object with its type: the one that is named, or that of the EDS. Raises UsageError."""
    index, sub = place
    eds = None if path is None else usable_eds(path)
    entry = None if eds is None else eds.entry(index, sub)
    if eds is not None and entry is None and type_name is None:
        raise UsageError(f"{eds.file} has no object {index:04X}:{sub:02X}; give --type to use it anyway.", "no-object")
    if type_name is not None:
        try:
            return Access(index, sub, type_named(type_name), entry)
        except ValueError as error:
            raise UsageError(f"{error}.", "bad-type") from None
    known = entry.type if entry is not None else VISIBLE_STRING if index in _STRINGS else None
    return Access(index, sub, known, entry)
