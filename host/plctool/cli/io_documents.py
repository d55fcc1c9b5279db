"""What `plctool io` does, and what other commands say of inputs and outputs: functions that return the document that
`--json` prints."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.cli.overwriting import check_no_way_out, check_not_read
from plctool.errors import UsageError, did_you_mean
from plctool.files import is_inside, make_folder, write_atomically
from plctool.project import find_project

if TYPE_CHECKING:
    from plctool.device import Plc
    from plctool.iec.types import Type
    from plctool.io.configuration import Configuration
    from plctool.io.device_file import DeviceFile

Document = dict[str, Any]


_LAST_PARAMETER = 0xFFFF_FFFF
_STRING = re.compile(r"STRING\[([1-9]\d?|1\d\d|2[0-4]\d|25[0-5])\]", re.ASCII)


# ---- files -----------------------------------------------------------------------------------------------------------


def channels_of(path: Path) -> Document:
    """The channels of an image."""
    from plctool.debug.symbols import find_symbols
    from plctool.image.file import describe_image, read_program

    symbols = find_symbols(int(describe_image(read_program(path))["crc"], 16), path)
    return {"channels": symbols.io.get("channels", [])}


def summary(io: Document) -> Document:
    """What `build` prints of the inputs and outputs in a symbol file. `lines`: the share of its time that each line is
    used, of those that are shared by requests."""
    lines = [{"name": d["name"], "load": d["load"]} for d in io["devices"] if d.get("load") is not None]
    return {"channels": len(io["channels"]), "oldest_input": oldest_input(io["channels"]), "lines": lines}


def oldest_input(channels: Sequence[Document]) -> Document | None:
    """The input whose data may be the oldest when it is used."""
    inputs = [c for c in channels if not c["output"] and c["age_us"] is not None]
    oldest = max(inputs, key=lambda c: int(c["age_us"]), default=None)
    if oldest is None:
        return None
    return {"channel": f"{oldest['device']}.{oldest['channel']}", "age_us": oldest["age_us"]}


def configuration_in(data: bytes) -> Configuration | None:
    """The I/O configuration of an image, None if it has none. Raises UsageError for one that is damaged."""
    from plctool.image.file import parse_image
    from plctool.io.configuration import configuration_of_image

    return configuration_of_image(parse_image(data))


def board_in(data: bytes) -> str:
    """The board whose inputs and outputs an image means, "" for any."""
    configuration = configuration_in(data)
    return "" if configuration is None else configuration.board


def devices_of(data: bytes) -> list[Document]:
    """The devices in the I/O configuration of an image."""
    from plctool.core import lib

    configuration = configuration_in(data)
    if configuration is None:
        return []
    maps = [m for task in configuration.task_maps for m in task.connectors]
    places = [
        {(c.parameter, c.parameter_bit) for m in maps if m.connector == i for c in m.channels}
        for i in range(len(configuration.connectors))
    ]
    return [
        {
            "name": c.name,
            "driver": c.driver,
            "optional": bool(c.flags & lib.CF_OPTIONAL),
            "channels": len(used),
            "parameters": len(c.parameters),
        }
        for c, used in zip(configuration.connectors, places, strict=True)
    ]


def init(path: Path, device: Path | None) -> Document:
    """Writes a description to begin with. Raises UsageError if there is one already."""
    from plctool.io.beginning import beginning

    if path.exists():
        raise UsageError(f"{path} is there already; write another one, or remove it first.", "exists")
    if not path.name.endswith(".io.toml"):
        raise UsageError(f"A description is called NAME.io.toml; write {path.stem}.io.toml.", "bad-output")
    board = None if device is None else _board(device)
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


def export_board(device: Path, folder: Path) -> Document:
    """Writes the C header of a board from what its vendor says of it (`device.toml`)."""
    from plctool.io.board_header import board_header

    name, text = board_header(_board(device))
    check_not_read(folder / name, [device], "-o interface, a folder for it")
    check_no_way_out(folder / name, folder, "-o interface, a folder for it")
    make_folder(folder)
    write_atomically(folder / name, text.encode("ascii"))
    return {"header": str(folder / name)}


def _board(path: Path) -> DeviceFile:
    """A device file without mistakes. Raises CompileError with all of them."""
    from plctool.compiler import CompileError
    from plctool.compiler.base.source import Source
    from plctool.compiler.syntax.diagnostics import Diagnostic
    from plctool.io.description import load_device
    from plctool.io.mistakes import CODE

    device, mistakes, text = load_device(path)
    found = [Diagnostic(m.pos.file, m.pos.line, m.pos.column, m.severity, CODE, m.message) for m in mistakes.found]
    if device is None or found:
        raise CompileError(found, [Source(str(path), text)])
    return device


# ---- on a controller -------------------------------------------------------------------------------------------------


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
    if text is not None:
        plc.io_write_parameter(device, number, t, parse_value(t, text))
    value = plc.io_read_parameter(device, number, t)
    return {"device": device, "parameter": parameter, "id": number, "value": value, "text": literal(t, value)}


def _parameter(plc: Plc, device: str, parameter: str, type_name: str | None) -> tuple[int, Type]:
    """Number and type of a parameter."""
    from plctool.iec.types import ELEMENTARY, StringType

    known: list[Document] = []
    with suppress(UsageError):  # without symbols numbers will do
        devices = plc.symbols().io.get("devices", [])
        known = next((d["parameters"] for d in devices if d["name"].casefold() == device.casefold()), [])
    number = None
    with suppress(ValueError):
        number = int(parameter, 0)
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
