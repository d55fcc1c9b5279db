"""What the package `coverage` asks about files that are not Python: which of their lines could have run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from coverage import CoveragePlugin, FileReporter

if TYPE_CHECKING:
    from coverage.plugin_support import Plugins

    from plctool.st_tests.coverage import FileCoverage


class StReporter(FileReporter):
    """A file of the program, as it was compiled."""

    def __init__(self, path: str, file: FileCoverage) -> None:
        super().__init__(path)
        self._file = file

    def lines(self) -> set[int]:
        return set(self._file.lines)

    def source(self) -> str:
        source = self._file.source
        return source.text if source.original is None else source.original


class StPlugin(CoveragePlugin):
    """`files`: by absolute path."""

    def __init__(self, files: dict[str, FileCoverage]) -> None:
        self._files = files

    def file_reporter(self, filename: str) -> FileReporter:
        return StReporter(filename, self._files[filename])


def coverage_init(reg: Plugins, options: dict[str, Any]) -> None:
    """How `coverage` loads a plugin."""
    reg.add_file_tracer(StPlugin(options["files"]))
