"""Libraries that are given as sources: a folder, or a .zip, with a `library.toml` that says what it is.

Its `namespace` is in front of its names. It may need others, which are looked for among those that are given and in
the folder that it lies in itself. Names of libraries that other systems have, and for which the standard library
stands in here, need no files.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from pathlib import Path

from plctool.compiler.base.source import Source
from plctool.compiler.sources.library_zip import is_zip, read_zip
from plctool.compiler.sources.source_files import files_read, load, read_contents
from plctool.compiler.sources.toml_files import error_at, read_checked
from plctool.compiler.syntax.lexer import KEYWORDS
from plctool.compiler.syntax.library import STAND_INS
from plctool.errors import UsageError, did_you_mean
from plctool.files import Pos, check_inside, decode_utf8, is_inside, read_utf8
from plctool.iec.types import ELEMENTARY
from plctool.io.tables import Table
from plctool.project import LIBRARY_FILE
from plctool.records import dataclass

_STAND_INS = {name.casefold() for name in STAND_INS}
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_VERSION = re.compile(r"\d{1,9}(?:\.\d{1,9}){0,3}")
_ANY = "*"


def is_stand_in(name: str) -> bool:
    """Whether the standard library stands in for a library of that name."""
    return name.casefold() in _STAND_INS


# ---- one library ----


@dataclass(frozen=True)
class Dependency:
    """A library that another one needs, in `version` or a later one with the same first number; * is any."""

    name: str
    version: str
    pos: Pos

    def fits(self, version: str) -> bool:
        """Whether a version is good enough."""
        if self.version == _ANY:
            return True
        wanted, found = _numbers(self.version), _numbers(version)
        return found[0] == wanted[0] and found >= wanted


@dataclass(frozen=True)
class LibraryFiles:
    """A library that was found; `path` is its folder or .zip, `manifest` the text of its library.toml."""

    path: Path
    manifest: str
    name: str
    namespace: str
    version: str
    dependencies: tuple[Dependency, ...]

    @cached_property
    def sources(self) -> list[Source]:
        """All of it, read when it is first needed. Raises UsageError when a file cannot be read."""
        if is_zip(self.path):
            sources = read_contents(read_zip(self.path))
        else:
            try:
                sources = load([self.path])
            except OSError as error:
                raise UsageError(f"{error.filename} cannot be read: {error.strerror}.", "bad-library") from None
        if not sources:
            raise UsageError(f"The library {self.path} has no source file (.st, .exp, .TcPOU ...).", "bad-library")
        return sources

    @property
    def files(self) -> list[Path]:
        """What is read of it."""
        return [self.path] if is_zip(self.path) else [self.path / LIBRARY_FILE, *files_read([self.path])]

    def error(self, pos: Pos, message: str) -> UsageError:
        """A mistake in its library.toml."""
        return error_at(pos, message, self.manifest)


def _numbers(version: str) -> tuple[int, ...]:
    """For a comparison: 1.2 is 1.2.0.0."""
    numbers = [int(part) for part in version.split(".")]
    return tuple(numbers + [0] * (4 - len(numbers)))


def read_library(path: Path) -> LibraryFiles:
    """What a folder or .zip says about itself. Raises CompileError for mistakes, UsageError if it is no library."""
    if is_zip(path):
        contents = read_zip(path)
        data = contents.get(path / LIBRARY_FILE)
        if data is None:
            raise UsageError(f"{path} has no {LIBRARY_FILE}, neither at its top nor in its only folder.", "bad-library")
        text = decode_utf8(data, path / LIBRARY_FILE, "bad-library")
    else:
        check_inside(path / LIBRARY_FILE, path)
        text = read_utf8(path / LIBRARY_FILE, "bad-library")
    return library_in(path, text)


def library_in(path: Path, text: str) -> LibraryFiles:
    """The same for the text of its library.toml. Raises CompileError."""
    return read_checked(str(path / LIBRARY_FILE), text, LIBRARY_FILE, lambda table: _read(path, text, table))


def _read(path: Path, text: str, table: Table) -> LibraryFiles:
    name = table.text("name", required="Util") or ""
    namespace = table.text("namespace", name) or ""
    version = table.text("version", required="1.0.0") or ""
    if name and (wrong := wrong_with_name(name)):
        table.error(f"'{name}' cannot be the name of a library: {wrong}", "name")
    if namespace != name and (wrong := wrong_with_name(namespace)):
        table.error(f"'{namespace}' cannot be a namespace: {wrong}", "namespace")
    if version and not _VERSION.fullmatch(version):
        table.error(f"'{version}' is not a version; write numbers: \"1.2.0\"", "version")
    for key in ("author", "description"):
        table.text(key)
    needed = table.table("dependencies")
    return LibraryFiles(
        path, text, name, namespace, version, tuple(_dependencies(needed)) if needed is not None else ()
    )


def wrong_with_name(name: str) -> str:
    """Why a name cannot stand in front of others; "" if it can."""
    if not _NAME.fullmatch(name):
        return "it has letters, digits and _, and does not begin with a digit"
    if name.upper() in KEYWORDS or name.upper() in ELEMENTARY:
        return "it is a word of the language; choose another"
    return ""


def _dependencies(table: Table) -> Iterator[Dependency]:
    for entry in table.items():
        version = entry.value
        if not isinstance(version, str) or (version != _ANY and not _VERSION.fullmatch(version)):
            message = f'the version of {entry.key} is a text such as "1.2", which 1.3 fits as well, or "*" for any'
            table.mistakes.error(entry.pos, message)
            continue
        yield Dependency(entry.key.partition(",")[0].strip(), version, entry.key_pos)


# ---- finding them ----


def is_library(path: Path) -> bool:
    """Whether a path is that of a library, as far as can be seen from outside."""
    return os.path.isfile(path / LIBRARY_FILE) or (is_zip(path) and os.path.isfile(path))


def libraries_at(path: Path) -> list[Path]:
    """The library of that path, or those in this folder; none if it is neither."""
    return [path] if is_library(path) else _libraries_in(path)


def _libraries_in(folder: Path) -> list[Path]:
    try:
        return sorted(filter(is_library, folder.iterdir()))
    except OSError:
        return []


def find_libraries(path: Path) -> list[Path]:
    """The same, for a path or a name that a user gave. Nothing for a name that needs no files. Raises UsageError if
    there is no library."""
    found = libraries_at(path)
    if found or is_stand_in(str(path)):
        return found
    raise UsageError(no_library(path), "no-library")


def no_library(path: Path) -> str:
    """What to say about a path that is not one of a library."""
    exists = os.path.exists(path)
    what = f"{path} is not a library: it has no {LIBRARY_FILE}" if exists else f"There is no library {path}"
    hint = did_you_mean(path.name, STAND_INS)
    return f"{what}; a library is a folder or .zip with a {LIBRARY_FILE}{hint}."


# ---- all that a program needs ----


class _Resolution:
    """The libraries that are given and those that they need, each once."""

    def __init__(self, root: Path | None) -> None:
        self._root = root
        self.found: dict[str, LibraryFiles] = {}
        self._needed_by: dict[str, str] = {}
        self._nearby: dict[Path, list[LibraryFiles]] = {}

    def add(self, library: LibraryFiles) -> None:
        other = self.found.setdefault(library.name.casefold(), library)
        if other.path.resolve() != library.path.resolve():
            raise UsageError(
                f"There are two libraries {library.name}: {other.path} (version {other.version}) and {library.path} "
                f"(version {library.version}); give one of them.",
                "library-conflict",
            )

    def complete(self, library: LibraryFiles, path: tuple[str, ...] = ()) -> None:
        """Finds what a library needs; `path`: the libraries that need it."""
        path = (*path, library.name)
        names = [name.casefold() for name in path]
        for needed in library.dependencies:
            found = self._find(library, needed)
            if found is None:
                continue
            if found.name.casefold() in names:
                circle = " needs ".join([*path[names.index(found.name.casefold()) :], found.name])
                raise library.error(needed.pos, f"the libraries need each other: {circle}; take one of these away")
            self.complete(found, path)

    def _find(self, library: LibraryFiles, needed: Dependency) -> LibraryFiles | None:
        """What is needed; None for what needs no files."""
        key = needed.name.casefold()
        found = self.found.get(key)
        if found is None:
            near = [other for other in self._near(library) if other.name.casefold() == key]
            near.sort(key=lambda other: (needed.fits(other.version), _numbers(other.version)))
            if not near and is_stand_in(key):
                return None
            if not near:
                raise library.error(needed.pos, self._missing(library, needed))
            found = near[-1]
        if not needed.fits(found.version):
            by = self._needed_by.get(key)
            also = f", which {by} needs" if by is not None else ""
            raise library.error(
                needed.pos,
                f"{library.name} needs {needed.name} {needed.version}, but {found.path} is version "
                f"{found.version}{also}; give one version that fits all",
            )
        self.found[key] = found
        self._needed_by.setdefault(key, f"{library.name} {library.version}")
        return found

    def _missing(self, library: LibraryFiles, needed: Dependency) -> str:
        names = [*(other.name for other in (*self.found.values(), *self._near(library))), *STAND_INS]
        hint = did_you_mean(needed.name, names) or f"; give it with --library, or put it into {_folder_of(library)}"
        return f"{library.name} needs the library {needed.name}, which is not here{hint}"

    def _near(self, library: LibraryFiles) -> list[LibraryFiles]:
        """The libraries in the folder of a library. What is none of them, and not right either, does not matter. The
        libraries of a project are not looked for outside the project."""
        folder = _folder_of(library)
        if folder not in self._nearby:
            root = self._root if self._root is not None and is_inside(library.path, self._root) else None
            paths = [path for path in _libraries_in(folder) if root is None or is_inside(path, root)]
            self._nearby[folder] = [other for path in paths if (other := _readable(path))]
        return self._nearby[folder]


def _folder_of(library: LibraryFiles) -> Path:
    """The folder that a library lies in, also of one that is named as . or .."""
    path = library.path
    return path.parent if path.name not in ("", "..") else path / ".."


def _readable(path: Path) -> LibraryFiles | None:
    try:
        return read_library(path)
    except UsageError:
        return None


def resolve_libraries(
    paths: Iterable[Path], sources: Iterable[Path] = (), root: Path | None = None
) -> list[LibraryFiles]:
    """The libraries of these paths, and those that they need, and those that `sources` need if a library is among them:
    one that is checked or tested by itself. `root`: the folder of the project, if there is one. Raises UsageError, with
    the line of library.toml where there is one, for what is missing, does not fit together or needs itself."""
    resolution = _Resolution(root)
    given = [read_library(library) for path in paths for library in find_libraries(path)]
    for library in given:
        resolution.add(library)
    for library in (*given, *(read_library(path) for path in sources if is_library(path))):
        resolution.complete(library)
    found = list(resolution.found.values())
    _check_namespaces(found)
    return found


def _check_namespaces(libraries: Sequence[LibraryFiles]) -> None:
    seen: dict[str, LibraryFiles] = {}
    for library in libraries:
        other = seen.setdefault(library.namespace.casefold(), library)
        if other is not library:
            raise UsageError(
                f"The libraries {other.path} and {library.path} have the same namespace, {library.namespace}; "
                f"change it in one of them.",
                "library-conflict",
            )
