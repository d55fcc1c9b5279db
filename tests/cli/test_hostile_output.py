"""What devices and files of other authors say does not control the terminal, whatever command shows it."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import fake_device
import pytest
from fake_device import FakePlc

import plctool.cli
from plctool.cli import output
from plctool.printable import one_line, printable

PORT = ("--port", "/dev/fake")
EVIL = "\x1b[31mX\x07\n\x9b2J\u202ey\u2066\r"
SHOWN = "\\x1b[31mX\\x07\\n\\x9b2J\\u202ey\\u2066\\r"
UNSAFE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")


@pytest.fixture
def hostile(plc: FakePlc, monkeypatch: pytest.MonkeyPatch) -> FakePlc:
    """A controller, all of whose strings are such."""
    for name in ("NODE_NAME", "DEVICE_NAME", "VENDOR_NAME", "SERIAL"):
        monkeypatch.setattr(fake_device, name, EVIL if name != "SERIAL" else "\x1b[31mX\n")
    plc.log = [(1, 1000, 1, EVIL, f"{EVIL}text")]
    plc.refuse = EVIL
    plc.tasks = [([1] * 10, "\x1b[31mX\n")]
    return plc


@pytest.mark.parametrize(
    "command", ["scan", "log", "status", "tasks", "flash small.cdl", "shell \x1b[31m", "read Main.x"]
)
def test_strings_of_a_device_are_printed_as_escapes(tool: Any, image: Path, hostile: FakePlc, command: str) -> None:
    for json in ((), ("--json",)):
        done = tool(*command.split(), *PORT, *json)
        assert not UNSAFE.search(done.out + done.err), done
        assert "\\x1b" in done.out + done.err or "\\u001b" in done.out or command in ("status", "read Main.x"), done


def test_a_name_stays_in_its_line(tool: Any, hostile: FakePlc) -> None:
    done = tool("scan", *PORT)
    assert SHOWN in done.out and done.out.count("\n") == 2


def test_a_message_stays_in_its_line(tool: Any, image: Path, hostile: FakePlc) -> None:
    assert tool("flash", str(image), *PORT).err.count("\n") == 1
    assert tool("status", "--port", EVIL).err.count("\n") == 1
    assert tool("check", EVIL).err.count("\n") == 1
    assert tool(EVIL).err.count("\n") == 1


def test_files_of_other_authors_are_printed_as_escapes(tool: Any, scratch: Path) -> None:
    (scratch / "\x1b[31mname.st").write_text("PROGRAM Main\nx := 1; (* \x1b[31m \u202e *)\nEND_PROGRAM\n")
    (scratch / "plc.toml").write_text('sources = "."\nlink = "serial:\\u001b[31m"\n"\\u001b[31m" = 1\n')
    for words in (["check"], ["check", "."], ["build"], ["status"]):
        done = tool(*words)
        assert done.status != 0
        assert not UNSAFE.search(done.out + done.err), done
        assert "\\x1b[31m" in done.out + done.err


def test_lines_and_letters_stay_as_they_are() -> None:
    assert printable("a\tb\nc äöü 日本") == "a\tb\nc äöü 日本"
    assert one_line("a\tb\nc") == "a\\tb\\nc"
    assert output.shown({"a": ["x\n", ("y\t", 5, None)], "answer": "1\n2", "\n": True}) == {
        "a": ["x\\n", ["y\\t", 5, None]],
        "answer": "1\n2",
        "\\n": True,
    }


def test_all_output_of_commands_goes_through_one_function() -> None:
    """But for the demonstration, which prints its own words."""
    found = {
        f"{file.name}:{node.lineno}"
        for file in Path(plctool.cli.__file__).parent.rglob("*.py")
        if file.name != "demo.py"
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("print", "sys.stdout.write", "sys.stderr.write")
    }
    assert {place.partition(":")[0] for place in found} == {"output.py"} and len(found) == 1, found
