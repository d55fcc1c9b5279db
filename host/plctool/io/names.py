"""Names of devices, lines and modules."""

from __future__ import annotations

import re

from plctool.core import lib

MAX_NAME = int(lib.IO_CONFIG_MAX_NAME) - 1
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)


def is_name(text: str) -> bool:
    """Whether a text can be the name of a device, a line or a module: of a variable, too."""
    return len(text) <= MAX_NAME and _NAME.fullmatch(text) is not None
