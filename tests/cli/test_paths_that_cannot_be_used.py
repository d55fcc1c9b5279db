"""A path that the system refuses is wrong use, said in one sentence, and no internal error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

MAIN = "PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM\nTEST 'a' ASSERT_TRUE(TRUE); END_TEST\n"
LONG = "a" * 300
DEEP = "/".join(["b" * 200] * 30)  # each name is short enough, all of it is not
COMMANDS = [
    "build main.st -o PATH", "build PATH", "check PATH", "test PATH", "test main.st --junit PATH",
    "check main.st --io PATH", "check main.st --device PATH", "check main.st --library PATH", "info PATH", "run PATH",
    "run app.cdl --trace Main.n -o PATH", "run app.cdl --plant PATH", "symbols PATH", "bench PATH", "export-itf PATH",
    "export-itf main.st -o PATH", "export-itf --device PATH", "io map PATH", "io init PATH",
    "io init x.io.toml --device PATH", "new PATH", "image app.cdl --board plcrt -o PATH",
    "image app.cdl -o x.bin --firmware PATH", "flash --port /dev/null PATH",
    "read Main.n --tcp localhost:1 --symbols PATH",
]  # fmt: skip


@pytest.fixture
def program(tool: Any, scratch: Path) -> Path:
    (scratch / "main.st").write_text(MAIN)
    assert tool("build", "main.st").status == 0
    (scratch / "circle").symlink_to("circle")
    return scratch


@pytest.mark.parametrize("path", [LONG, f"{LONG}.st", DEEP, "nul\0.st"])
@pytest.mark.parametrize("command", COMMANDS)
def test_path_that_no_file_can_have_is_refused(tool: Any, program: Path, command: str, path: str) -> None:
    before = sorted(program.rglob("*"))
    done = tool(*(path if word == "PATH" else word for word in command.split()))
    assert done.status == 2, done.err
    assert "cannot be the path of a file" in done.err
    assert "\0" not in done.err and len(done.err) < 400
    assert sorted(program.rglob("*")) == before


@pytest.mark.parametrize("path", ["circle", "main.st/x", "main.st/x.st", f"x/{LONG}.bin"])
@pytest.mark.parametrize("command", COMMANDS)
def test_path_through_what_is_no_folder_is_no_internal_error(tool: Any, program: Path, command: str, path: str) -> None:
    done = tool(*(path if word == "PATH" else word for word in command.split()))
    assert done.status != 1 and "Internal" not in done.err
    assert done.err.count("\n") == (done.status != 0)


@pytest.mark.parametrize("command", [c for c in COMMANDS if "flash" not in c and "tcp" not in c])
def test_folder_in_place_of_a_file_is_no_internal_error(tool: Any, program: Path, command: str) -> None:
    (program / "folder").mkdir()
    done = tool(*("folder" if word == "PATH" else word for word in command.split()))
    assert done.status in (0, 2) and "Internal" not in done.err


def test_name_that_is_too_long_with_its_suffix_is_refused(tool: Any, program: Path) -> None:
    done = tool("build", "main.st", "-o", "a" * 250 + ".c")
    assert done.status == 2 and "File name too long" in done.err


@pytest.mark.parametrize("key", ["output", "device", "io", "sources", "libraries"])
def test_path_in_a_project_that_is_too_long_is_refused(tool: Any, program: Path, key: str) -> None:
    value = f'["{LONG}"]' if key in ("sources", "libraries") else f'"{LONG}"'
    (program / "plc.toml").write_text(f"{key} = {value}\n")
    for command in ("check", "build"):
        done = tool(command)
        assert done.status == 2 and "plc.toml:1:" in done.err and "Internal" not in done.err


def test_device_file_of_a_description_with_a_name_that_is_too_long_has_a_line(tool: Any, program: Path) -> None:
    for name in (LONG, DEEP, "nul\\u0000"):
        (program / "main.io.toml").write_text(f'device = "{name}"\n')
        done = tool("check", "main.st")
        assert done.status == 2
        assert "main.io.toml:1:" in done.out and "there is no file" in done.out


def test_file_that_may_not_be_looked_at_is_named(tool: Any, program: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path) -> bool:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "is_file", refuse)
    done = tool("check", "main.st")
    assert (done.status, done.err) == (2, "plctool: main.st/plc.toml cannot be used: Permission denied.\n")
    assert tool("check", "main.st", "--json").json["error"]["code"] == "path"
