"""`plctool debug`: a debugger in the terminal, driven by a script."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from breakpoints import FILE, PROGRAM


@pytest.fixture
def source(tmp_path: Path) -> Path:
    (tmp_path / FILE).write_text(PROGRAM)
    return tmp_path / FILE


def debug(source: Path, *commands: str, options: tuple[str, ...] = ()) -> list[str]:
    """What it prints for these commands, line by line."""
    done = subprocess.run(
        [sys.executable, "-m", "plctool", "debug", str(source), *options],
        input="\n".join(commands) + "\n",
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.splitlines()


def test_a_program_halts_steps_and_shows_its_variables(source: Path) -> None:
    lines = debug(source, "b 15 if step = 2", "c", "w", "l", "p twice * 10", "s", "n", "set sum := 9", "p sum", "i")
    assert lines[0] == f"breakpoint 1: {FILE}:15"
    assert lines[1] == f"Fast halted (breakpoint): Counter, {source}:15"
    assert lines[2].startswith("   15  n := Add(n, step);")
    assert f"* 0  Counter, {source}:15" in lines
    assert f"  1  Main, {source}:25" in lines
    assert "twice = 4" in lines
    assert "40" in lines
    assert f"Fast halted (step): Add, {source}:5" in lines
    assert lines[-2] == "9"
    assert lines[-1].startswith(f"1: {FILE}:15 if step = 2 (")


def test_each_halt_is_a_document_with_json(source: Path) -> None:
    halts = [json.loads(line) for line in debug(source, "b 4", "c", "o", options=("--json",))[1:]]
    assert [halt["calls"][0]["pou"] for halt in halts] == ["Add", "Counter"]
    assert halts[0]["reason"] == "breakpoint"


def test_an_exception_halts_in_its_line(source: Path) -> None:
    lines = debug(source, "set Main.divisor := 0", "c", "c")
    assert lines[0] == f"Fast halted (exception DIVIDEBYZERO): Main, {source}:31"
    assert lines[-1].startswith("The program stopped: DIVIDEBYZERO in task Fast")


def test_bad_commands_say_what_to_do(source: Path) -> None:
    lines = debug(
        source, "fly", "b here", "b 1000", "n", "d 7", "f 1", "c soon", "b 15 hits many", "set x", "force x", "q"
    )
    for words, line in zip(
        ["There is no command fly", "is not a line", "no code at line 1000", "The program runs", "no breakpoint 7",
         "The program runs", "is not a number of seconds", "is not a number of hits", "Write for example: set",
         "Write for example: force"],
        lines,
        strict=True,
    ):  # fmt: skip
        assert words in line
