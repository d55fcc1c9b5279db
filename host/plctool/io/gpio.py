"""`[gpio]`: lines of the board, by the names of `device.toml`, or by number (IoDrvGpio).

    [gpio]
    chip = "/dev/gpiochip0"                   # Linux
    in  = { DI0 = "Main.start", DI1 = { var = "%IX0.1", pull = "up", invert = true } }
    out = { DO0 = "Main.motor", "17" = "Main.lamp" }

A channel is one bit; the number of the line is its parameter.
"""

from __future__ import annotations

from plctool.errors import did_you_mean
from plctool.iec.types import BOOL, USINT, StringType
from plctool.io.channels import channel_of
from plctool.io.common import read_connector
from plctool.io.device_file import MAX_LINE, Line
from plctool.io.model import Connector, Context, Parameter
from plctool.io.tables import Entry, Table

DRIVER = "IoDrvGpio"
PARAMETER_CHIP = 1
PARAMETER_LINE = 0x1000  # and the number of the line: its pull, and whether it is inverted
_PULLS = {"none": 0, "up": 1, "down": 2}
_INVERTED = 4
_MAX_CHIP = 63


def read_gpio(table: Table, context: Context) -> list[Connector]:
    """The lines of a table, all on one connector."""
    connector = read_connector(Connector, table, DRIVER, default_name="gpio")
    chip = table.text("chip")
    if chip is not None:
        if not 0 < len(chip) <= _MAX_CHIP or not chip.isascii():
            table.error(f"chip has 1 to {_MAX_CHIP} ASCII characters", "chip")
        connector.parameters.append(Parameter(PARAMETER_CHIP, StringType(len(chip)), chip, "chip"))
    used: dict[int, str] = {}
    for key, output in (("in", False), ("out", True)):
        names = table.table(key)
        for entry in names.items() if names is not None else ():
            line = _line(entry, table, context, output)
            if line is None:
                continue
            if line in used:
                table.mistakes.error(entry.key_pos, f"{entry.key} is line {line}, which {used[line]} has already")
                continue
            used[line] = entry.key
            _add(connector, entry, table, line, output)
    connector.parameters.sort(key=lambda p: p.id)
    return [connector]


def _add(connector: Connector, entry: Entry, table: Table, line: int, output: bool) -> None:
    options = 0
    if isinstance(entry.value, Table):
        options = 0 if output else entry.value.choice("pull", _PULLS, 0) or 0
        options |= _INVERTED * entry.value.flag("invert")
    channel = channel_of(entry, table.mistakes, output=output, bits=1, type=BOOL, parameter=line)
    if channel is None:
        return
    connector.channels.append(channel)
    if options:
        connector.parameters.append(Parameter(PARAMETER_LINE + line, USINT, options, entry.key))


def _line(entry: Entry, table: Table, context: Context, output: bool) -> int | None:
    """The number of a line; None after a mistake."""
    device = context.device
    named: dict[str, Line] = device.lines if device is not None else {}
    if entry.key in named:
        line = named[entry.key]
        if line.output is not output:
            what = ("an input", "in") if output else ("an output", "out")
            table.mistakes.error(entry.key_pos, f"{entry.key} is {what[0]} of the board; move it to {what[1]}")
            return None
        return line.number
    if entry.key.isdecimal() and int(entry.key) <= MAX_LINE:
        return int(entry.key)
    if device is None:
        hint = '; name its number, or give the names of the board by device = "device.toml"'
    else:
        hint = (
            did_you_mean(entry.key, named) or f"; it has {', '.join(n for n, i in named.items() if i.output is output)}"
        )
    where = device.title if device is not None else "the board"
    table.mistakes.error(entry.key_pos, f"{where} has no line {entry.key}{hint}")
    return None
