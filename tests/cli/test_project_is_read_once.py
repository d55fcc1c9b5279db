"""A command reads plc.toml once, and so does pytest, however many files with TEST blocks the project has."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from test_pytest_plugin import run_pytest

from plctool import files
from plctool.templates import new_project

COUNTING = """
from plctool import files
read, count = files.read_regular, []
def counted(path, most):
    if path.name == "plc.toml":
        count.append(path)
    return read(path, most)
files.read_regular = counted
def pytest_unconfigure():
    print(len(count), "times")
"""


@pytest.fixture
def project(scratch: Path) -> Path:
    new_project(scratch / "pump", "library")
    return scratch / "pump"


@pytest.fixture
def read(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The project files that are read."""
    read_regular, found = files.read_regular, []

    def counted(path: Path, most: int) -> bytes:
        if path.name == "plc.toml":
            found.append(path)
        return read_regular(path, most)

    monkeypatch.setattr(files, "read_regular", counted)
    return found


@pytest.mark.parametrize("command", ["build", "check", "check --missing", "test", "test --junit report.xml", "run"])
@pytest.mark.parametrize("named", [[], ["."], ["plc.toml"]])
def test_a_command_reads_it_once(
    tool: Any, project: Path, monkeypatch: pytest.MonkeyPatch, read: list[Path], command: str, named: list[str]
) -> None:
    monkeypatch.chdir(project)
    for _ in range(2):  # the outputs exist at the second time
        read.clear()
        assert tool(*command.split(), *named).status == 0
        assert len(read) == 1


@pytest.mark.parametrize("command", ["scan", "status", "watch Main.level --count 1"])
def test_a_command_on_a_device_reads_it_once(
    tool: Any, project: Path, monkeypatch: pytest.MonkeyPatch, read: list[Path], command: str
) -> None:
    monkeypatch.chdir(project)
    settings = (project / "plc.toml").read_text()
    (project / "plc.toml").write_text(f'link = "serial:/dev/none"\n{settings}')
    assert "/dev/none" in tool(*command.split()).err
    assert len(read) == 1


def test_pytest_reads_it_once_for_all_files(project: Path) -> None:
    test = (project / "example" / "tests.st").read_text()
    for number in range(3):
        (project / "example" / f"more{number}.st").write_text(test.replace("raw value", f"raw value {number}"))
    (project / "conftest.py").write_text(COUNTING)
    done = run_pytest(project, "-s")
    assert "4 passed" in done.stdout
    assert "1 times" in done.stdout


def test_a_file_beside_the_sources_of_the_project_is_a_program_of_its_own(project: Path) -> None:
    (project / "spare").mkdir()
    (project / "spare" / "own.st").write_text("TEST 'alone'\nASSERT_EQ(1, 1);\nEND_TEST\n")
    done = run_pytest(project)
    assert "2 passed" in done.stdout, done.stdout
