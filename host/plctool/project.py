"""Where the project file is: `plc.toml` says what belongs to a program (compiler/sources/project.py reads it).

Commands that are given no sources look for it in the current folder and those above it, but do not use the file of
another user (docs/security.md).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from plctool.errors import UsageError

PROJECT_FILE = "plc.toml"
LIBRARY_FILE = "library.toml"
IMAGE_SUFFIX, SYMBOL_SUFFIX = ".cdl", ".sym"  # the symbols of an image are beside it
DEFAULT_IMAGE = f"app{IMAGE_SUFFIX}"


def find_project(folder: Path | None = None) -> Path | None:
    """The project file of a folder (of the current one by default): in it, or in the nearest one above that has one, up
    to the user's home or the end of the file system. Raises UsageError if the file belongs to another user, who could
    decide otherwise what the commands of this user write and which controller they change."""
    start = (folder or Path()).resolve()
    found = next((f for each in _up_from(start) if (f := each / PROJECT_FILE).is_file()), None)
    if found is None:
        return None
    named = _from_here(found)
    if owner := next((owner for path in (found, found.parent) if (owner := _stranger(path))), ""):
        raise UsageError(
            f"{named} belongs to {owner}, so it is not used unless it is named: write for example "
            f"'plctool build {named.parent}', and name the controller with an option such as --port, or in PLC_LINK.",
            "other-owner",
        )
    return named


def _up_from(folder: Path) -> Iterator[Path]:
    """A folder and those above it, to where the search for a project ends."""
    home = Path(os.path.realpath(os.path.expanduser("~")))
    device = folder.stat().st_dev
    for each in (folder, *folder.parents):
        if each.stat().st_dev != device:
            return
        yield each
        if each == home:
            return


def _stranger(path: Path) -> str:
    """The other user that owns a file or folder, or the link that stands for it; "" if the user or root owns it."""
    if not hasattr(os, "getuid"):
        return ""  # Windows: folders above are those of the administrator or the user
    sudo = os.environ.get("SUDO_UID", "") if os.getuid() == 0 else ""
    trusted = {0, os.getuid(), *([int(sudo)] if sudo.isdecimal() else [])}
    strangers = {path.stat().st_uid, path.lstat().st_uid} - trusted
    return f"another user ({_user_name(strangers.pop())})" if strangers else ""


def _user_name(number: int) -> str:
    import pwd

    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return str(number)


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
