"""`[gpio]`: lines of the board (IoDrvGpio), by the names of `device.toml`, or by those of the port.

[gpio]
in  = { DI0 = "Main.start", DI1 = { var = "%IX0.1", pull = "up", invert = true, event = "door", edge = "rising" } }
out = { DO0 = "Main.motor", "gpiochip0:17" = { var = "Main.lamp", on_stop = "hold", open_drain = true } }
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from plctool.core import lib
from plctool.errors import did_you_mean
from plctool.files import Pos
from plctool.iec.types import BOOL, USINT, StringType
from plctool.io.channels import channel_of
from plctool.io.common import read_connector
from plctool.io.model import Channel, Connector, Context, Parameter
from plctool.io.names import MAX_LINE, is_line, numbered
from plctool.io.tables import Entry, Table

DRIVER = "IoDrvGpio"
LINES = int(lib.IO_GPIO_LINES)
_PULLS = {"none": 0, "up": int(lib.GPIO_OPTION_PULL_UP), "down": int(lib.GPIO_OPTION_PULL_DOWN)}
_RISING, _FALLING = int(lib.GPIO_OPTION_RISING), int(lib.GPIO_OPTION_FALLING)
_EDGES = {"rising": _RISING, "falling": _FALLING, "both": _RISING | _FALLING}


@dataclass(frozen=True)
class _Line:
    """`name`: what the port calls it."""

    channel: Channel
    name: str
    options: int


def read_gpio(table: Table, context: Context) -> list[Connector]:
    """The lines of a table, on as many connectors as they need."""
    first = read_connector(Connector, table, DRIVER, default_name="gpio")
    lines = list(_lines(table, context, context.lines if first.enabled else {}))
    connectors = [first]
    for number in range(1, -(-len(lines) // LINES)):
        name = numbered(first.name, number + 1)
        connectors.append(replace(first, name=name, parameters=[], channels=[], variable=False))
    for connector, start in zip(connectors, range(0, len(lines) or 1, LINES), strict=True):
        _fill(connector, lines[start : start + LINES])
    return connectors


def _fill(connector: Connector, lines: list[_Line]) -> None:
    for number, line in enumerate(lines):
        channel = line.channel
        channel.parameter = int(lib.GPIO_OUTPUTS if channel.output else lib.GPIO_INPUTS)
        channel.parameter_bit = number
        connector.channels.append(channel)
        texts = [(int(lib.GPIO_LINE), line.name, channel.name)]
        texts += [(int(lib.GPIO_EVENT), channel.event, f"{channel.name}.event")] if channel.event else []
        connector.parameters += [Parameter(i + number, StringType(len(text)), text, n) for i, text, n in texts]
        if line.options:
            options = int(lib.GPIO_OPTIONS) + number
            connector.parameters.append(Parameter(options, USINT, line.options, f"{channel.name}.options"))
    connector.parameters.sort(key=lambda p: p.id)


def _lines(table: Table, context: Context, used: dict[str, Pos]) -> Iterator[_Line]:
    """`used`: where each line of the board that is in use was named."""
    for entry, output in table.channels():
        name = _name(entry, table, context, output)
        options, event = _options(entry, output)
        channel = channel_of(entry, table.mistakes, output=output, bits=1, type=BOOL)
        if name is None or channel is None:
            continue
        if name in used:
            where = f"in line {used[name].line}"
            table.mistakes.error(entry.key_pos, f"{entry.key} is the line {name}, which is in use {where} already")
            continue
        used[name] = entry.key_pos
        channel.event, channel.rising, channel.falling = event, bool(options & _RISING), bool(options & _FALLING)
        yield _Line(channel, name, options)


def _options(entry: Entry, output: bool) -> tuple[int, str]:
    """GPIO_OPTION_* of a line, and its event."""
    table = entry.value
    options = int(lib.GPIO_OPTION_OUT) if output else 0
    if not isinstance(table, Table):
        return options, ""
    options |= int(lib.GPIO_OPTION_ACTIVE_LOW) * table.flag("invert")
    if output:
        return options | int(lib.GPIO_OPTION_OPEN_DRAIN) * table.flag("open_drain"), ""
    options |= table.choice("pull", _PULLS, 0) or 0
    event, edge = table.text("event", "") or "", table.choice("edge", _EDGES)
    if "event" in table and not is_line(event):
        table.error(f"the name of an event has 1 to {MAX_LINE} ASCII characters", "event")
    if edge is not None and not event:
        table.error("edge says when the event is posted; name it: event = ...", "edge")
    return options | ((edge or _RISING) if event else 0), event


def _name(entry: Entry, table: Table, context: Context, output: bool) -> str | None:
    """What the port calls a line; None after a mistake."""
    device = context.device
    if device is None:
        if is_line(entry.key):
            return entry.key
        table.mistakes.error(entry.key_pos, f"the name of a line has 1 to {MAX_LINE} ASCII characters")
        return None
    line = device.lines.get(entry.key)
    if line is None:
        fitting = [name for name, line in device.lines.items() if line.output is output]
        hint = did_you_mean(entry.key, fitting) or (f"; it has {', '.join(fitting)}" if fitting else "")
        table.mistakes.error(entry.key_pos, f"{device.title} has no line {entry.key}{hint}")
        return None
    if line.output is not output:
        is_a, other = ("an output", "out") if line.output else ("an input", "in")
        table.mistakes.error(entry.key_pos, f"{entry.key} is {is_a} of {device.title}; move it to {other}")
        return None
    return line.line
