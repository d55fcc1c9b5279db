"""Which lines of a program its tests run: for users, and as reports that the package `coverage` writes (HTML, and the
XML of Cobertura)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plctool.compiler.semantics.statement_marks import MARKS
from plctool.iec.areas import Area

if TYPE_CHECKING:
    from plctool.compiler.base.source import Source
    from plctool.compiler.typed.nodes import Pos
    from plctool.sim import Simulator

_PLUGIN = "plctool.st_tests.coverage_plugin"


@dataclass(frozen=True)
class FileCoverage:
    """The lines of a file at which statements begin, and those of them that ran."""

    source: Source
    lines: frozenset[int]
    run: frozenset[int]

    @property
    def missing(self) -> list[int]:
        return sorted(self.lines - self.run)

    def document(self) -> dict[str, Any]:
        """What `--json` prints."""
        return {"file": self.source.path, "lines": len(self.lines), "run": len(self.run), "missing": self.missing}


class Coverage:
    """`places`: of all statements, in the order of their marks; `sources`: of the program."""

    def __init__(self, places: Sequence[Pos], sources: Sequence[Source]) -> None:
        self._places = places
        self._sources = sources
        self._marks = 0  # a byte for each, 1 when it ran

    def add(self, marks: bytes) -> None:
        """What has run since a cold start."""
        self._marks |= int.from_bytes(marks, "little")

    def files(self) -> list[FileCoverage]:
        """Those with statements."""
        run: dict[str, set[int]] = {}
        lines: dict[str, set[int]] = {}
        marks = self._marks.to_bytes(len(self._places), "little")
        for place, ran in zip(self._places, marks, strict=True):
            lines.setdefault(place.file, set()).add(place.line)
            if ran:
                run.setdefault(place.file, set()).add(place.line)
        by_path = {s.path: s for s in self._sources}  # a file of a whole project is several sources
        return [
            FileCoverage(source, frozenset(lines[path]), frozenset(run.get(path, ())))
            for path, source in by_path.items()
            if path in lines
        ]

    def document(self) -> dict[str, Any]:
        """What `--json` prints."""
        files = self.files()
        return {"percent": _percent(files), "files": [file.document() for file in files]}

    def text(self) -> str:
        """A line for each file, and the sum."""
        files = self.files()
        if not files:
            return "coverage: the program has no statements"
        width = max((len(file.source.path) for file in files), default=0)
        rows = [f"{file.source.path:{width}}  {_percent([file]):3} %  {_not_run(file.missing)}" for file in files]
        return "\n".join([*map(str.rstrip, rows), f"coverage: {_percent(files)} % of the lines with statements"])

    def write_reports(self, folder: Path) -> None:
        """Writes `index.html` with a page for each file, and `cobertura.xml`; nothing for a program without statements.
        Raises OSError."""
        from coverage import Coverage as Reports

        files = {os.path.realpath(file.source.path): file for file in self.files()}  # the names `coverage` has
        if not files:
            return
        reports = Reports(data_file=None, config_file=False, messages=False)
        reports.set_option("run:plugins", [_PLUGIN])
        reports.set_option(f"{_PLUGIN}:files", files)  # type: ignore[arg-type] # what it is, only the plugin knows
        data = reports.get_data()
        data.add_lines({name: file.run for name, file in files.items()})
        data.add_file_tracers(dict.fromkeys(files, f"{_PLUGIN}.StPlugin"))
        folder.mkdir(parents=True, exist_ok=True)
        reports.html_report(directory=str(folder), title="plctool test")
        reports.xml_report(outfile=str(folder / "cobertura.xml"))


def marked(plc: Simulator) -> bytes:
    """Which statements have run since the last cold start: a byte for each."""
    symbol = plc.symbols().resolve(MARKS)
    return bytes(plc.memory(Area(symbol.area), symbol.offset, symbol.size))


def _percent(files: Sequence[FileCoverage]) -> int:
    """Rounded down, so that only all is 100."""
    lines, run = sum(len(file.lines) for file in files), sum(len(file.run) for file in files)
    return 100 * run // lines if lines else 100


def _not_run(lines: Sequence[int]) -> str:
    """`3, 7-9`: the lines, those that follow one another as a range."""
    ranges = []
    for _, group in groupby(enumerate(lines), key=lambda pair: pair[1] - pair[0]):
        numbers = [line for _, line in group]
        ranges.append(f"{numbers[0]}-{numbers[-1]}" if len(numbers) > 1 else str(numbers[0]))
    return f"not run: {', '.join(ranges)}" if ranges else ""
