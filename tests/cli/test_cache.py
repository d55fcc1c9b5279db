"""`plctool cache`, and builds with and without the code that is kept."""

from __future__ import annotations

import os
import shutil
import zlib
from pathlib import Path
from typing import Any

import pytest

from plctool.cli.kept_reports import report_folder

EXAMPLES = Path(__file__).parents[2] / "examples"
pytestmark = pytest.mark.skipif(not hasattr(os, "getuid"), reason="files have no owner here")


@pytest.fixture(autouse=True)
def source(scratch: Path) -> None:
    (scratch / "main.st").write_text("PROGRAM Main\nVAR x : INT; END_VAR\nx := x + 1;\nEND_PROGRAM\n")


def test_build_keeps_its_code_and_clear_deletes_it(tool: Any, scratch: Path) -> None:
    assert tool("cache", "--json").json["objects"] == 0
    first = tool("build", "main.st", "--json").json
    shown = tool("cache", "--json").json
    assert shown["objects"] == 1 and shown["bytes"] > 100 and shown["usable"]
    assert Path(shown["folder"]).is_relative_to(scratch)
    assert tool("build", "main.st", "--json").json["crc"] == first["crc"]
    assert "1 object, 0 syntax trees and 1 report deleted" in tool("cache", "clear").out
    assert "0 objects" in tool("cache").out


def test_check_keeps_syntax_trees_and_clear_deletes_them(tool: Any, scratch: Path) -> None:
    source = scratch / "main.st"
    source.write_text(f"{source.read_text()}(* {'long ' * 300}*)\n")
    assert tool("check", "main.st").status == 0
    assert tool("cache", "--json").json["trees"] == 1
    assert "1 syntax tree and 1 report deleted" in tool("cache", "clear").out
    assert tool("cache", "--json").json["trees"] == 0


def _image(scratch: Path) -> tuple[int, bytes]:
    """Which file the image is, and its content."""
    image = scratch / "app.cdl"
    return image.stat().st_ino, image.read_bytes()


@pytest.fixture
def built(tool: Any, scratch: Path) -> tuple[int, bytes]:
    """The image of a first build; its file is kept open, so that no other gets its number."""
    assert tool("build", "main.st", "-o", "app.cdl").status == 0
    (scratch / "same.cdl").hardlink_to(scratch / "app.cdl")
    return _image(scratch)


@pytest.mark.usefixtures("built")
def test_build_of_what_is_built_already_says_the_same_and_leaves_the_image(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text("PROGRAM Main\nVAR x, unused : INT; END_VAR\nx := x + 1;\nEND_PROGRAM\n")
    first, image = tool("build", "main.st", "-o", "app.cdl"), _image(scratch)
    again = tool("build", "main.st", "-o", "app.cdl")
    assert (again.out, again.err, again.status) == (first.out, first.err, 0)
    assert "unused is never used" in again.err
    assert _image(scratch) == image


@pytest.mark.parametrize(
    "options", [["-O0"], ["--checks", "none"], ["--no-warn", "unused"], ["--no-cache"], ["-o", "other.cdl"]]
)
def test_other_options_are_another_build(
    tool: Any, scratch: Path, built: tuple[int, bytes], options: list[str]
) -> None:
    assert tool("build", "main.st", "-o", "app.cdl", *options).status == 0
    assert (scratch / "other.cdl").exists() or _image(scratch)[0] != built[0]


@pytest.mark.parametrize("name", ["app.cdl", "app.sym"])
@pytest.mark.parametrize("damage", [lambda file: file.unlink(), lambda file: file.write_bytes(b"?")])
def test_image_or_symbols_that_are_damaged_are_built_again(
    tool: Any, scratch: Path, built: tuple[int, bytes], name: str, damage: Any
) -> None:
    (scratch / "same.cdl").unlink()
    symbols = (scratch / "app.sym").read_bytes()
    damage(scratch / name)
    assert tool("build", "main.st", "-o", "app.cdl").status == 0
    assert _image(scratch)[1] == built[1]
    assert (scratch / "app.sym").read_bytes() == symbols


def test_undone_edit_is_built_again(tool: Any, scratch: Path, built: tuple[int, bytes]) -> None:
    text = (scratch / "main.st").read_text()
    for changed in (text.replace("1;", "2;"), text):
        (scratch / "main.st").write_text(changed)
        assert tool("build", "main.st", "-o", "app.cdl").status == 0
        assert (_image(scratch)[1] == built[1]) == (changed == text)


def test_project_whose_eds_has_changed_is_built_again(tool: Any, scratch: Path) -> None:
    project = scratch / "line"
    shutil.copytree(EXAMPLES / "canopen", project)
    assert tool("build", str(project)).status == 0
    eds = project / "drive.eds"
    eds.write_text(eds.read_text().replace("[1000]", "[100", 1))
    shown = tool("build", str(project))
    assert shown.status != 0 and "drive.eds has errors" in shown.err


_FAULTS = "PROGRAM Main\nVAR x, unused : INT; END_VAR\nx := {value};\nEND_PROGRAM\n"


@pytest.mark.parametrize("value", ["1", "'text'", "absent", "(1"])
@pytest.mark.parametrize("options", [[], ["--json"]])
def test_check_of_what_is_checked_already_says_the_same(
    tool: Any, scratch: Path, monkeypatch: pytest.MonkeyPatch, value: str, options: list[str]
) -> None:
    (scratch / "main.st").write_text(_FAULTS.format(value=value))
    first = tool("check", "main.st", *options)
    monkeypatch.setattr("plctool.compiler.check_with_tests", None)  # nothing is checked again
    again = tool("check", "main.st", *options)
    assert (again.out, again.err, again.status) == (first.out, first.err, first.status)
    assert "main.st" in first.out


@pytest.mark.parametrize("options", [["--guidelines"], ["--no-warn", "unused"], ["--werror"], ["--dialect", "codesys"]])
def test_check_with_other_options_is_another_check(
    tool: Any, scratch: Path, monkeypatch: pytest.MonkeyPatch, options: list[str]
) -> None:
    (scratch / "main.st").write_text(_FAULTS.format(value="1"))
    tool("check", "main.st")
    shown = tool("check", "main.st", *options)
    assert shown.out == tool("check", "main.st", *options).out
    monkeypatch.setenv("XDG_CACHE_HOME", str(scratch / "empty"))
    fresh = tool("check", "main.st", *options)
    assert (shown.out, shown.status) == (fresh.out, fresh.status)


def test_check_after_a_change_or_of_another_file_is_made_again(tool: Any, scratch: Path) -> None:
    for value, expected in (("1", 0), ("absent", 2), ("1", 0)):
        (scratch / "main.st").write_text(_FAULTS.format(value=value))
        assert tool("check", "main.st").status == expected
    (scratch / "other.st").write_text(_FAULTS.format(value="absent"))
    assert "main.st" in tool("check", "main.st").out
    assert "other.st" in tool("check", "other.st").out


def test_check_writes_its_reports_each_time(tool: Any, scratch: Path) -> None:
    for _ in range(2):
        assert tool("check", "main.st", "--sarif", "found.sarif").status == 0
        (scratch / "found.sarif").unlink()


@pytest.mark.parametrize("content", [b"", b"{}", b"[1]", b'{"files": [], "document": {"crc": 5}, "warnings": []}'])
def test_damaged_reports_are_not_used(tool: Any, scratch: Path, built: tuple[int, bytes], content: bytes) -> None:
    folder = report_folder().folder
    (kept,) = (file for file in folder.rglob("*") if file.is_file())
    report_folder().put(kept.name, zlib.compress(content))
    assert tool("build", "main.st", "-o", "app.cdl").status == 0
    assert _image(scratch)[0] != built[0]


def test_build_without_cache_neither_reads_nor_keeps_code(tool: Any) -> None:
    assert tool("build", "main.st", "--no-cache").status == 0
    shown = tool("cache", "--json").json
    assert (shown["objects"], shown["reports"]) == (0, 0)


def test_folder_that_others_may_write_is_not_used_and_cache_says_so(tool: Any) -> None:
    folder = Path(tool("cache", "--json").json["folder"])
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    assert tool("build", "main.st").status == 0
    assert not [*folder.iterdir()]
    assert "is not used: others may write or read it" in tool("cache").out
    assert not tool("cache", "--json").json["usable"]
