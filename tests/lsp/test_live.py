"""Hover shows the value of a variable in the controller that the settings name."""

from __future__ import annotations

from pathlib import Path

import pytest
from editor import Editor

from plctool.compiler import compile_sources
from plctool.debug.symbols import cache_path
from plctool.device import connect
from plctool.testing.plcrt import Plcrt

MAIN = "PROGRAM Main\nVAR\n    n : INT := 42;\nEND_VAR\nIF n < 0 THEN\n    n := 1;\nEND_IF;\nEND_PROGRAM\n"


def hover(editor: Editor) -> str:
    """Returns what is shown for the variable."""
    editor.open("main.st")
    return str(editor.at("hover", "main.st", "IF ", "n < 0")["contents"]["value"])


def test_hover_shows_the_value_in_the_controller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "program"
    folder.mkdir()
    (folder / "main.st").write_text(MAIN)
    built = compile_sources([folder / "main.st"])
    cache_path(built.crc).parent.mkdir(parents=True, exist_ok=True)
    built.symbols.save(cache_path(built.crc))
    with Plcrt(tmp_path / "flash.bin", "--tcp", "0") as runtime:
        link = f"tcp:{runtime.tcp}"
        with connect(link) as plc:
            plc.flash(built.image)
        with Editor(folder, settings={"link": link}) as editor:
            shown = ""
            for _ in range(100):  # the first one may only connect, on a busy machine
                shown = hover(editor)
                if "Main.n = " in shown:
                    break
            assert "`Main.n = 42`" in shown


def test_hover_says_why_there_is_no_value(tmp_path: Path) -> None:
    (tmp_path / "main.st").write_text(MAIN)
    with Editor(tmp_path, settings={"link": "serial:/dev/no-such-port"}) as editor:
        shown = ""
        for _ in range(100):
            shown = hover(editor)
            if "no-such-port:" in shown:
                break
        assert "serial:/dev/no-such-port: " in shown and "n : INT := 42;" in shown
