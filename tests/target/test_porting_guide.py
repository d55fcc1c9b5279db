"""docs/porting.md and docs/porting-family.md as a vendor follows them: every command is typed, in order, in a copy of
the repository.

What is printed has to be what the guide says, up to numbers, spaces and lines that it leaves out (`...`); of the
commands in EXACT every character. A board started by the guide runs in the background, and the line it prints takes
the place of the one in the text.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from environment import FIRMWARE, MACHINE, ROOT

from plctool.testing.children import ends_with_us

# By the machine that it shows.
GUIDES = {"mps2-an385": "porting.md", "virt": "porting-family.md"}
BLOCK = re.compile(r"^```console\n(.*?)^```", re.MULTILINE | re.DOTALL)
EXACT = ("grep ", "(cd ", "tests/target/run-qemu ")
# What runs this test or has tests of its own.
ELSEWHERE = ("make ", ".venv/bin/meson test", ".venv/bin/python tests/target/overhead.py")
SHOWN_PORT = "/dev/pts/4"
CRC = r"[0-9A-F]{8}"
COPIED = ("bench", "cross", "docs", "examples", "firmware", "host", "tests", "meson.build", "meson.options")

if MACHINE not in GUIDES:
    pytest.skip("the guides show other machines", allow_module_level=True)
GUIDE = ROOT / "docs" / GUIDES[MACHINE]


@dataclass(frozen=True)
class Step:
    """A command and what it is said to print."""

    command: str
    said: str

    @property
    def pattern(self) -> str:
        """Of what it may print."""
        if self.command.startswith(EXACT) and "..." not in self.said:
            return re.escape(self.said)
        lines = (
            r"(?:.*\n)*?" if line == "..." else rf"{_loosely(line)}\s*\n" for line in self.said.rstrip().splitlines()
        )
        return r"\s*" + "".join(lines) + r"\s*"


def _loosely(line: str) -> str:
    return r"\s*" + r"\s+".join(_any_number(word) for word in line.split())


def _any_number(word: str) -> str:
    """Also a CRC, which is that of what the compiler makes of the program."""
    return CRC if re.fullmatch(CRC, word) else re.sub(r"\d+(\\\.\d+)*", r"[0-9.]+", re.escape(word))


def steps() -> Iterator[Step]:
    """The commands of the guide in their order."""
    for block in BLOCK.findall(GUIDE.read_text()):
        for command, said in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", block, re.MULTILINE):
            yield Step(command, said)


class Vendor:
    """Types what the guide says, as a user would, in a copy of the repository."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        self.board: subprocess.Popen[str] | None = None
        self.port = SHOWN_PORT
        for name in COPIED:
            source = ROOT / name
            copy = shutil.copytree if source.is_dir() else shutil.copy
            copy(source, folder / name)
        tools = folder / ".venv/bin"
        tools.mkdir(parents=True)
        (tools / "meson").write_text(f'#!/bin/sh\nexec "{_beside_python("meson")}" "$@"\n')
        (tools / "plctool").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m plctool "$@"\n')
        for tool in tools.iterdir():
            tool.chmod(0o755)
        assert FIRMWARE
        (folder / FIRMWARE.parents[2].name).symlink_to(FIRMWARE.parents[2])
        self._env = os.environ | {
            "PATH": f"{tools}:{os.environ['PATH']}",
            "PYTHONUNBUFFERED": "1",  # what tools say comes in the order of a terminal
            "PYTHONPATH": os.pathsep.join(sys.path),
            "XDG_CACHE_HOME": str(folder / "cache"),
        }

    def types(self, command: str) -> str:
        """What the command prints; of one that starts a board, its first line."""
        command = command.replace(SHOWN_PORT, self.port)
        if command.startswith("tests/target/run-board"):
            return self._starts_board(command)
        done = subprocess.run(
            command, shell=True, cwd=self.folder, env=self._env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True, timeout=300, check=False,
        )  # fmt: skip
        return done.stdout

    def _starts_board(self, command: str) -> str:
        self.leaves()
        self.board = subprocess.Popen(ends_with_us(command.split()), cwd=self.folder, stdout=subprocess.PIPE, text=True)
        assert self.board.stdout
        line = self.board.stdout.readline()
        self.port = line.split()[4]
        return line

    def leaves(self) -> None:
        """Switches the board off."""
        if self.board and self.board.stdout:
            self.board.kill()
            self.board.wait()
            self.board.stdout.close()


def _beside_python(tool: str) -> str:
    """A tool of the environment that runs this test."""
    path = Path(sys.executable).parent / tool
    return str(path if path.exists() else shutil.which(tool))


def test_the_guide_leads_to_a_running_board(tmp_path):
    vendor = Vendor(tmp_path / "plctool")
    typed = 0
    try:
        for step in steps():
            if not step.command.startswith(ELSEWHERE):
                printed = vendor.types(step.command)
                assert re.fullmatch(step.pattern, printed), f"$ {step.command}\n{printed}\n--- the guide:\n{step.said}"
                typed += 1
    finally:
        vendor.leaves()
    assert typed >= {"porting.md": 20, "porting-family.md": 10}[GUIDE.name]
