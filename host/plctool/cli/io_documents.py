"""Inputs and outputs in the documents of several commands."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.cli.documents import Document

if TYPE_CHECKING:
    from plctool.io.configuration import Configuration
    from plctool.io.device_file import DeviceFile


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


def board_file(path: Path) -> DeviceFile:
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


def age_text(age_us: int | None) -> str:
    """A time as users read it; - for one that has no limit."""
    return "-" if age_us is None else f"{age_us / 1000:g} ms"
