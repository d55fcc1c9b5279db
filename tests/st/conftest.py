"""Makes each program of these folders tests of its own, for `pytest tests/st/sfc/NAME.st`."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

_COMPILER = str(Path(__file__).parents[1] / "compiler")


class Program(pytest.Item):
    """A program, compiled one way."""

    def __init__(self, *, test: Callable[[Path], None], **rest: Any) -> None:
        super().__init__(**rest)
        self._test = test

    def runtest(self) -> None:
        self._test(self.path)

    def reportinfo(self) -> tuple[Path, int, str]:
        return self.path, 0, self.name


class ProgramFile(pytest.File):
    """A program of `tests/compiler/test_st_programs.py`."""

    def collect(self) -> Iterator[pytest.Item]:
        if _COMPILER not in sys.path:
            sys.path.insert(0, _COMPILER)
        tests = importlib.import_module("test_st_programs")
        yield Program.from_parent(self, name="test_program", test=tests.test_program)
        if tests.runs(tests.read_script(self.path)):
            name = "test_program_without_optimisation"
            yield Program.from_parent(self, name=name, test=tests.test_program_without_optimisation)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    return ProgramFile.from_parent(parent, path=file_path) if file_path.suffix == ".st" else None
