"""A plugin for pytest: the TEST blocks of `.st` files are tests like others, with their names, lines and failures.

The program of a test is the project that has it among its sources, else all sources of its folder; or those that
`plc_sources` in the configuration of pytest names.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from plctool.errors import PlcError

if TYPE_CHECKING:
    from plctool.compiler import ProgramFiles
    from plctool.st_tests import TestProgram
    from plctool.st_tests.report import Failure

_WORD = re.compile(rb"T\0?E\0?S\0?T", re.IGNORECASE)
_TEST = re.compile(r"\bTEST\s*['\"]", re.IGNORECASE)
_PROGRAMS: pytest.StashKey[dict[tuple[Path, ...], TestProgram]] = pytest.StashKey()
_PROJECTS: pytest.StashKey[dict[Path, ProgramFiles]] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addini(
        "plc_sources", "sources of the program that TEST blocks test; default: their project or folder", type="paths"
    )


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """A file of Structured Text with a TEST in it; only this is looked for, so that other files cost nothing."""
    if file_path.suffix.lower() == ".st" and _has_test(file_path.read_bytes()):
        return StFile.from_parent(parent, path=file_path)
    return None


def _has_test(data: bytes) -> bool:
    if not _WORD.search(data):
        return False
    from plctool.compiler.sources.source_files import decode
    from plctool.compiler.syntax.plain_text import plain_text

    return _TEST.search(plain_text(decode(data), strings=True)) is not None


class StFile(pytest.File):
    """The tests of one file."""

    def collect(self) -> Iterator[pytest.Item]:
        try:
            program = self._program()
        except PlcError as error:
            raise self.CollectError(error.message) from None
        for number, case in enumerate(program.cases):
            if Path(case.pos.file).resolve() == self.path.resolve():
                yield StItem.from_parent(self, name=case.name, program=program, number=number)

    def _program(self) -> TestProgram:
        """Each program is checked and compiled once."""
        from plctool.compiler import program_files
        from plctool.st_tests import TestProgram

        sources = tuple(self.config.getini("plc_sources")) or self._sources()
        programs = self.config.stash.setdefault(_PROGRAMS, {})
        if sources not in programs:
            files = self.config.stash.setdefault(_PROJECTS, {}).get(sources[0]) or program_files(sources)
            programs[sources] = TestProgram(files, dialect=files.project.dialect if files.project else None)
        return programs[sources]

    def _sources(self) -> tuple[Path, ...]:
        """The project of this file, or all sources of its folder, which may have the project of others."""
        from plctool.compiler.sources.source_files import find_sources
        from plctool.project import PROJECT_FILE

        folder = self.path.parent
        if project := self._project():
            return (project,)
        return tuple(find_sources(folder)) if (folder / PROJECT_FILE).exists() else (folder,)

    def _project(self) -> Path | None:
        """The project file of the nearest folder that has one, if this file is one of its sources. It is read once."""
        from plctool.compiler import program_files
        from plctool.project import find_project

        file = find_project(self.path.parent)
        if file is None:
            return None
        projects = self.config.stash.setdefault(_PROJECTS, {})
        if file not in projects:
            projects[file] = program_files([file])
        return file if projects[file].has_source(self.path) else None


class StFailure(Exception):
    """A TEST failed."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.text)
        self.failure = failure


class StItem(pytest.Item):
    """A TEST block. It runs in a simulator of its own: Python tests between may use another."""

    def __init__(self, *, program: TestProgram, number: int, **words: Any) -> None:
        super().__init__(**words)
        self._program = program
        self._number = number

    def runtest(self) -> None:
        (outcome,) = self._program.run([self._number])
        if outcome.failure:
            raise StFailure(outcome.failure)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        from plctool.st_tests import failure_text

        if isinstance(excinfo.value, StFailure):
            return failure_text(excinfo.value.failure, self._program.sources)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        return self.path, self._program.cases[self._number].pos.line - 1, self.name
