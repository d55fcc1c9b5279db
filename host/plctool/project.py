"""Where the project file is: `plc.toml` says what belongs to a program (compiler/project.py reads it).

Commands that are given no sources look for it in the current folder and those above it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from plctool.errors import UsageError

PROJECT_FILE = "plc.toml"
LIBRARY_FILE = "library.toml"
IMAGE_SUFFIX, SYMBOL_SUFFIX = ".cdl", ".sym"  # the symbols of an image are beside it
DEFAULT_IMAGE = f"app{IMAGE_SUFFIX}"


def find_project(folder: Path | None = None) -> Path | None:
    """The project file of a folder (of the current one by default): in it, or in the nearest one above that has one."""
    start = (folder or Path()).resolve()
    found = next((f for each in (start, *start.parents) if (f := each / PROJECT_FILE).is_file()), None)
    return None if found is None else _from_here(found)


def project_named(paths: Sequence[Path]) -> Path | None:
    """The project file that stands for all of a program: named itself, or by its folder. None: these are sources.
    Raises UsageError if there is something else beside it."""
    for path in paths:
        file = path if path.name == PROJECT_FILE else path / PROJECT_FILE
        if file.is_file():
            if len(paths) > 1:
                raise UsageError(f"{path} is a project; name it alone, it says which sources it has.", "bad-project")
            return file
    return None


def _from_here(path: Path) -> Path:
    """As short as it can be written from the current folder."""
    return Path(os.path.relpath(path))
