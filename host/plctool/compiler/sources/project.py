"""The project file: what belongs to a program, what it is built for and with which options.

What it says holds where the command line says nothing else. Its paths begin at its own folder.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path, PurePath

from plctool.compiler.base.information import NO_INFORMATION, Information, Property, PropertyKind
from plctool.compiler.base.level import Level
from plctool.compiler.codegen.lower_unit import parse_checks
from plctool.compiler.sources.library_files import is_stand_in, libraries_at, no_library
from plctool.compiler.sources.source_files import READERS
from plctool.compiler.sources.toml_files import read_checked
from plctool.compiler.syntax.guidelines import NAME_KINDS, PROPOSED, STYLES, Guidelines, read_form
from plctool.compiler.syntax.warnings import GROUPS, MEANINGS, WARNINGS, meant_by
from plctool.errors import UsageError, did_you_mean, listed
from plctool.files import is_inside, read_utf8
from plctool.iec.dialect import DIALECTS
from plctool.image.board import known_boards
from plctool.image.file import ApplicationInfo
from plctool.image.targets import TARGETS
from plctool.io.mistakes import Mistakes
from plctool.io.tables import Entry, Table
from plctool.project import DEFAULT_IMAGE, IMAGE_SUFFIX, PROJECT_FILE

_LEVELS: dict[object, Level] = {0: 0, 1: 1, 2: 2, 3: 3, "s": "s"}
_INFORMATION = ("name", "title", "version", "author", "company", "description", "profile")
_OPTIONS = ("optimisation", "checks", "debug", "dialect", "no-warn", "werror")
LINE_LENGTHS = (60, 400)  # the least and the most that the formatter takes
_MAX_TEXT = 255  # characters of what the image says about the project
_VERSION = re.compile(r"\d{1,5}(\.\d{1,5}){0,3}", re.ASCII)
_MAX_VERSION_PART = 0xFFFF
_PATTERN = re.compile(r"[*?\[]")
_OPTION_OF = {"libraries": "--library", "io": "--io", "device": "--device", "output": "-o"}
"""What names a path on the command line, by its key; sources stand there without an option."""


@dataclass(frozen=True)
class Project:
    """What a project file says, with paths as seen from the current folder. None and empty: it says nothing."""

    file: Path
    sources: list[Path]
    libraries: list[Path]
    output: Path
    target: str | None = None
    board: str | None = None
    device: Path | None = None
    io: Path | None = None
    level: Level | None = None
    checks: str | None = None
    debug: bool = False
    no_warn: list[str] = field(default_factory=list)
    werror: bool = False
    info: ApplicationInfo = field(default_factory=ApplicationInfo)
    information: Information = NO_INFORMATION
    dialect: str | None = None
    link: str | None = None  # cli/links.py checks what it says
    link_line: int = 0
    line_length: int | None = None  # of formatted sources
    guidelines: Guidelines = PROPOSED  # which hold when they are asked for


def read_project(file: Path) -> Project:
    """Reads a project file. Raises CompileError for mistakes in it, UsageError if it cannot be read."""
    return project_in(file, read_utf8(file, "bad-project"))


def project_in(file: Path, text: str) -> Project:
    """The same for a text. Raises CompileError."""
    return read_checked(str(file), text, PROJECT_FILE, lambda table: _project(file, table))


def _project(file: Path, table: Table) -> Project:
    folder = file.parent
    options = table.table("options") or table.empty("options")
    information = table.table("information") or table.empty("information")
    texts = {key: _shown(information, key) for key in _INFORMATION}
    formatter = table.table("format") or table.empty("format")
    table.belongs("it goes into [information]", *_INFORMATION)
    table.belongs("it goes into [format]", "line-length")
    table.belongs(f"{listed(_INFORMATION, 'and')} go into [information]", "project")
    table.belongs("it goes into [options]", *_OPTIONS)
    project = Project(
        file,
        _sources(folder, table),
        _libraries(folder, table),
        _output(folder, table),
        table.choice("target", {name: name for name in TARGETS}),
        _board(table),
        _file(folder, table, "device"),
        _file(folder, table, "io"),
        _level(options),
        _checks(options),
        options.flag("debug"),
        _warnings(options),
        options.flag("werror"),
        _application_info(folder, texts),
        Information({key: text for key, text in texts.items() if text}, _properties(information), PROJECT_FILE),
        options.choice("dialect", {name: name for name in DIALECTS}),
        table.text("link"),
        table.value_pos("link").line,
        formatter.number("line-length", *LINE_LENGTHS, unit="characters"),
        _guidelines(table),
    )
    formatter.close()
    options.close()
    information.close()
    return project


def _board(table: Table) -> str | None:
    """A board that plctool knows, with its configuration."""
    if "board" not in table:
        table.text("board")  # so that it is among the keys that messages name
        return None
    return table.choice("board", {board.slug: board.slug for board in known_boards()})


def _path(folder: Path, entry: Entry, table: Table) -> Path | None:
    """The path that a text names; None after a mistake. Whether it exists may be asked of it."""
    if not entry.value or not entry.value.isprintable():
        table.mistakes.error(entry.pos, "a path is not empty, and has no control characters")
        return None
    path = folder / str(entry.value)
    try:
        path.exists()
    except OSError as error:
        table.mistakes.error(entry.pos, f"{path} cannot be used: {error.strerror}")
        return None
    return path if _belongs(folder, path, entry, table) else None


def _belongs(folder: Path, path: Path, entry: Entry, table: Table) -> bool:
    """True if a path lies in the folder of the project, links followed; reports it if not."""
    if is_inside(path, folder):
        return True
    option = _OPTION_OF.get(entry.key)
    named = "name the sources" if option is None else f"give it with {option}"
    table.mistakes.error(
        entry.pos,
        f"{path} is outside the folder of {PROJECT_FILE}; take it out of here, and {named} on the command line",
    )
    return False


def _path_of(folder: Path, table: Table, key: str) -> Path | None:
    name = table.text(key)
    pos = table.value_pos(key)
    return None if name is None else _path(folder, Entry(key, pos, name, pos), table)


def _output(folder: Path, table: Table) -> Path:
    path = _path_of(folder, table, "output") or folder / DEFAULT_IMAGE
    if os.path.isdir(path):  # False as well for a name that no file can have, as below
        table.error(f'{path} is a folder; write for example output = "{DEFAULT_IMAGE}"', "output")
    elif path.suffix.lower() != IMAGE_SUFFIX:
        example = f'output = "{path.stem or "app"}{IMAGE_SUFFIX}"'
        table.error(f"the name of the image ends in {IMAGE_SUFFIX}, not as {path.name} does; write {example}", "output")
    return path


def _file(folder: Path, table: Table, key: str) -> Path | None:
    """A file that has to be there."""
    path = _path_of(folder, table, key)
    if path is None:
        return None
    if not os.path.isfile(path):
        table.error(f"there is no file {path}", key)
        return None
    return path


def _sources(folder: Path, table: Table) -> list[Path]:
    """Files, folders and patterns; without any the whole folder."""
    if "sources" not in table:
        table.strings("sources")
        return [folder]
    found: dict[Path, None] = {}
    for entry in table.strings("sources"):
        found.update(dict.fromkeys(_matching(folder, entry, table)))
    if not found and not table.mistakes.found:
        table.error('there are no sources here; write for example sources = ["src"]', "sources")
    return list(found)


def _matching(folder: Path, entry: Entry, table: Table) -> list[Path]:
    """The sources that an entry of the list names."""
    text = entry.value
    path = _path(folder, entry, table)
    if path is None:
        return []
    if path.exists():
        return [path]
    if not _PATTERN.search(text):
        table.mistakes.error(entry.pos, f"there is no file or folder {path}")
        return []
    if wrong := _wrong_with_pattern(text):
        table.mistakes.error(entry.pos, f'{wrong}; write for example "src/**/*.st"')
        return []
    files = sorted(p for p in folder.glob(text) if p.is_file() and p.suffix.lower() in READERS)
    if not all(_belongs(folder, file, entry, table) for file in files):
        return []
    if not files:
        table.mistakes.error(entry.pos, f"no source fits {path}")
    return files


def _wrong_with_pattern(text: str) -> str:
    """Why `Path.glob` does not take a pattern; "" if it does."""
    pattern = PurePath(text)
    if pattern.anchor:
        return f"'{text}' is absolute; a pattern begins at the folder of {PROJECT_FILE}"
    if any("**" in part and part != "**" for part in pattern.parts):
        return "** is for folders, and stands alone between two /"
    return ""


def _libraries(folder: Path, table: Table) -> list[Path]:
    """Libraries, and folders of them. Names that need no files are left out."""
    found: list[Path] = []
    for entry in table.strings("libraries"):
        path = _path(folder, entry, table)
        if path is None:
            continue
        if libraries := libraries_at(path):
            if all(_belongs(folder, library, entry, table) for library in libraries):
                found.append(path)
        elif not is_stand_in(entry.value.partition(",")[0].strip()):
            message = no_library(path).rstrip(".")
            table.mistakes.error(entry.pos, f"{message[:1].lower()}{message[1:]}")
    return found


def _level(options: Table) -> Level | None:
    value = options.raw("optimisation")
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | str) or value not in _LEVELS:
        options.error('optimisation can be 0, 1, 2 or 3, or "s" for small code', "optimisation")
        return None
    return _LEVELS[value]


def _checks(options: Table) -> str | None:
    value = options.raw("checks")
    if value is None:
        return None
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        options.error('checks can be "all", "none" or a list such as ["div", "bounds"]', "checks")
        return None
    text = ",".join(names) or "none"
    try:
        parse_checks(text)
    except UsageError as error:
        options.error(error.message.rstrip("."), "checks")
        return None
    return text


def _warnings(options: Table) -> list[str]:
    names = []
    for entry in options.strings("no-warn"):
        if meant_by(str(entry.value)):
            names.append(entry.value)
        else:
            hint = (
                did_you_mean(entry.value, (*MEANINGS, *GROUPS)) or f"; the names are {', '.join((*GROUPS, *WARNINGS))}"
            )
            options.mistakes.error(entry.pos, f"there is no warning '{entry.value}'{hint}")
    return names


def _guidelines(table: Table) -> Guidelines:
    """What [guidelines] sets; the rest as it is proposed."""
    asked = table.table("guidelines") or table.empty("guidelines")
    limits = {
        "shortest_name": asked.number("shortest-name", 1, 1000, unit="characters"),
        "longest_name": asked.number("longest-name", 1, 1000, unit="characters"),
        "branches": asked.number("branches", 1, 10_000),
        "globals": asked.number("globals", 0, 10_000),
        "parameters": asked.number("parameters", 0, 10_000),
    }
    given = {name: value for name, value in limits.items() if value is not None}
    avoided = frozenset(str(entry.value).casefold() for entry in asked.strings("avoid"))
    guidelines = replace(PROPOSED, forms=_forms(asked), avoided=avoided, **given)
    asked.close()
    return guidelines


def _forms(guidelines: Table) -> dict[str, str]:
    """The forms of [guidelines.names] by kind."""
    names = guidelines.table("names") or guidelines.empty("names")
    found = {kind: form for kind in NAME_KINDS if (form := names.text(kind)) is not None}
    for kind, form in found.items():
        if read_form(form) is None:
            styles = listed(list(STYLES), "or")
            names.error(f"'{form}' is no form of a name; it has {styles} in it once, as FB_CamelCase", kind)
    names.close()
    return found


def _application_info(folder: Path, texts: dict[str, str]) -> ApplicationInfo:
    """What the image says; title and company are for the program alone."""
    name = texts["name"] or folder.resolve().name
    return ApplicationInfo(name, texts["author"], texts["version"], texts["description"], texts["profile"])


def _properties(information: Table) -> dict[str, Property]:
    """The properties of [information.properties], by their keys."""
    table = information.table("properties")
    found: dict[str, Property] = {}
    for entry in table.items() if table is not None else ():
        value = _property(entry, information.mistakes)
        if value is not None:
            found[entry.key] = value
    return found


def _property(entry: Entry, mistakes: Mistakes) -> Property | None:
    """One property; None after a mistake."""
    key, value = entry.key, entry.value
    if not key or not key.isascii() or not key.isprintable():
        mistakes.error(entry.key_pos, "the key of a property has ASCII characters that can be seen, and is not empty")
        return None
    match value:
        case bool():
            return Property(PropertyKind.BOOL, value)
        case int():
            return Property(PropertyKind.NUMBER, value)
        case float() if isfinite(value):
            return Property(PropertyKind.NUMBER, value)
        case str():
            wrong = _wrong_with_text(key, value)
            if not wrong:
                return Property(PropertyKind.TEXT, value)
            mistakes.error(entry.pos, wrong)
        case Table():
            return _version(key, value)
        case _:
            mistakes.error(entry.pos, f'{key} can be a text, a number, true or false, or {{ version = "1.2.0.0" }}')
    return None


def _version(key: str, table: Table) -> Property | None:
    """`{ version = "1.2.0.4" }`: one to four numbers, which become four."""
    text = table.text("version", required="1.2.0.0")
    table.close()
    if text is None:
        return None
    if not _VERSION.fullmatch(text) or any(int(part) > _MAX_VERSION_PART for part in text.split(".")):
        hint = f"one to four numbers up to {_MAX_VERSION_PART}, such as 1.2.0.4"
        table.error(f"{key} has the version '{text}'; a version is {hint}", "version")
        return None
    numbers = [str(int(part)) for part in text.split(".")]
    return Property(PropertyKind.VERSION, ".".join([*numbers, "0", "0", "0"][:4]))


def _shown(table: Table, key: str) -> str:
    """A text that the image carries, or that a program gets."""
    text = table.text(key) or ""
    if wrong := _wrong_with_text(key, text):
        table.error(wrong, key)
    return text


def _wrong_with_text(key: str, text: str) -> str:
    """Why a text cannot be in an image; "" if it can."""
    if text.isascii() and not text.isprintable():
        return f"{key} has a line break or another character that cannot be seen; write it in one line"
    if not text.isascii():
        return f"{key} goes into the image, which takes ASCII only; write other letters with those"
    return f"{key} has {len(text)} characters; it can have {_MAX_TEXT}" if len(text) > _MAX_TEXT else ""
