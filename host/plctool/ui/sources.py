"""Lines of the sources of a program, for the exception that stopped it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import plctool
from plctool.files import is_inside, read_regular

AROUND = 4  # lines before and after
_LARGEST = 1 << 20  # bytes of a source that is shown


def lines_around(name: str | None, line: int | None, folders: Sequence[Path]) -> list[dict[str, Any]]:
    """Returns the lines around one, [] if the file is not found. The name comes from the symbols, which a controller
    may keep for others: only sources within `folders`, and those of the standard library, are read."""
    if not name or not line:
        return []
    for folder in (*folders, Path(plctool.__file__).parent):
        if (text := _source(folder, name)) is not None:
            lines = text.splitlines()[max(0, line - 1 - AROUND) : line + AROUND]
            return [{"line": max(1, line - AROUND) + i, "text": one} for i, one in enumerate(lines)]
    return []


def _source(folder: Path, name: str) -> str | None:
    from plctool.compiler.sources.source_files import SUFFIXES  # the first exception needs it, no start

    path = folder / name
    try:
        if path.suffix.lower() not in SUFFIXES or not is_inside(path, folder):
            return None
        return read_regular(path, _LARGEST).decode("utf-8", "replace")
    except (OSError, ValueError):
        return None
