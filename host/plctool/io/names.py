"""Names of devices, lines and modules."""

from __future__ import annotations

import re

from plctool.core import lib

MAX_NAME = int(lib.IO_CONFIG_MAX_NAME) - 1
MAX_LINE = 63  # characters of a line of the board, a serial line or an event
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)


def is_name(text: str) -> bool:
    """Whether a text can be the name of a device, a line or a module: of a variable, too."""
    return len(text) <= MAX_NAME and _NAME.fullmatch(text) is not None


def is_line(text: str) -> bool:
    """Whether a text can be what a port calls a line."""
    return 0 < len(text) <= MAX_LINE and text.isascii() and text.isprintable()


def numbered(name: str, number: int) -> str:
    """The name of one of several devices that are made of one table."""
    end = f"_{number}"
    return name[: MAX_NAME - len(end)] + end
