"""`plctool cache`, and builds with and without the code that is kept."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

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
    assert "1 object and 0 syntax trees deleted" in tool("cache", "clear").out
    assert "0 objects" in tool("cache").out


def test_check_keeps_syntax_trees_and_clear_deletes_them(tool: Any, scratch: Path) -> None:
    source = scratch / "main.st"
    source.write_text(f"{source.read_text()}(* {'long ' * 300}*)\n")
    assert tool("check", "main.st").status == 0
    assert tool("cache", "--json").json["trees"] == 1
    assert "1 syntax tree deleted" in tool("cache", "clear").out
    assert tool("cache", "--json").json["trees"] == 0


def test_build_without_cache_neither_reads_nor_keeps_code(tool: Any) -> None:
    assert tool("build", "main.st", "--no-cache").status == 0
    assert tool("cache", "--json").json["objects"] == 0


def test_folder_that_others_may_write_is_not_used_and_cache_says_so(tool: Any) -> None:
    folder = Path(tool("cache", "--json").json["folder"])
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    assert tool("build", "main.st").status == 0
    assert not [*folder.iterdir()]
    assert "is not used: others may write or read it" in tool("cache").out
    assert not tool("cache", "--json").json["usable"]
