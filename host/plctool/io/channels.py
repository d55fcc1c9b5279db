"""Reading channels: `"Main.start"`, or a table `{ var = "Main.motor", on_stop = 0 }`."""

from __future__ import annotations

import re
from typing import Any

from plctool.files import Pos
from plctool.iec.addresses import parse_address, parse_module_address
from plctool.iec.areas import Area
from plctool.iec.types import Type
from plctool.io.mistakes import Mistakes
from plctool.io.model import HOLD, VALUE, ZERO, Channel, Substitute
from plctool.io.tables import Entry, Table

_NAME = r"[A-Za-z_]\w*"
VARIABLE = re.compile(rf"{_NAME}(?:\.{_NAME}|\[\s*-?\d+(?:\s*,\s*-?\d+)*\s*\])*", re.ASCII)
_WORDS = {"hold": Substitute(HOLD), "zero": Substitute(ZERO)}


def channel_of(
    entry: Entry,
    mistakes: Mistakes,
    *,
    output: bool,
    bits: int | None = None,
    type: Type | None = None,
    parameter: int = 0,
    holds: bool = False,
) -> Channel | None:
    """A channel from `NAME = "variable"` or `NAME = { var = ... }`; None after a mistake. `holds`: an output
    holds its value, too, unless it says otherwise."""
    if isinstance(entry.value, Table):
        channel = read_channel(
            entry.value, entry.key, output=output, bits=bits, type=type, parameter=parameter, holds=holds
        )
        entry.value.close()
        return channel
    name, target = entry.key, entry.value
    if not isinstance(target, str):
        example = f'{name} = "Main.{"motor" if output else "start"}"'
        mistakes.error(entry.pos, f"{name} needs the name of a variable: write for example {example}")
        return None
    if not is_target(target, entry.pos, mistakes, output=output):
        return None
    default = _default(output and not holds)
    return Channel(name, target, entry.pos, output, parameter, bits=bits, type=type, substitute=default)


def read_channel(
    table: Table,
    name: str,
    *,
    output: bool,
    bits: int | None = None,
    type: Type | None = None,
    parameter: int = 0,
    holds: bool = False,
) -> Channel | None:
    """A channel from the keys `var` and `on_stop` (outputs) or `on_error` (inputs) of a table that may have more keys,
    and that the caller closes; None after a mistake."""
    target = table.text("var", required="Main.motor" if output else "Main.start")
    substitute = read_substitute(table, "on_stop" if output else "on_error", _default(output and not holds))
    if target is None or not is_target(target, table.value_pos("var"), table.mistakes, output=output):
        return None
    pos = table.value_pos("var")
    return Channel(name, target, pos, output, parameter, bits=bits, type=type, substitute=substitute)


def _default(zero: bool) -> Substitute:
    return _WORDS["zero"] if zero else _WORDS["hold"]


def read_substitute(table: Table, key: str, default: Substitute) -> Substitute:
    """`"hold"`, `"zero"`, or a value of the channel."""
    value: Any = table.raw(key)
    if value is None:
        return default
    if isinstance(value, str) and value in _WORDS:
        return _WORDS[value]
    if not isinstance(value, str | int | float):
        hint = "" if isinstance(value, list | dict) else '; a date is written as in ST: "D#2024-02-29"'
        table.error(f'{key} can be "hold", "zero" or a value{hint}', key)
        return default
    return Substitute(VALUE, value, table.value_pos(key))


def is_target(text: str, pos: Pos, mistakes: Mistakes, *, output: bool) -> bool:
    """Whether a text can name what a channel leads to; reports it if not."""
    if text.startswith("%"):
        address = parse_address(text) or parse_module_address(text)
        letter, wanted = ("Q", Area.OUTPUT) if output else ("I", Area.INPUT)
        if address is None:
            mistakes.error(pos, f"{text} is not an address such as %{letter}X0.3 or %{letter}W2")
        elif address.area is not wanted:
            what = "an output leads to %Q" if output else "an input leads to %I"
            mistakes.error(pos, f"{text} cannot be here: {what}")
        else:
            return True
        return False
    if VARIABLE.fullmatch(text) is None:
        mistakes.error(pos, f"'{text}' is not a variable such as Main.start, or an address such as %IX0.1")
        return False
    return True
