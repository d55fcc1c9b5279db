"""A program that is open in the editor: its files as the editor has them, their trees, and what names stand for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.compiler.base.source import Finding, Source
from plctool.compiler.sources.dialect_of_files import dialect_of_files
from plctool.compiler.sources.program_files import ProgramFiles, program_files
from plctool.compiler.sources.source_files import READERS, combined, read_content
from plctool.compiler.syntax.diagnostics import CompileError, Diagnostic
from plctool.compiler.syntax.warnings import ALL_WARNINGS, WarningOptions, warning_options
from plctool.errors import PlcError
from plctool.files import read_regular
from plctool.lsp.names import LibraryNames, Names
from plctool.lsp.tree import Tree
from plctool.lsp.uses import Walk, uses_of
from plctool.project import PROJECT_FILE

if TYPE_CHECKING:
    from plctool.compiler.sources.imports import ImportedLibrary
    from plctool.io.model import Description

MAX_FILE = 8 << 20  # bytes of a file that is read while typing; `plctool check` reads larger ones
MAX_FILES = 2000


@dataclass(frozen=True)
class Snapshot:
    """What a check works on; nothing of it changes."""

    sources: Sequence[Source]
    files: ProgramFiles
    libraries: Sequence[ImportedLibrary]
    warnings: WarningOptions
    dialect: str | None
    io_texts: Mapping[str, str]
    found: Sequence[Diagnostic] = ()  # by those who read the files

    def load_io(self) -> Description | None:
        """Returns the inputs and outputs for one check, as the editor has them."""
        from plctool.io.description import find_description, load_description, read_description

        files = self.files
        if not files.io.wanted:
            return None
        path = files.io.description or find_description(files.beside, files.root)
        if path is None:
            return None
        text = self.io_texts.get(str(path.absolute()))
        if text is None:
            return load_description(path, files.io.device, files.root)
        return read_description(str(path), text, files.io.device, files.root)


class Project:
    """`named`: what `plctool check` would be given. `open_files`: the text of each open file, by path."""

    def __init__(self, named: Sequence[Path], open_files: Mapping[str, str]) -> None:
        self.named = list(named)
        self.version = 0
        self._open_files = open_files
        self._read: dict[Path, list[Source]] = {}
        self._changed: set[Path] = set()
        self._sources: list[Source] | None = None
        self._trees: dict[int, Tree] = {}
        self._by_path: dict[str, Tree] = {}
        self._names: Names | None = None
        self._walks: dict[int, tuple[int, Walk]] = {}
        self.reload()

    # ---- files ----

    def reload(self) -> None:
        """Finds the files again, after one was made or deleted or plc.toml has changed. What is wrong with plc.toml or
        a library is in `mistakes`; the program is then what the folder has."""
        self.mistakes: list[Diagnostic] = []
        self.message = ""
        self.files = self._found_files()
        try:
            paths = [path.absolute() for path in self.files.source_files]
        except PlcError as error:
            self._note(error)
            paths = []
        self.paths = dict.fromkeys(path for path in paths if path.name != PROJECT_FILE)
        if len(self.paths) > MAX_FILES:
            self.message = f"The project has more than {MAX_FILES} sources; only the first {MAX_FILES} are read."
            self.paths = dict.fromkeys(list(self.paths)[:MAX_FILES])
        self._read = {path: sources for path, sources in self._read.items() if path in self.paths}
        self._changed |= self.paths.keys()
        self.libraries = self._loaded_libraries()
        project = self.files.project
        self.warnings = ALL_WARNINGS
        if project is not None:
            self.warnings = warning_options(project.no_warn, as_errors=project.werror)
        found = None if project is not None and project.dialect else dialect_of_files(self.paths)
        self.dialect = project.dialect if project is not None and project.dialect else found[0] if found else None
        self._library_names = LibraryNames(self.libraries)
        self._forget()

    def _found_files(self) -> ProgramFiles:
        try:
            return program_files(self.named)
        except PlcError as error:
            self._note(error)
        folder = self.named[0] if self.named[0].is_dir() else self.named[0].parent
        empty = program_files([folder / "-"])
        return replace(empty, sources=[folder], beside=[folder])

    def _loaded_libraries(self) -> Sequence[ImportedLibrary]:
        try:
            return self.files.load_libraries()
        except PlcError as error:
            self._note(error)
            return []

    def _note(self, error: PlcError) -> None:
        if isinstance(error, CompileError):
            self.mistakes += error.diagnostics
        else:
            self.message = error.message

    def has(self, path: str) -> bool:
        """True if a file is one of its sources."""
        return Path(path) in self.paths

    def is_setting(self, path: str) -> bool:
        """True for a file that is not a source but says something about it."""
        name = Path(path).name
        return name.endswith(".toml") and any(
            (folder if folder.is_dir() else folder.parent).absolute() in (Path(path).parent, *Path(path).parents)
            for folder in self.named
        )

    def change(self, path: str) -> None:
        """Notes that the text of a file has changed."""
        self._changed.add(Path(path))
        self.version += 1
        self._sources = None
        self._names = None

    def _forget(self) -> None:
        self.version += 1
        self._sources = None
        self._names = None
        self._walks.clear()

    def _content(self, path: Path) -> list[Source]:
        text = self._open_files.get(str(path))
        try:
            if text is None:
                data = read_regular(path, MAX_FILE)
            else:
                data = text.encode("utf-8", "replace")
                if len(data) > MAX_FILE:
                    raise OSError(0, f"it has more than {MAX_FILE >> 20} MiB; split it", str(path))
        except OSError as error:
            said = Finding(1, 1, "file", f"this file is not read: {error.strerror}")
            return [Source(str(path), "", findings=(said,))]
        return read_content(path, data)

    @property
    def sources(self) -> list[Source]:
        """All sources, as the editor has them."""
        if self._sources is None:
            for path in self._changed & self.paths.keys():
                self._read[path] = self._content(path)
            self._changed.clear()
            self._sources = combined({path: self._read[path] for path in self.paths})
        return self._sources

    def snapshot(self) -> Snapshot:
        """Returns all that a check needs."""
        texts = {path: text for path, text in self._open_files.items() if path.endswith(".toml")}
        return Snapshot(
            self.sources,
            self.files,
            self.libraries,
            self.warnings,
            self.dialect,
            texts,
            tuple(d for d in self.mistakes if d.file not in self._open_files),  # of open files they are shown at once
        )

    # ---- trees ----

    @property
    def trees(self) -> list[Tree]:
        """The trees of all sources. A text that has not changed keeps its own."""
        _ = self.names
        return list(self._trees.values())

    @property
    def names(self) -> Names:
        """What names stand for."""
        if self._names is None:
            before, by_path = self._trees, self._by_path
            self._trees, self._by_path = {}, {}
            for source in self.sources:
                tree = before.get(id(source))
                if tree is None or tree.source is not source:
                    tree = Tree(source, by_path.get(source.path))
                self._trees[id(source)] = tree
                self._by_path.setdefault(source.path, tree)
            self._walks = {key: known for key, known in self._walks.items() if key in self._trees}
            self._names = Names(list(self._trees.values()), self._library_names)
            self._interfaces = hash(tuple(tree.interface for tree in self._trees.values()))
        return self._names

    def trees_of(self, path: str) -> list[Tree]:
        """Returns the trees of a file: an XML file has several."""
        names = self.names
        own = [t for t in names.trees if t.source.path == path]
        return own or [t for t in names.trees if any(piece.path == path for piece in t.source.pieces)]

    def walk(self, tree: Tree) -> Walk:
        """Returns what the words of a tree stand for."""
        names = self.names
        known = self._walks.get(id(tree.source))
        if known is not None and known[0] == self._interfaces and known[1].tree is tree:
            return known[1]
        walk = uses_of(tree, names)
        self._walks[id(tree.source)] = (self._interfaces, walk)
        return walk

    def walks(self) -> Iterator[Walk]:
        """Returns what all words of the program stand for."""
        for tree in self.trees:
            yield self.walk(tree)


def is_source(path: str) -> bool:
    """True for a file that may be a source, by its name."""
    return Path(path).suffix.lower() in READERS
