"""Finds and reads source files: Structured Text in any usual encoding, and what other systems keep it in.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from pathlib import Path

from plctool.compiler.base.garbage import no_collection
from plctool.compiler.base.source import Finding, Piece, Source
from plctool.compiler.formats import (
    automation_studio,
    beremiz,
    global_lists,
    il_files,
    object_text,
    twincat_projects,
    unreadable,
)
from plctool.errors import UsageError
from plctool.files import MAX_TEXT, check_inside, is_inside, read_regular
from plctool.project import LIBRARY_FILE

_UNIT = re.compile(r"^\s*(?:PROGRAM|FUNCTION|FUNCTION_BLOCK|TYPE|VAR_GLOBAL|INTERFACE)\b", re.IGNORECASE | re.MULTILINE)
"""The beginning of a unit of Structured Text."""

_ENCODINGS = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}

Reader = Callable[[str, str], list[Source]]
"""Makes sources from the path and the text of a file."""


def _structured_text(path: str, text: str) -> list[Source]:
    refused = unreadable.refused_text(text)
    if refused is not None:
        return [Source(path, "", original=text, pieces=(Piece(0, 1, 1, copied=False),), findings=(refused,))]
    lists = il_files.read_lists(path, text)
    return [lists or beremiz.without_blocks_in_c(object_text.read_object(path, text))]


def _export(path: str, text: str) -> list[Source]:
    from plctool.compiler.formats import codesys2  # late, as are the other readers that few programs need

    return [codesys2.read_export(path, text)]


def _twincat(path: str, text: str) -> list[Source]:
    from plctool.compiler.formats import twincat

    return [twincat.read_object(path, text)]


def _xml(path: str, text: str) -> list[Source]:
    from plctool.compiler.formats import plcopen

    return plcopen.read_project(path, text)


def _variables(path: str, text: str) -> list[Source]:
    return [global_lists.read_list(path, text)]


TEXTS = (".st", ".iecst", ".scl", ".fun", ".typ")
"""Suffixes of files that are Structured Text as it is."""

READERS: dict[str, Reader] = {
    **dict.fromkeys(TEXTS, _structured_text),
    ".var": _variables,
    ".exp": _export,
    ".xml": _xml,
    **dict.fromkeys((".tcpou", ".tcgvl", ".tcdut", ".tcio", ".tctto"), _twincat),
}
"""How a file is read, by its suffix in lower case."""

SUFFIXES = frozenset(READERS) - {".xml"}
"""That sources alone have, in lower case. An .xml is taken from a folder when it is a project."""


def load(paths: Iterable[Path], root: Path | None = None) -> list[Source]:
    """The files named, those of projects named, and all sources in folders named. `root`: the folder of the plc.toml
    that names them; None if they are named on the command line, so that each folder or project may use its own files.

    Raises OSError when one cannot be read, UsageError when there is nothing to read or a file is outside `root`.
    """
    files: dict[Path, None] = {}
    for path in paths:
        files.update(dict.fromkeys(_files(path, root)))
    return _read_all(files, _content)


def files_read(paths: Iterable[Path], root: Path | None = None) -> Iterator[Path]:
    """The files that `load` reads, and the projects that name them; the same errors."""
    for path in paths:
        if not path.is_dir():
            yield path
        yield from _files(path, root)


def read_contents(contents: Mapping[Path, bytes]) -> list[Source]:
    """The sources among files that are not on disk, such as those of a .zip."""
    wanted = [path for path, data in contents.items() if _has_sources(path, data)]
    return _read_all(wanted, contents.__getitem__)


def _content(path: Path) -> bytes:
    return read_regular(path, MAX_TEXT)


def _read_all(files: Iterable[Path], content: Callable[[Path], bytes]) -> list[Source]:
    with no_collection():
        return combined({file: read_content(file, content(file)) for file in files})


def combined(read: dict[Path, list[Source]]) -> list[Source]:
    """The sources of files that belong together: members in files of their own go to their unit. Changes `read`."""
    automation_studio.with_bodies(read)
    for owner, members in _members(read).items():
        read[owner] = object_text.with_members(read[owner][0], [read.pop(member)[0] for member in members])
    return [source for sources in read.values() for source in sources]


def _members(read: Mapping[Path, list[Source]]) -> dict[Path, list[Path]]:
    """The files that hold members of the unit in another one, by that."""
    found: dict[Path, list[Path]] = {}
    for file, sources in read.items():
        owner = _owner(file)
        if owner is not None and owner in read and object_text.is_member(sources):
            found.setdefault(owner, []).append(file)
    return found


def _owner(file: Path) -> Path | None:
    """The file of the unit to which a member in a file of its own belongs: `Pump.st` for `Pump.Start.st`, and for
    `Pump/Start.st`."""
    unit, dot, _ = file.stem.rpartition(".")
    if dot:
        return file.with_name(unit + file.suffix) if unit else None
    return file.parent.with_suffix(file.suffix) if file.parent.name else None


def read_content(path: Path, data: bytes) -> list[Source]:
    """What a file with these bytes contains."""
    refused = unreadable.refusal(path, data)
    if refused:
        return [Source(str(path), "", findings=(Finding(1, 1, "file", refused),))]
    if path.suffix.lower() == twincat_projects.PLC_PROJECT:
        return [twincat_projects.missing_members(path, decode(data), SUFFIXES)]
    return READERS.get(path.suffix.lower(), _structured_text)(str(path), decode(data))


def _files(path: Path, root: Path | None) -> list[Path]:
    if path.is_dir():
        return find_sources(path, root)
    if root is not None:
        check_inside(path, root)
    suffix, root = path.suffix.lower(), root or _folder_of_project(path)
    if suffix == twincat_projects.PLC_PROJECT:
        return _files_of_project(path, root)
    if suffix in twincat_projects.CONTAINERS:
        return _files_of_project(twincat_projects.plc_project(path, lambda file: _text_inside(file, root)), root)
    return [path]


def _folder_of_project(file: Path) -> Path:
    """Returns the folder of the project that a file named by the user is of. TwinCAT keeps independent project files
    two folders below it, in _Config/PLC."""
    folder = file.parent
    return folder.parent.parent if folder.parts[-2:] == ("_Config", "PLC") else folder


def _files_of_project(project: Path, root: Path) -> list[Path]:
    """The sources of a PLC project; if some are missing, also the project itself, for the error about them."""
    members = twincat_projects.members(project, _text_inside(project, root), SUFFIXES)
    found = _inside(root, (member.path for member in members if member.path is not None))
    return found if len(found) == len(members) else [project, *found]


def _text_inside(file: Path, root: Path) -> str:
    """Returns the text of a project file, which is not outside `root`."""
    check_inside(file, root)
    return decode(_content(file))


def _inside(root: Path, files: Iterable[Path]) -> list[Path]:
    """The files, of which none is outside `root`."""
    found = list(files)
    for file in found:
        check_inside(file, root)
    return found


def find_sources(folder: Path, root: Path | None = None) -> list[Path]:
    """The source files in a folder and those below it; of a TwinCAT project, those that belong to it. Libraries below
    it are not part of it. `root`: as in `load`.

    Raises UsageError when there are none, or several projects, or one is outside `root`.
    """
    root = root or folder
    projects = sorted(path for path in folder.rglob("*") if _is_plc_project(path))
    if len(projects) > 1:
        raise UsageError(twincat_projects.several_projects(str(folder), projects), "no-source")
    libraries = {file.parent for file in folder.rglob(LIBRARY_FILE)} - {folder}
    found = sorted(path for path in folder.rglob("*") if _is_source(path, root) and libraries.isdisjoint(path.parents))
    found = [path for path in found if not _is_generated(path, found)]
    if projects:
        home = projects[0].parent
        others = (path for path in found if home not in path.parents or not path.suffix.lower().startswith(".tc"))
        found = sorted({*_files(projects[0], root), *others})
    if not found:
        raise UsageError(
            f"{_named(folder)} has no source file (.st, .exp, .TcPOU ...){_other_files(folder, root)}.", "no-source"
        )
    return found


def _is_plc_project(path: Path) -> bool:
    return path.suffix.lower() == twincat_projects.PLC_PROJECT and path.is_file()


def _named(folder: Path) -> str:
    return "The current folder" if folder == Path() else f"The folder {folder}"


def _other_files(folder: Path, root: Path) -> str:
    """What to do with the files that hold programs but no text, or have the name of another text."""
    files = sorted(folder.rglob("*"))
    for path in files:
        if advice := unreadable.WHAT_TO_DO.get(path.suffix.lower()):
            return f"; {path.name} is not text: {advice}"
    for path in files:
        if path.suffix.lower() == ".txt" and _is_text(path, root) and _UNIT.search(decode(_content(path))):
            return f"; {path.name} seems to be one: rename it to {path.stem.removesuffix('.st')}.st"
    return ""


def _is_source(path: Path, root: Path) -> bool:
    suffix = path.suffix.lower()
    if suffix not in READERS or not path.is_file():
        return False
    check_inside(path, root)
    if suffix != ".xml":
        return True
    from plctool.compiler.formats import plcopen

    with path.open("rb") as file:
        return _has_sources(path, file.read(plcopen.HEAD))


def _has_sources(path: Path, data: bytes) -> bool:
    """Whether a file, of which this is at least the beginning, is one."""
    suffix = path.suffix.lower()
    if suffix != ".xml":
        return suffix in SUFFIXES
    from plctool.compiler.formats import plcopen

    return plcopen.is_project(decode(data[: plcopen.HEAD]))


def _is_text(path: Path, root: Path) -> bool:
    return path.is_file() and is_inside(path, root) and path.stat().st_size <= MAX_TEXT


def _is_generated(path: Path, found: Container[Path]) -> bool:
    """Whether OpenPLC Editor or Beremiz made a file from the plc.xml beside its folder."""
    return path.parent.name == "build" and path.parent.with_name("plc.xml") in found


def decode(data: bytes) -> str:
    """The text of a file."""
    mark, encoding = encoding_of(data)
    return data[len(mark) :].decode(encoding, "replace")


def encoding_of(data: bytes) -> tuple[bytes, str]:
    """The byte order mark of a file and its encoding: UTF-16 with its mark, UTF-8, or else one byte per character, as
    older systems write it."""
    for mark, encoding in _ENCODINGS.items():
        if data.startswith(mark):
            return mark, encoding
    try:
        data.removeprefix(codecs.BOM_UTF8).decode("utf-8")
    except UnicodeDecodeError:
        return b"", "latin-1"
    return codecs.BOM_UTF8 if data.startswith(codecs.BOM_UTF8) else b"", "utf-8"
