"""Tests that are debugged: TEST blocks as `plctool test` runs them, and what pytest runs, in this process."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from plctool.errors import UsageError

Output = Callable[[str], None]


@dataclass(frozen=True)
class TestRun:
    """`run` writes what it has to say to an `Output`, and returns the exit status."""

    __test__ = False  # nothing for pytest to collect

    run: Callable[[Output], int]


class _Lines(io.TextIOBase):
    """A stream whose text goes to an output."""

    def __init__(self, output: Output) -> None:
        self._output = output

    def writable(self) -> bool:
        return True

    def write(self, text: str) -> int:
        self._output(text)
        return len(text)


def st_tests(paths: list[Path], pattern: str) -> TestRun:
    """The TEST blocks in sources whose names fit a pattern. Raises PlcError as `plctool test` does."""
    from plctool.compiler import program_files
    from plctool.st_tests import TestProgram, report_text, run_chosen

    files = program_files(paths)
    program = TestProgram(files, dialect=files.project.dialect if files.project else None, debug=True)
    chosen = program.find(pattern)

    def run(output: Output) -> int:
        report = run_chosen(program, chosen)
        output(report_text(report) + "\n")
        return int(report.failed > 0)

    return TestRun(run)


def python_tests(arguments: list[str], folder: str) -> TestRun:
    """What pytest runs with these arguments. Raises UsageError."""
    try:
        import pytest
    except ImportError:
        raise UsageError("pytest is not installed beside plctool; install it: pip install pytest.", "launch") from None

    def run(output: Output) -> int:
        if folder:
            os.chdir(folder)
        with redirect_stdout(_Lines(output)):
            return int(pytest.main(["-p", "no:cacheprovider", *arguments]))

    return TestRun(run)


def find_test_run(arguments: dict[str, Any]) -> TestRun | None:
    """What a launch wants: `pytest`, a list of arguments; `tests`, a pattern of names, or true; else None."""
    words, tests = arguments.get("pytest"), arguments.get("tests")
    if words is not None:
        if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
            raise UsageError('"pytest" is a list of its arguments, such as ["tests", "-k", "pump"].', "launch")
        return python_tests(words, str(arguments.get("cwd") or ""))
    if tests is None or tests is False:
        return None
    if tests is not True and not isinstance(tests, str):
        raise UsageError('"tests" is true, or a pattern of the names of tests, such as "pump*".', "launch")
    return st_tests(programs_of(arguments), "*" if tests is True else tests)


def programs_of(arguments: dict[str, Any]) -> list[Path]:
    """`program`: a path, or several. Raises UsageError."""
    program = arguments.get("program")
    paths = [p for p in (program if isinstance(program, list) else [program]) if isinstance(p, str) and p]
    if not paths:
        raise UsageError('A launch names its program, such as "program": "src"; a path, or a list of paths.', "launch")
    return [Path(path) for path in paths]
