"""`plctool io`: what is connected to the inputs and outputs."""

from __future__ import annotations

import argparse
import os
import re
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli import io_documents, output
from plctool.cli.arguments import add_image, add_link, utf8
from plctool.cli.builds import image_of
from plctool.cli.connections import on_device
from plctool.cli.documents import Document
from plctool.cli.output import table
from plctool.cli.parser import Parser
from plctool.errors import UsageError, did_you_mean
from plctool.files import file_path, is_inside, usable_path, write_atomically
from plctool.project import find_project

if TYPE_CHECKING:
    from plctool.device import Plc
    from plctool.iec.types import Type

_LAST_PARAMETER = 0xFFFF_FFFF
_OBJECT = re.compile(r"([0-9A-F]{4}):([0-9A-F]{1,2})", re.ASCII | re.IGNORECASE)
_STRING = re.compile(r"STRING\[([1-9]\d?|1\d\d|2[0-4]\d|25[0-5])\]", re.ASCII)


def io_arguments(command: Parser) -> None:
    action = command.adder_of_actions()
    io_map = action("map", "list the channels of an image with their variables and tasks", _map)
    add_image(io_map)
    init = action("init", "write a description with comments, to begin with", _init)
    init.add_argument("file", type=file_path, nargs="?", default=Path("main.io.toml"), metavar="FILE.io.toml")
    init.add_argument("--device", type=usable_path, metavar="FILE.toml", help="what the vendor says of the board")
    add_link(action("status", "show how the devices of the running program are", _status))
    scan = action("scan", "list what is on a bus", _scan)
    scan.add_argument("io_device", type=utf8, metavar="BUS", help="its name in 'plctool io status'")
    add_link(scan)
    identify = action("identify", "let a device show itself", _identify)
    identify.add_argument("io_device", type=utf8, metavar="DEVICE", help="its name in 'plctool io status'")
    add_link(identify)
    param = action("param", "read or set a parameter of a device, until the program is loaded again", _param)
    param.add_argument("verb", choices=["get", "set"], metavar="get|set")
    param.add_argument("io_device", type=utf8, metavar="DEVICE", help="its name in 'plctool io status'")
    param.add_argument(
        "parameter", type=utf8, metavar="NAME|ID[=VALUE]", help="set: with its value; INDEX:SUB of a CANopen node"
    )
    param.add_argument("--type", metavar="TYPE", help="of one that the description does not have; default: UDINT")
    add_link(param, symbols=True)


def _map(args: argparse.Namespace) -> int:
    return output.show(args, channels_of(image_of(args)), io_map_text)


def _init(args: argparse.Namespace) -> int:
    return output.show(args, init(args.file, args.device), lambda d: f"{d['description']} written")


def _status(args: argparse.Namespace) -> int:
    return on_device(args, status, io_status_text)


def _scan(args: argparse.Namespace) -> int:
    return on_device(args, lambda plc: scan(plc, args.io_device), io_scan_text)


def _identify(args: argparse.Namespace) -> int:
    operation = lambda plc: identify(plc, args.io_device)  # noqa: E731
    return on_device(args, operation, lambda d: f"{d['device']} shows itself")


def _param(args: argparse.Namespace) -> int:
    name, equals, text = args.parameter.partition("=")
    if (args.verb == "set") != bool(equals):
        example = f"set {args.io_device} {name}=1" if args.verb == "set" else f"get {args.io_device} {name}"
        raise UsageError(f"Write for example: plctool io param {example}.", "usage")
    value = text if args.verb == "set" else None
    operation = lambda plc: parameter(plc, args.io_device, name, args.type, value)  # noqa: E731
    return on_device(args, operation, lambda d: f"{d['device']} {d['parameter']} = {d['text']}")


def channels_of(path: Path) -> Document:
    """The channels of an image."""
    from plctool.debug.symbols import find_symbols
    from plctool.image.file import describe_image, read_program

    symbols = find_symbols(int(describe_image(read_program(path))["crc"], 16), path)
    return {"channels": symbols.io.get("channels", [])}


def init(path: Path, device: Path | None) -> Document:
    """Writes a description to begin with. Raises UsageError if there is one already."""
    from plctool.io.beginning import beginning

    if path.exists():
        raise UsageError(f"{path} is there already; write another one, or remove it first.", "exists")
    if not path.name.endswith(".io.toml"):
        raise UsageError(f"A description is called NAME.io.toml; write {path.stem}.io.toml.", "bad-output")
    board = None if device is None else io_documents.board_file(device)
    if device is not None:
        _check_can_be_named(device, path)
    write_atomically(path, beginning(board, None if device is None else _beside(device, path)).encode())
    return {"description": str(path)}


def _check_can_be_named(device: Path, description: Path) -> None:
    """Raises UsageError for a device file outside the project, which a description cannot name."""
    from plctool.io.description import root_of

    project = find_project(description.parent)
    folder = root_of(description, None if project is None else project.parent)
    if not is_inside(device, folder):
        raise UsageError(
            f"{device} is outside {folder.resolve()}, so {description.name} cannot name it; copy it there first.",
            "outside",
        )


def _beside(device: Path, path: Path) -> str:
    """How a description at `path` names a device file."""
    return Path(os.path.relpath(device.resolve(), path.resolve().parent)).as_posix()


def status(plc: Plc) -> Document:
    """How the devices of the program are."""
    return {"devices": [{**vars(device), "state": device.state} for device in plc.io_devices()]}


def scan(plc: Plc, bus: str) -> Document:
    """What is on a bus."""
    return {"bus": bus, "devices": [vars(module) for module in plc.io_scan(bus)]}


def identify(plc: Plc, device: str) -> Document:
    """A device shows itself."""
    plc.io_identify(device)
    return {"device": device, "identified": True}


def parameter(plc: Plc, device: str, parameter: str, type_name: str | None, text: str | None = None) -> Document:
    """Reads a parameter, or sets it to what `text` says. `parameter`: a number, or a name of the description;
    `type_name`: of one that the description does not have."""
    from plctool.iec.value_texts import literal, parse_value

    number, t = _parameter(plc, device, parameter, type_name)
    if text is not None and type_name is None and _object(parameter):
        message = f"The node needs the length of {parameter}: give its type, for example --type UINT."
        raise UsageError(message, "bad-type")
    if text is not None:
        plc.io_write_parameter(device, number, t, parse_value(t, text))
    value = plc.io_read_parameter(device, number, t)
    return {"device": device, "parameter": parameter, "id": number, "value": value, "text": literal(t, value)}


def _object(parameter: str) -> int | None:
    """The parameter that an object of a CANopen node is, `6041:00`; None for other parameters."""
    match = _OBJECT.fullmatch(parameter)
    return None if match is None else int(match[1], 16) << 8 | int(match[2], 16)


def _parameter(plc: Plc, device: str, parameter: str, type_name: str | None) -> tuple[int, Type]:
    """Number and type of a parameter."""
    from plctool.iec.types import ELEMENTARY, StringType

    known: list[Document] = []
    with suppress(UsageError):  # without symbols numbers will do
        devices = plc.symbols().io.get("devices", [])
        known = next((d["parameters"] for d in devices if d["name"].casefold() == device.casefold()), [])
    number = None
    with suppress(ValueError):
        number = _object(parameter) or int(parameter, 0)
    found = next((p for p in known if p["id"] == number or p["name"].casefold() == parameter.casefold()), None)
    if number is not None and not 0 <= number <= _LAST_PARAMETER:
        raise UsageError(f"{parameter} is not the number of a parameter; they are of 32 bits.", "unknown-parameter")
    if found is None and number is None:
        hint = did_you_mean(parameter, (p["name"] for p in known)) or "; give its number, and its type by --type."
        raise UsageError(f"{device} has no parameter {parameter}{hint}", "unknown-parameter")
    name = (type_name or (found["type"] if found else "UDINT")).upper()
    string = _STRING.fullmatch(name)
    t: Type | None = StringType(int(string[1])) if string else ELEMENTARY.get(name)
    if t is None:
        raise UsageError(f"A parameter cannot be {name}; use for example UINT, REAL or STRING[20].", "bad-type")
    return found["id"] if found else number or 0, t


def io_map_text(document: dict[str, Any]) -> str:
    """A line for each channel."""
    rows = [
        {
            **c,
            "tasks": ", ".join(c["tasks"]),
            "direction": "out" if c["output"] else "in",
            "age": io_documents.age_text(c["age_us"]),
        }
        for c in document["channels"]
    ]
    columns = ("device", "channel", "direction", "variable", "type", "address", "tasks", "age")
    return table(rows, columns) if rows else "This image has no inputs and outputs but memory; see docs/io.md."


def io_status_text(document: dict[str, Any]) -> str:
    """A line for each device."""
    rows = [
        {**d, "age": "-" if d["age_ms"] is None else f"{d['age_ms']} ms", "device": d["name"]}
        for d in document["devices"]
    ]
    columns = ("device", "driver", "state", "age", "errors", "skipped")
    return table(rows, columns) if rows else "The program has no devices."


def io_scan_text(document: dict[str, Any]) -> str:
    """A line for each device on a bus."""
    rows = [{**d, **{k: f"0x{d[k]:X}" for k in ("vendor", "product", "revision")}} for d in document["devices"]]
    columns = ("slot", "name", "vendor", "product", "revision")
    return table(rows, columns) if rows else f"Nothing answers on {document['bus']}."
