"""What docs/porting.md says that its commands print is what they print."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest
from conftest import MACHINE, ROOT

GUIDE = ROOT / "docs" / "porting.md"
BLOCK = re.compile(r"^```console\n(.*?)^```", re.MULTILINE | re.DOTALL)
CHECKED = ("grep ", "tests/target/run-qemu ")  # the others need a board, another folder, or are what runs this test
BUILD = Path(os.environ["FIRMWARE_DIR"]).parents[2]

if MACHINE != "mps2-an385":
    pytest.skip("the guide shows the Cortex-M3", allow_module_level=True)


def examples() -> list[tuple[str, str]]:
    """Commands of the guide that can be tried here, and what they are said to print."""
    blocks = (block.partition("\n") for block in BLOCK.findall(GUIDE.read_text()))
    return [(command.removeprefix("$ "), said) for command, _, said in blocks if command[2:].startswith(CHECKED)]


def test_the_guide_has_commands_to_try() -> None:
    assert len(examples()) >= 5


@pytest.mark.parametrize(("command", "said"), examples())
def test_command_prints_what_the_guide_says(command: str, said: str) -> None:
    done = subprocess.run(
        command.replace("build-cm3", str(BUILD)),
        shell=True,
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.stdout + done.stderr == said
