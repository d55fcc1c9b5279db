"""What `plctool new` makes: a folder here for each kind of project, with @NAME@ where its name belongs."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from plctool.errors import UsageError
from plctool.files import make_folder, write_atomically

TEMPLATES = {
    "minimal": "a program and its test",
    "io": "a program with inputs and outputs, in memory until there is hardware",
    "library": "a library with a program that uses it",
}
"""By name, what a project begins with."""

DEFAULT_TEMPLATE = "minimal"
_FOLDER = Path(__file__).parent
_NAME = re.compile(r"[A-Za-z]\w{0,62}", re.ASCII)


def new_project(folder: Path, template: str) -> list[Path]:
    """Makes a project in a folder that does not exist yet, or is empty; its files. Raises UsageError if it cannot,
    and leaves nothing then."""
    name = folder.resolve().name
    _check_name(name, template)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} exists already; choose another name, or an empty folder.", "exists")
    source = _FOLDER / template
    files = {
        folder / file.relative_to(source): file.read_text("utf-8").replace("@NAME@", name).encode()
        for file in sorted(path for path in source.rglob("*") if path.is_file())
    }
    _write_all(files)
    return list(files)


def _check_name(name: str, template: str) -> None:
    """Whether what is made with this name compiles: that of a library stands in front of others."""
    if not _NAME.fullmatch(name):
        raise UsageError(
            f"'{name}' cannot be the name of a project; it has letters, digits and _, and begins with a letter.",
            "bad-name",
        )
    if template == "library":
        from plctool.compiler.sources.library_files import wrong_with_name

        if wrong := wrong_with_name(name):
            raise UsageError(f"'{name}' cannot be the name of a library: {wrong}.", "bad-name")


def _write_all(files: Mapping[Path, bytes]) -> None:
    """Writes files that do not exist yet, with the folders they need: all of them, or none."""
    made: list[Path] = []
    try:
        for file, content in files.items():
            for folder in reversed(file.parents):
                if not os.path.lexists(folder):
                    made.append(folder)
                    make_folder(folder)
            made.append(file)
            write_atomically(file, content)
    except BaseException:
        for path in reversed(made):
            with suppress(OSError):
                path.rmdir() if path.is_dir() else path.unlink()
        raise
