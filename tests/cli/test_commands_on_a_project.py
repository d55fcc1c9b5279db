"""`flash`, `info`, `symbols`, `io map`, `image` and `bench` take a project and build it first if it is stale."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from fake_device import FakePlc

from plctool.templates import new_project

PORT = ["--port", "/dev/fake"]


@pytest.fixture
def project(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project in the current folder, with its image."""
    new_project(scratch / "pump", "minimal")
    monkeypatch.chdir(scratch / "pump")
    return scratch / "pump"


def source_of(project: Path) -> Path:
    return next(file for file in sorted(project.rglob("*.st")) if "PROGRAM" in file.read_text())


def change(file: Path) -> None:
    """A change that the modification time does not show."""
    before = file.stat()
    file.write_text(file.read_text().replace("END_VAR", "    added : INT := 5;\nEND_VAR", 1))
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))


@pytest.mark.parametrize("command", ["info", "symbols", "io map"])
@pytest.mark.parametrize("named", [[], ["."], ["plc.toml"]])
def test_an_image_that_is_missing_is_built(tool: Any, project: Path, command: str, named: list[str]) -> None:
    done = tool(*command.split(), *named)
    assert done.status == 0
    assert "Built app.cdl" in done.err
    assert (project / "app.cdl").exists()


def test_an_image_that_is_fresh_stays_as_it_is(tool: Any, project: Path) -> None:
    assert tool("build").status == 0
    before = (project / "app.cdl").stat().st_mtime_ns
    done = tool("info")
    assert done.status == 0
    assert "Built" not in done.err
    assert (project / "app.cdl").stat().st_mtime_ns == before


@pytest.mark.parametrize("what", ["source", "new source", "deleted source", "option", "image"])
def test_an_image_is_stale_after_a_change(tool: Any, project: Path, what: str) -> None:
    other = project / "src" / "other.st"
    other.parent.mkdir(exist_ok=True)
    if what == "deleted source":
        other.write_text("FUNCTION Other : INT\nOther := 1;\nEND_FUNCTION\n")
    assert tool("build").status == 0
    if what == "source":
        change(source_of(project))
    elif what == "new source":
        other.write_text("FUNCTION Other : INT\nOther := 1;\nEND_FUNCTION\n")
    elif what == "deleted source":
        other.unlink()
    elif what == "option":
        text = (project / "plc.toml").read_text()
        (project / "plc.toml").write_text(text.replace("[options]", "[options]\nchecks = 'none'"))
    else:
        (project / "app.cdl").write_bytes((project / "app.cdl").read_bytes()[:-4] + b"\0\0\0\0")
        (project / "app.sym").unlink()
    done = tool("info")
    assert done.status == 0
    assert "Built app.cdl" in done.err


def test_symbols_takes_patterns_of_the_project(tool: Any, project: Path) -> None:
    change(source_of(project))
    done = tool("symbols", "*.added")
    assert done.status == 0
    assert "added" in done.out


def test_flash_builds_and_sends_the_project(tool: Any, project: Path, plc: FakePlc) -> None:
    assert tool("flash", *PORT, "--json").status == 0
    first = plc.image
    assert first == (project / "app.cdl").read_bytes()
    change(source_of(project))
    assert tool("flash", *PORT).status == 0
    assert plc.image == (project / "app.cdl").read_bytes() != first


def test_a_project_with_an_error_is_not_flashed(tool: Any, project: Path, plc: FakePlc) -> None:
    source_of(project).write_text("PROGRAM Main\nx := 1;\nEND_PROGRAM\n")
    done = tool("flash", *PORT)
    assert done.status == 2
    assert "main.st:2:1: error" in done.err
    assert not (project / "app.cdl").exists()


def test_a_command_outside_of_a_project_says_so(tool: Any, scratch: Path) -> None:
    done = tool("flash", *PORT)
    assert done.status == 2
    assert "There is no project here" in done.err


def test_warnings_of_the_build_do_not_mix_with_json(tool: Any, project: Path) -> None:
    assert tool("info", "--json").json["crc"]


def test_image_burns_the_project_for_its_board(tool: Any, project: Path) -> None:
    text = (project / "plc.toml").read_text()
    (project / "plc.toml").write_text('board = "mps2-an385/standard"\n' + text)
    done = tool("image", "-o", "burn.hex")
    assert done.status == 0, done.err
    assert (project / "burn.hex").exists()


def test_bench_measures_the_project(tool: Any, project: Path) -> None:
    assert tool("bench", "--cycles", "10", "--json").json["tasks"]
