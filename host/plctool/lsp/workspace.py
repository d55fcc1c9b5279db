"""The folders that an editor has open: which programs are in them, and which file belongs to which."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from plctool.compiler.formats.twincat_projects import PLC_PROJECT
from plctool.errors import PlcError
from plctool.files import is_inside
from plctool.lsp.project import Project, is_source
from plctool.project import PROJECT_FILE, find_project

_MAX_ENTRIES = 20_000  # files and folders that are looked at
_MAX_DEPTH = 12
_LEFT_OUT = frozenset(("node_modules", "__pycache__", "venv"))


class Workspace:
    """`open_files`: the text of each open file, by path."""

    def __init__(self, folders: Iterable[str]) -> None:
        self.folders = [Path(folder).absolute() for folder in folders]
        self.open_files: dict[str, str] = {}
        self.projects: list[Project] = []
        self.messages: list[str] = []
        self._scanned: dict[Path, list[Path] | None] = {}
        self._with_sources: set[Path] = set()

    def set_folders(self, folders: Iterable[str]) -> None:
        """Works on other folders from now on."""
        self.folders = [Path(folder).absolute() for folder in folders]
        self._scanned.clear()
        self.projects = [p for p in self.projects if any(path in p.paths for path in map(Path, self.open_files))]

    def load_folders(self) -> None:
        """Loads the program of each folder that is one as a whole."""
        for folder in self.folders:
            if (folder / PROJECT_FILE).is_file():
                self._load([folder / PROJECT_FILE])
            elif (kinds := self._kinds(folder)) is not None and not kinds and folder in self._with_sources:
                self._load([folder])

    def _kinds(self, folder: Path) -> list[Path] | None:
        """The project files below a folder that say what a program is, if it is more than one; None for a folder that
        is too large to look through."""
        if folder not in self._scanned:
            self._scanned[folder] = self._scan(folder)
        return self._scanned[folder]

    def _scan(self, folder: Path) -> list[Path] | None:
        found: list[Path] = []
        has_sources = False
        for count, path in enumerate(_walk(folder)):
            if count > _MAX_ENTRIES:
                self.messages.append(
                    f"{folder} has more than {_MAX_ENTRIES} files; only files that are open are checked. "
                    f"Open the folder of one project, or write a {PROJECT_FILE}."
                )
                return None
            if path.name == PROJECT_FILE:
                found.append(path)
            elif path.suffix.lower() == PLC_PROJECT:
                found.append(path)
                has_sources = True
            else:
                has_sources |= is_source(path.name)
        if has_sources:
            self._with_sources.add(folder)
        projects = [path for path in found if path.name == PROJECT_FILE]
        return projects if projects else found if len(found) > 1 else []

    def _load(self, named: list[Path]) -> Project | None:
        known = next((p for p in self.projects if p.named == named), None)
        if known is not None:
            return known
        try:
            project = Project(named, self.open_files)
        except (PlcError, OSError) as error:
            self.messages.append(str(error))
            return None
        self.projects.append(project)
        if project.message:
            self.messages.append(project.message)
        return project

    # ---- the program of a file ----

    def project_of(self, path: str) -> Project | None:
        """Returns the program that a source belongs to; one of this file alone if no project has it."""
        known = next((p for p in self.projects if p.has(path)), None)
        if known is not None or not is_source(path):
            return known
        for named in self._candidates(Path(path)):
            project = self._load(named)
            if project is not None and project.has(path):
                return project
        return self._load([Path(path)])

    def _candidates(self, path: Path) -> Iterator[list[Path]]:
        """What may be the program of a file, the best one first."""
        folder = next((f for f in self.folders if f in path.parents), None)
        if folder is None:
            try:
                found = find_project(path.parent) if path.parent.is_dir() else None
            except (PlcError, OSError):
                found = None
            if found is not None:
                yield [found.absolute()]
            return
        around = [each for each in path.parents if each == folder or folder in each.parents]
        for each in around:
            if (each / PROJECT_FILE).is_file():
                yield [each / PROJECT_FILE]
        kinds = self._kinds(folder)
        if kinds is None:
            return
        if not kinds:
            yield [folder]
        for kind in kinds:
            if kind.suffix.lower() == PLC_PROJECT and kind.parent in path.parents:
                yield [kind]

    def projects_with(self, path: str) -> list[Project]:
        """Returns the programs that a file says something about."""
        return [p for p in self.projects if p.has(path) or p.is_setting(path)]

    def drop_lonely(self) -> list[Project]:
        """Forgets the programs of single files that are closed; returns them."""
        open_paths = set(map(Path, self.open_files))
        lonely = [
            p
            for p in self.projects
            if p.named[0].suffix and is_source(p.named[0].name) and p.named[0] not in open_paths
        ]
        self.projects = [p for p in self.projects if p not in lonely]
        return lonely

    def files_changed(self, paths: Iterable[str]) -> list[Project]:
        """Takes notice of files that were written, made or deleted; returns the programs that may be other ones now."""
        self._scanned.clear()
        changed: list[Project] = []
        for path in paths:
            if path in self.open_files and is_source(path):
                continue  # the editor's text counts
            for project in self.projects:
                named = project.named[0]
                around = named if named.is_dir() else named.parent
                if project.has(path) and os.path.exists(path):
                    project.change(path)
                elif project.has(path) or is_inside(Path(path), around):
                    project.reload()
                else:
                    continue
                if project not in changed:
                    changed.append(project)
        return changed


def _walk(folder: Path, depth: int = 0) -> Iterator[Path]:
    """Returns the files below a folder; links to folders are not followed."""
    try:
        entries = sorted(os.scandir(folder), key=lambda e: e.name)
    except OSError:
        return
    for entry in entries:
        path = Path(entry.path)
        try:
            is_folder = entry.is_dir(follow_symlinks=False)
        except OSError:
            continue
        if is_folder:
            yield path
            if depth < _MAX_DEPTH and not entry.name.startswith(".") and entry.name not in _LEFT_OUT:
                yield from _walk(path, depth + 1)
        else:
            yield path
