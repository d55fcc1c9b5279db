"""An output file never replaces a file that the command reads, whatever its name."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "compiler"))

from library_support import library, manifest, zipped

MAIN = "PROGRAM Main\nVAR lamp AT %QX0.0 : BOOL; n : INT; END_VAR\nn := A.Get() + B.Got();\nEND_PROGRAM\n"
TESTS = "TEST 'get'\nASSERT_EQ(A.Get(), 7);\nEND_TEST\n"
GET = "FUNCTION Get : INT\nGet := 7;\nEND_FUNCTION\n"
BOARD = 'name = "IO-4"\nvendor = "Acme"\n[gpio]\nout = { DO0 = "PA0" }\n'
PLCOPEN = """<?xml version="1.0" encoding="utf-8"?>
<project xmlns="http://www.plcopen.org/xml/tc6_0201"><fileHeader companyName="" productName="" productVersion=""
creationDateTime="2024-01-01T00:00:00"/><contentHeader name="x"/><types><dataTypes/><pous/></types>
<instances><configurations/></instances></project>
"""


@pytest.fixture
def project(scratch: Path) -> Path:
    """A project that reads files of every kind, under names that say nothing of it."""
    (scratch / "src").mkdir()
    (scratch / "src/plain.txt").write_text(MAIN + TESTS)
    (scratch / "src/plc.xml").write_text(PLCOPEN)
    library(scratch / "libs", "A", {"get.st": GET, "drawn.xml": PLCOPEN})
    zipped(scratch / "b.zip", {"library.toml": manifest("B"), "got.st": GET.replace("Get", "Got")})
    (scratch / "board.dev").write_text(BOARD)
    (scratch / "channels.io").write_text('device = "board.dev"\n[gpio.out]\nDO0 = "Main.lamp"\n')
    (scratch / "plc.toml").write_text(
        'sources = ["src/plain.txt", "src/plc.xml"]\nlibraries = ["libs/A", "b.zip"]\nio = "channels.io"\n'
    )
    return scratch


READ = ["src/plain.txt", "src/plc.xml", "libs/A/library.toml", "libs/A/get.st", "libs/A/drawn.xml", "b.zip",
        "board.dev", "channels.io", "plc.toml"]  # fmt: skip


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and "cache" not in path.parts}


def refused(done: Any, name: str) -> bool:
    return done.status == 2 and name in done.err and "write for example" in done.err and done.err.count("\n") == 1


@pytest.mark.parametrize("name", READ)
@pytest.mark.parametrize("words", [("build", "-o"), ("test", "--junit"), ("run", "--trace", "Main.n", "-o")])
def test_no_output_replaces_a_file_of_the_project(tool: Any, project: Path, words: tuple[str, ...], name: str) -> None:
    before = contents(project)
    assert refused(tool(*words, name), name)
    assert contents(project) == before


@pytest.mark.parametrize("words", [("run", "--trace", "Main.n", "-o"), ("test", "--junit")])
def test_an_image_is_replaced_by_build_alone(tool: Any, project: Path, words: tuple[str, ...]) -> None:
    assert tool("build", "-o", "line.cdl").status == 0
    before = contents(project)
    assert refused(tool(*words, "line.cdl"), "line.cdl has the name of an image")
    assert contents(project) == before


def test_outputs_beside_the_files_of_a_project_are_written(tool: Any, project: Path) -> None:
    assert tool("build", "-o", "src/app.cdl").status == 0
    assert tool("build", "-o", "src/app.cdl").status == 0
    assert tool("test", "--junit", "src/report.xml").status == 0
    assert tool("test", "--junit", "src/report.xml").status == 0
    assert tool("run", "--trace", "Main.n", "-o", "libs/A/trace.csv").status == 0
    assert tool("run", "--trace", "Main.n", "-o", "libs/A/trace.csv").status == 0


@pytest.mark.parametrize("name", ["b.zip", "libs/A/drawn.xml", "other.dev", "channels.io"])
@pytest.mark.parametrize("words", [("build", "-o"), ("test", "--junit")])
def test_no_output_replaces_what_options_name(tool: Any, project: Path, words: tuple[str, ...], name: str) -> None:
    (project / "plc.toml").unlink()
    (project / "other.dev").write_text(BOARD)
    before = contents(project)
    given = (
        "src/plain.txt",
        "--library",
        "libs/A",
        "--library",
        "b.zip",
        "--io",
        "channels.io",
        "--device",
        "other.dev",
    )
    assert refused(tool(words[0], *given, words[1], name), name)
    assert contents(project) == before


def test_every_toml_and_project_file_is_left_alone(tool: Any, project: Path) -> None:
    for name in ("other.toml", "New.TOML", "plc.plcproj", "plc.tsproj", "plc.sln", "plc.xti"):
        assert refused(tool("build", "-o", name), name)
        assert refused(tool("test", "--junit", name), name)


def test_another_name_of_the_same_file_is_seen(tool: Any, project: Path) -> None:
    (project / "link").symlink_to("src/plain.txt")
    os.link(project / "b.zip", project / "hard")
    for name in ("link", "hard", "src/../src/plain.txt"):
        assert refused(tool("build", "-o", name), name)


def test_symbols_beside_the_image_replace_no_file_that_is_read(tool: Any, scratch: Path) -> None:
    (scratch / "app.sym").write_text("PROGRAM Main VAR n : INT; END_VAR n := 1; END_PROGRAM")
    before = contents(scratch)
    assert refused(tool("build", "app.sym", "-o", "app.cdl"), "app.sym")
    assert contents(scratch) == before


def test_trace_replaces_no_plant(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text("PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM")
    (scratch / "plant.py").write_text("def step(plc): pass\n")
    (scratch / "plant.txt").write_text("PROGRAM Plant VAR n : INT; END_VAR n := 1; END_PROGRAM")
    assert tool("build", "main.st").status == 0
    before = contents(scratch)
    for plant in ("plant.py", "plant.txt"):
        assert refused(tool("run", "app.cdl", "--plant", plant, "--trace", "Main.n", "-o", plant), plant)
    assert contents(scratch) == before


def test_production_image_replaces_no_program_and_no_firmware(tool: Any, scratch: Path) -> None:
    for name in ("app.bin", "firmware.hex"):
        (scratch / name).write_bytes(bytes(8))
        done = tool("image", "app.bin", "--firmware", "firmware.hex", "-o", name)
        assert refused(done, name)


def test_c_interface_replaces_no_source(tool: Any, scratch: Path) -> None:
    text = "{attribute 'external' := 'get'}\nFUNCTION Get : INT\nEND_FUNCTION\n"
    (scratch / "main.st").write_text(text)
    done = tool("export-itf", "main.st", "-o", "out", "--json")
    assert done.status == 0
    for name in (Path(done.json["header"]).name, Path(done.json["source"]).name):
        (scratch / name).write_text(text)
        (scratch / "main.st").write_text("")
        done = tool("export-itf", "main.st", name, "--force")
        assert refused(done, name)
        assert (scratch / name).read_text() == text
        (scratch / name).unlink()


def test_c_header_of_a_board_does_not_replace_its_device_file(tool: Any, scratch: Path) -> None:
    (scratch / "device.toml").write_text(BOARD)
    header = Path(tool("export-itf", "--device", "device.toml", "-o", "out", "--json").json["header"]).name
    (scratch / header).write_text(BOARD)
    assert refused(tool("export-itf", "--device", header), header)
    assert (scratch / header).read_text() == BOARD


def test_program_replaces_no_firmware(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text("PROGRAM Main END_PROGRAM")
    (scratch / "firmware").write_bytes(bytes(8))
    assert refused(tool("build", "main.st", "--firmware", "firmware", "-o", "firmware"), "firmware")
    assert (scratch / "firmware").read_bytes() == bytes(8)
