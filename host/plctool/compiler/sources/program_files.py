"""What a program is made of: its sources, its libraries, and the description of its inputs and outputs.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from plctool.compiler.base.information import NO_INFORMATION, Information
from plctool.errors import UsageError
from plctool.image.file import ApplicationInfo
from plctool.project import project_named

if TYPE_CHECKING:
    from plctool.compiler.base.source import Source
    from plctool.compiler.sources.imports import ImportedLibrary
    from plctool.compiler.sources.project import Project
    from plctool.io.model import Description


@dataclass(frozen=True)
class IoFiles:
    """Where the inputs and outputs are described: `description` (by default what is beside the sources), and the
    vendor's `device` (by default what the description names). Not `wanted`: there are none, whatever lies beside the
    sources."""

    description: Path | None = None
    device: Path | None = None
    wanted: bool = True


@dataclass(frozen=True)
class ProgramFiles:
    """`sources`: files and folders; `libraries`: those given, or folders of them; `beside`: where a description may be,
    if `io` names none; `info`: what the image says about the program; `project`: that which names them, if one does."""

    sources: Sequence[Path]
    beside: Sequence[Path]
    libraries: Sequence[Path]
    io: IoFiles
    info: ApplicationInfo
    project: Project | None = None

    @property
    def root(self) -> Path | None:
        """The folder of the project, which contains all that the project names; None if there is no project."""
        return None if self.project is None else self.project.file.parent

    @property
    def information(self) -> Information:
        """What the program may ask about its project."""
        return NO_INFORMATION if self.project is None else self.project.information

    @cached_property
    def source_files(self) -> Sequence[Path]:
        """The files of the sources, and projects of other systems that name them; not read yet. Raises UsageError when
        there is nothing to read."""
        from plctool.compiler.sources.source_files import files_read

        try:
            return list(files_read(self.sources, self.root))
        except OSError as error:
            raise _unreadable(error) from None

    @cached_property
    def _resolved(self) -> frozenset[Path]:
        return frozenset(path.resolve() for path in self.source_files)

    def has_source(self, path: Path) -> bool:
        """Whether a file is one of the sources, by whatever name. Raises UsageError when there is nothing to read."""
        return path.resolve() in self._resolved

    def load_sources(self) -> list[Source]:
        """All sources. Raises UsageError when there is nothing to read."""
        from plctool.compiler.sources.source_files import load

        try:
            return load(self.sources, self.root)
        except OSError as error:
            raise _unreadable(error) from None

    def every_file(self) -> Iterator[Path]:
        """All files that are read to compile it, but the project file. Raises what the other functions do."""
        from plctool.compiler.sources.library_files import resolve_libraries

        yield from self.source_files
        for library in resolve_libraries(self.libraries, self.sources, self.root):
            yield from library.files
        io = self.load_io()
        yield from map(Path, io.contents if io is not None else ())

    def load_libraries(self) -> list[ImportedLibrary]:
        """The libraries, and those that they need. Raises UsageError for what is missing or does not fit together."""
        from plctool.compiler.sources.imports import import_libraries
        from plctool.compiler.sources.library_files import resolve_libraries

        return import_libraries(resolve_libraries(self.libraries, self.sources, self.root))

    def load_io(self) -> Description | None:
        """The inputs and outputs, for one check; None if there is no description. Raises UsageError for a file that
        cannot be read, and when it is not clear which one is meant."""
        from plctool.io.description import find_description, load_description

        if not self.io.wanted:
            return None
        device = self.io.device
        found = self.io.description or find_description(self.beside, self.root)
        if found is None and device is not None:
            raise UsageError(f"There is no description (NAME.io.toml) that uses {device}; name it with --io.", "io")
        return None if found is None else load_description(found, device, self.root)


def _unreadable(error: OSError) -> UsageError:
    return UsageError(f"{error.filename} cannot be read: {error.strerror}.", "no-source")


Sources = Sequence[Path | str] | ProgramFiles
"""What a program is made of: its sources or its project, or all of it as `program_files` found it."""


def program_files(paths: Sources, io: IoFiles | None = None, libraries: Sequence[Path | str] = ()) -> ProgramFiles:
    """The files of a program: those named, or those of the project that is named. What `io` names holds before what
    the project names; `libraries` are added to its own. What was found before stays as it is. Raises CompileError for
    mistakes in a project file."""
    if isinstance(paths, ProgramFiles):
        return paths
    named = list(map(Path, paths))
    given = list(map(Path, libraries))
    io = io or IoFiles()
    file = project_named(named)
    if file is None:
        return ProgramFiles(named, named, given, io, ApplicationInfo(project=named[0].stem if named else ""))
    from plctool.compiler.sources.project import read_project

    project = read_project(file)
    io = IoFiles(io.description or project.io, io.device or project.device, io.wanted)
    beside = [file, *project.sources]
    return ProgramFiles(project.sources, beside, [*given, *project.libraries], io, project.info, project)
