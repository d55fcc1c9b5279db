"""What `plctool new` makes: a folder here for each kind of project, with @NAME@ where its name belongs."""

from __future__ import annotations

import re
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
    """Makes a project in a folder that does not exist yet, or is empty; its files. Raises UsageError if it cannot."""
    name = folder.resolve().name
    if not _NAME.fullmatch(name):
        raise UsageError(
            f"'{name}' cannot be the name of a project; it has letters, digits and _, and begins with a letter.",
            "bad-name",
        )
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} exists already; choose another name, or an empty folder.", "exists")
    source = _FOLDER / template
    made = []
    for file in sorted(path for path in source.rglob("*") if path.is_file()):
        target = folder / file.relative_to(source)
        make_folder(target.parent)
        write_atomically(target, file.read_text("utf-8").replace("@NAME@", name).encode())
        made.append(target)
    return made
