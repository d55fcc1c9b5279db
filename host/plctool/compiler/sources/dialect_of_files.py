"""Which dialect the files of a program are written in, when none is chosen.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

_TWINCAT = frozenset((".plcproj", ".tsproj", ".tcpou", ".tcgvl", ".tcdut", ".tcio", ".tctto"))
_PRODUCT = re.compile(rb"<fileHeader\b[^>]*\bproductName=\"(CODESYS|TwinCAT)", re.IGNORECASE)
_HEAD = 4096  # bytes of an XML file in which its header stands


def dialect_of_files(files: Iterable[Path]) -> tuple[str, Path] | None:
    """The dialect, and the first file that is of it. None when no file is of one system alone, or when files of both
    systems are there. Structured Text, and files of other systems, go with either."""
    found: dict[str, Path] = {}
    for file in files:
        name = _dialect_of(file)
        if name:
            found.setdefault(name, file)
    return next(iter(found.items())) if len(found) == 1 else None


def _dialect_of(file: Path) -> str:
    """Empty for what any system may have written."""
    suffix = file.suffix.lower()
    if suffix in _TWINCAT:
        return "twincat"
    if suffix == ".exp":
        return "codesys"
    if suffix != ".xml":
        return ""
    try:
        with file.open("rb") as stream:
            match = _PRODUCT.search(stream.read(_HEAD).replace(b"\0", b""))
    except OSError:
        return ""  # the reader says why
    return match[1].decode("ascii").lower() if match else ""
