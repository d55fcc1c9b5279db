"""TwinCAT 3: the project files that say which sources belong to a program.

A solution (.sln) names TwinCAT projects (.tsproj, .tspproj). These name PLC projects (.plcproj), directly or in an
independent project file (.xti in the folder _Config/PLC). A PLC project names its sources.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterator
from dataclasses import dataclass
from html import unescape
from itertools import accumulate
from pathlib import Path, PureWindowsPath

from plctool.compiler.base.source import Finding, Piece, Source
from plctool.compiler.formats.xml_tree import XmlError, read_xml
from plctool.errors import UsageError, listed

PLC_PROJECT = ".plcproj"
_TWINCAT_PROJECTS = (".tsproj", ".tspproj")
CONTAINERS = frozenset((".sln", ".xti", *_TWINCAT_PROJECTS))
"""Suffixes, in lower case, of files that name PLC projects."""

_INDEPENDENT = ("_Config", "PLC")  # the folder of the .xti files, beside the .tsproj
_PLC_PROJECT = re.compile(r"PrjFilePath=\"([^\"]+\.plcproj)\"", re.IGNORECASE)
_INDEPENDENT_FILE = re.compile(r"<Project\b[^>]*?\sFile=\"([^\"]+\.xti)\"", re.IGNORECASE)
_OF_SOLUTION = re.compile(
    r"^\s*Project\([^)\n]*\)\s*=\s*\"[^\"\n]*\"\s*,\s*\"([^\"\n]+\.(?:tsp?proj|plcproj))\"",
    re.IGNORECASE | re.MULTILINE,
)
_SHOWN = 180  # characters of names in one message
_ESCAPE = re.compile(r"%([0-9A-Fa-f]{2})")


@dataclass(frozen=True)
class Member:
    """A file that a PLC project names in `line`. `path` is None if the file is missing."""

    name: PureWindowsPath
    path: Path | None
    line: int


def members(project: Path, text: str, suffixes: Container[str]) -> list[Member]:
    """Returns the files of a PLC project that have one of the suffixes. Raises UsageError for a file that is not XML.

    Visualisations, text lists and the like are not compiled, so a missing one does not matter."""
    try:
        root = read_xml(text)
    except XmlError as error:
        raise UsageError(f"{project}:{error.at.line}: {error}.", "xml") from None
    found = []
    for item in root.every("Compile"):
        left_out = item.child("ExcludeFromBuild")
        name = PureWindowsPath(_unescaped(item.get("Include")))
        if name.suffix.lower() in suffixes and (left_out is None or left_out.text.lower() != "true"):
            found.append(Member(name, _resolved(project.parent, name), item.at.line))
    return found


def _unescaped(name: str) -> str:
    """Replaces the escapes of MSBuild: %28 is an opening parenthesis."""
    return _ESCAPE.sub(lambda match: chr(int(match[1], 16)), name)


def missing_members(project: Path, text: str, suffixes: Container[str]) -> Source:
    """Returns an empty source with one error, which names all missing files of a PLC project. A unit has the name of
    its file, so these names are known to be absent."""
    missing = [member for member in members(project, text, suffixes) if member.path is None]
    shown = _fitting([str(member.name) for member in missing])
    more = f" and {len(missing) - len(shown)} more" if len(shown) < len(missing) else ""
    belongs = "belongs to the project but is missing" if len(missing) == 1 else "belong to the project but are missing"
    message = f"{', '.join(shown)}{more} {belongs}; restore what is missing, or remove it from the project"
    finding = Finding(missing[0].line, 1, "missing-file", message)
    absent = frozenset(member.name.stem.casefold() for member in missing)
    return Source(str(project), "", original=text, pieces=(Piece(0, 1, 1, False),), findings=(finding,), absent=absent)


def _fitting(names: list[str]) -> list[str]:
    """Returns the first names, as many as one message may have."""
    lengths = accumulate(len(name) + 2 for name in names)
    return [name for name, length in zip(names, lengths, strict=True) if length <= _SHOWN] or names[:1]


def plc_project(container: Path, read: Callable[[Path], str]) -> Path:
    """Returns the PLC project in a solution or TwinCAT project. Raises UsageError unless exactly one exists."""
    missing: list[str] = []
    found = list(dict.fromkeys(_plc_projects(container, read, missing)))
    if len(found) > 1:
        raise UsageError(several_projects(str(container), found), "no-source")
    if found:
        return found[0]
    if missing:
        absent = f"{listed(dict.fromkeys(missing))}, which {'is' if len(set(missing)) == 1 else 'are'} missing"
        raise UsageError(f"{container} names {absent}. Give the PLC project (.plcproj) or its folder.", "no-source")
    raise UsageError(
        f"{container} names no PLC project (.plcproj) of TwinCAT. Give the sources or their folder.", "no-source"
    )


def several_projects(where: str, projects: list[Path]) -> str:
    """Returns the message for more than one PLC project, each of which is a program or a library."""
    names = ", ".join(str(path) for path in projects)
    return f"There are several PLC projects in {where}; give one of them, and those that it uses as libraries: {names}."


def _plc_projects(file: Path, read: Callable[[Path], str], missing: list[str]) -> Iterator[Path]:
    """Yields the PLC projects that a file names; adds the names of missing files to `missing`."""
    suffix = file.suffix.lower()
    if suffix == PLC_PROJECT:
        yield file
        return
    text = read(file)
    home = file.parent
    if suffix == ".sln":
        named = [(home, name) for name in _OF_SOLUTION.findall(text)]
    else:
        named = [(home, name) for name in _PLC_PROJECT.findall(text)]
    if suffix in _TWINCAT_PROJECTS:
        independent = home.joinpath(*_INDEPENDENT)
        named += [(independent, name) for name in _INDEPENDENT_FILE.findall(text)]
    for folder, name in named:
        path = _resolved(folder, PureWindowsPath(unescape(name)))
        if path is None:
            missing.append(unescape(name))
        else:
            yield from _plc_projects(path, read, missing)


def _resolved(folder: Path, name: PureWindowsPath) -> Path | None:
    """Returns the file of a path of Windows, where upper and lower case are the same; None if it is missing."""
    at = folder
    for part in name.parts:
        if part in (".", ".."):
            at = at / part
            continue
        exact = at / part
        if exact.exists():
            at = exact
            continue
        same = [p for p in at.iterdir() if p.name.casefold() == part.casefold()] if at.is_dir() else []
        if not same:
            return None
        at = same[0]
    return at
