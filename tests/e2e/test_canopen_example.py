"""The packing line of examples/canopen: every command of its README, and what the line does on a bus of two PLCs."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from plctool import connect
from plctool.testing.children import ends_with_us
from plctool.testing.plcrt import find_plcrt
from plctool.testing.waiting import eventually

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples/canopen"
BLOCKS = re.findall(r"^```(?:sh)?\n(plctool|python)(.*?)^```", (EXAMPLE / "README.md").read_text(), re.M | re.S)
SIMULATED, STARTED, TYPED = ((first + rest).splitlines() for first, rest in BLOCKS)
FIRST_SHOWN = 5  # the number of the first terminal in the README


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where a reader types the commands."""
    shutil.copytree(EXAMPLE, tmp_path / "examples/canopen", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def words_of(line: str, paths: list[str]) -> list[str]:
    """A command of the README, with the terminals that there are here."""
    found = re.sub(r"/dev/pts/(\d+)", lambda match: paths[int(match[1]) - FIRST_SHOWN], line)
    name, *words = shlex.split(found)
    programs = {"plctool": [sys.executable, "-m", "plctool"], "python": [sys.executable], "plcrt": [find_plcrt()]}
    return [*map(str, programs[name]), *words]


def type_in(folder: Path, line: str, paths: list[str]) -> str:
    done = subprocess.run(
        words_of(line, paths), cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=180,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    return done.stdout


@contextmanager
def going_on(folder: Path, line: str, paths: list[str], lines: int) -> Iterator[list[str]]:
    """A command that goes on; the first lines that it prints."""
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(
        ends_with_us(words_of(line, paths)), cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env=environment,
    )  # fmt: skip
    assert process.stdout
    try:
        yield [process.stdout.readline().strip() for _ in range(lines)]
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60)


def test_readme_in_the_simulator(folder: Path) -> None:
    said = [type_in(folder, line, []) for line in SIMULATED]
    count = re.search(r"Line.count = (\d+)", said[2])
    assert count is not None
    assert int(count[1]) > 10
    assert "Line.running = TRUE" in said[2]
    assert (folder / "panel.eds").read_bytes() == (EXAMPLE / "panel.eds").read_bytes()


def test_readme_on_a_bus(folder: Path) -> None:
    for line in (SIMULATED[0], SIMULATED[3]):
        type_in(folder, line, [])
    with ExitStack() as stack:
        paths = stack.enter_context(going_on(folder, STARTED[0], [], 5))
        for line in STARTED[1:]:
            stack.enter_context(going_on(folder, line, paths, int(line.startswith("python"))))
        flash_line, flash_panel, press, status, scan = TYPED
        type_in(folder, flash_line, paths)
        type_in(folder, flash_panel, paths)
        with connect(f"can:slcan:{paths[3]}?node=1", folder / "line.sym") as plc:
            for device in ("Drive1", "Drive2", "Valves", "Panel"):
                eventually(lambda device=device: plc.read(f"{device}.ok"))
        type_in(folder, press, paths)
        with connect(f"can:slcan:{paths[3]}?node=1", folder / "line.sym") as plc:
            eventually(lambda: plc.read("Line.count") >= 2)
        assert "Drive1" in type_in(folder, status, paths)
        assert "Panel" in type_in(folder, scan, paths)
