"""plctool export: a project as PLCopen XML, and where it is not written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

MAIN = "PROGRAM Main\nVAR lamp : BOOL; END_VAR\nlamp := NOT lamp;\nEND_PROGRAM\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "src").mkdir()
    (tmp_path / "src/main.st").write_text(MAIN)
    return tmp_path


def test_the_file_builds_the_same_image(tool: Any, folder: Path) -> None:
    source, xml = folder / "src", folder / "p.xml"
    done = tool("export", str(source), "-o", str(xml))
    assert (done.status, done.out.strip()) == (0, str(xml))
    tool("build", str(source), "-o", str(folder / "a.cdl"))
    tool("build", str(xml), "-o", str(folder / "b.cdl"))
    a, b = (tool("run", str(folder / name), "--get", "Main.lamp").out for name in ("a.cdl", "b.cdl"))
    assert a == b
    assert "TRUE" in a


def test_what_is_left_out_is_a_warning_and_in_the_document(tool: Any, folder: Path) -> None:
    (folder / "src/tests.st").write_text("TEST 'one'\nASSERT_EQ(1, 1);\nEND_TEST\n")
    words = ("export", str(folder / "src"), "-o", str(folder / "p.xml"))
    assert "tests.st:1:1: warning: PLCopen XML has no place for unit tests" in tool(*words).err
    (left_out,) = tool(*words, "--json").json["left_out"]
    assert (left_out["line"], left_out["severity"]) == (1, "warning")


def test_a_file_without_a_place_is_kept_as_text_with_a_warning(tool: Any, folder: Path) -> None:
    (folder / "src/space.st").write_text("NAMESPACE N\nFUNCTION F : INT F := 1; END_FUNCTION\nEND_NAMESPACE\n")
    (folder / "src/main.st").write_text("PROGRAM Main\nVAR i : INT; END_VAR\ni := N.F();\nEND_PROGRAM\n")
    done = tool("export", str(folder / "src"), "-o", str(folder / "p.xml"))
    assert done.status == 0
    assert "space.st:1:1: warning: PLCopen XML has no namespaces" in done.err
    tool("build", str(folder / "p.xml"), "-o", str(folder / "b.cdl"))
    assert "Main.i = 1\n" in tool("run", str(folder / "b.cdl"), "--get", "Main.i").out


def test_what_cannot_be_written_is_an_error_and_no_file(tool: Any, folder: Path) -> None:
    (folder / "src/bell.st").write_text("{define bell}\n// a bell: \x07\n")
    done = tool("export", str(folder / "src"), "-o", str(folder / "p.xml"))
    assert done.status == 2
    assert "bell.st:2:12: error: XML has no character 7" in done.err
    assert not (folder / "p.xml").exists()


@pytest.mark.parametrize(("name", "words"), [("src/p.xml", "source of this program itself"), ("p.st", ".xml")])
def test_names_that_would_be_trouble_are_refused(tool: Any, folder: Path, name: str, words: str) -> None:
    done = tool("export", str(folder / "src"), "-o", str(folder / name))
    assert done.status == 2
    assert words in done.err
    assert not (folder / name).exists()
