"""`plctool fmt`: files, folders, projects, the standard input, and what it refuses."""

from __future__ import annotations

import io
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

GOOD = "PROGRAM Main\nVAR\n    a : INT;\nEND_VAR\na := a + 1;\nEND_PROGRAM\n"
BAD = "program Main\nvar a:INT; end_var\na:=a+1;\nend_program\n"
BROKEN = "PROGRAM Main\nVAR a : INT; END_VAR\na := ;\nEND_PROGRAM\n"


def test_a_file_is_formatted_in_place(tool: Any, scratch: Path) -> None:
    file = scratch / "main.st"
    file.write_text(BAD)
    file.chmod(0o640)
    done = tool("fmt", "main.st")
    assert (done.status, done.out) == (0, "main.st: formatted\n1 of 1 file formatted.\n")
    assert file.read_text() == GOOD
    assert file.stat().st_mode & 0o777 == 0o640
    assert tool("fmt", "main.st").out == "1 file formatted already.\n"


def test_check_writes_nothing_and_fails_if_a_file_is_not_formatted(tool: Any, scratch: Path) -> None:
    (scratch / "good.st").write_text(GOOD)
    assert tool("fmt", "--check", ".").status == 0
    (scratch / "main.st").write_text(BAD)
    done = tool("fmt", "--check", ".")
    assert done.status == 1
    assert done.out == "main.st: not formatted\n1 of 2 files not formatted.\n"
    assert (scratch / "main.st").read_text() == BAD


def test_diff_prints_what_would_change(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text(BAD)
    done = tool("fmt", "--diff", "main.st")
    assert done.status == 1
    assert done.out.startswith("--- main.st\n+++ main.st (formatted)\n@@ ")
    assert "-a:=a+1;\n" in done.out
    assert "+a := a + 1;\n" in done.out
    assert (scratch / "main.st").read_text() == BAD


def test_json_has_a_state_for_each_file(tool: Any, scratch: Path) -> None:
    for name, text in (("a.st", GOOD), ("b.st", BAD), ("c.st", BROKEN), ("d.TcPOU", "<x/>")):
        (scratch / name).write_text(text)
    done = tool("fmt", "--json", ".")
    assert done.status == 2
    assert done.json["changed"] == 1
    assert [f["state"] for f in done.json["files"]] == ["unchanged", "formatted", "refused", "left"]


def test_a_file_with_a_syntax_error_stays_and_others_are_formatted(tool: Any, scratch: Path) -> None:
    (scratch / "broken.st").write_text(BROKEN)
    (scratch / "main.st").write_text(BAD)
    done = tool("fmt", "broken.st", "main.st")
    assert done.status == 2
    assert done.err.startswith("plctool: broken.st:3:6: ")
    assert "not formatted" in done.err
    assert (scratch / "broken.st").read_text() == BROKEN
    assert (scratch / "main.st").read_text() == GOOD


def test_a_project_names_its_sources_and_the_length_of_lines(tool: Any, scratch: Path) -> None:
    (scratch / "src").mkdir()
    (scratch / "plc.toml").write_text('sources = ["src"]\n[format]\nline-length = 60\n')
    call = f"a := MAX({', '.join(f'argument{i}' for i in range(6))});"
    (scratch / "src/main.st").write_text(GOOD.replace("a := a + 1;", call))
    (scratch / "other.st").write_text(BAD)
    assert tool("fmt").status == 0
    text = (scratch / "src/main.st").read_text()
    assert max(map(len, text.splitlines())) <= 60
    assert (scratch / "other.st").read_text() == BAD


def test_the_length_of_lines_has_bounds(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text(GOOD)
    (scratch / "plc.toml").write_text("[format]\nline-length = 10\n")
    done = tool("fmt")
    assert done.status == 2
    assert "line-length is 10 characters; it can be 60 to 400 characters" in done.err


@pytest.fixture
def typed_in(monkeypatch: pytest.MonkeyPatch) -> Any:
    def type_in(data: bytes) -> None:
        monkeypatch.setattr("sys.stdin", SimpleNamespace(buffer=io.BytesIO(data), isatty=lambda: False))

    return type_in


def test_the_standard_input_goes_to_the_standard_output(tool: Any, typed_in: Any) -> None:
    typed_in(BAD.encode())
    assert tool("fmt", "-", "--json").json["files"][0]["formatted_text"] == GOOD
    typed_in(BAD.encode())
    assert tool("fmt", "-", "--check").status == 1
    typed_in(BROKEN.encode())
    done = tool("fmt", "-")
    assert (done.status, done.out) == (2, "")
    assert "<stdin>:3:6: " in done.err
    assert tool("fmt", "-", "main.st").status == 2


def test_a_range_formats_its_lines(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text(BAD)
    assert tool("fmt", "--lines", "3:3", "main.st").status == 0
    assert (scratch / "main.st").read_text() == BAD.replace("a:=a+1", "a := a + 1")
    for wrong in ("3", "5:3", "0:1", "x:y"):
        assert tool("fmt", "--lines", wrong, "main.st").status == 2
    (scratch / "b.st").write_text(BAD)
    assert "one file" in tool("fmt", "--lines", "1:2", "main.st", "b.st").err


@pytest.mark.parametrize(
    ("mark", "encoding"),
    [(b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"), (b"", "latin-1")],
)
def test_encoding_mark_and_line_ends_are_kept(tool: Any, scratch: Path, mark: bytes, encoding: str) -> None:
    def coded(text: str) -> bytes:
        return mark + f"// Füllstand\n{text}".replace("\n", "\r\n").encode(encoding)

    (scratch / "main.st").write_bytes(coded(BAD))
    assert tool("fmt", "main.st").status == 0
    assert (scratch / "main.st").read_bytes() == coded(GOOD)


def test_xml_is_left_as_written(tool: Any, scratch: Path) -> None:
    (scratch / "a.TcPOU").write_text("<TcPlcObject/>")
    (scratch / "b.xml").write_text("<project/>")
    done = tool("fmt", ".")
    assert done.status == 0
    assert "2 files (.TcPOU and .xml) left as written: plctool fmt formats Structured Text in files .st" in done.out


@pytest.mark.parametrize("data", [b"\0\1\2", b"\xff\xfea"])
def test_what_is_no_text_is_refused(tool: Any, scratch: Path, data: bytes) -> None:
    (scratch / "main.st").write_bytes(data)
    done = tool("fmt", "main.st")
    assert done.status == 2
    assert done.err.startswith("plctool: main.st")
    assert (scratch / "main.st").read_bytes() == data


def test_a_large_file_is_refused_at_once(tool: Any, scratch: Path) -> None:
    (scratch / "main.st").write_text("// x\n" * 4_000_000)
    done = tool("fmt", "main.st")
    assert done.status == 2
    assert "more than 2 MiB; split it" in done.err


def test_missing_files_and_empty_folders_are_named(tool: Any, scratch: Path) -> None:
    assert "nothing.st cannot be read" in tool("fmt", "nothing.st").err
    (scratch / "empty").mkdir()
    assert "empty has no sources" in tool("fmt", "empty").err


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="needs links")
def test_a_link_out_of_the_folder_is_not_followed(tool: Any, scratch: Path, tmp_path_factory: Any) -> None:
    outside = tmp_path_factory.mktemp("outside") / "main.st"
    outside.write_text(BAD)
    (scratch / "inside").mkdir()
    (scratch / "inside/main.st").symlink_to(outside)
    assert tool("fmt", "inside").status == 2
    assert outside.read_text() == BAD


@pytest.mark.parametrize("template", ["minimal", "io", "library"])
def test_new_projects_are_formatted(tool: Any, template: str) -> None:
    assert tool("new", "pump", "--template", template).status == 0
    assert tool("fmt", "--check", "pump").status == 0
