"""A process that is not ours on CanHub, which knows only the lines that docs/canopen.md documents."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from plctool.testing.children import ends_with_us
from plctool.testing.waiting import eventually

NODE = 30


@pytest.fixture
def adapters() -> Iterator[list[str]]:
    """Those of a hub in a process of its own."""
    command = [sys.executable, "-m", "plctool.testing.can_hub", "3"]
    process = subprocess.Popen(ends_with_us(command), stdout=subprocess.PIPE, text=True)
    assert process.stdout
    yield [process.stdout.readline().strip() for _ in range(3)]
    process.terminate()
    assert process.wait(60) == 0


def test_foreign_process_is_a_node(adapters: list[str], tmp_path: Path, tool: Any) -> None:
    compiler = shutil.which("cc")
    assert compiler, "this test needs a C compiler: install gcc or clang"
    program = tmp_path / "node"
    source = Path(__file__).parent / "foreign/node.c"
    subprocess.run([compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-o", program, source], check=True)
    foreign = subprocess.Popen(ends_with_us([str(program), adapters[0], str(NODE)]))
    link = ("--can", f"slcan:{adapters[1]}")

    def read() -> int:
        return int(tool("canopen", "sdo", "read", str(NODE), "1000", "--type", "U32", "--json", *link).status)

    try:
        eventually(lambda: read() == 0)
        done = tool("canopen", "sdo", "read", str(NODE), "1000", "--type", "U32", "--json", *link)
        assert json.loads(done.out)["value"] == 0x00020192
        refused = tool("canopen", "sdo", "read", str(NODE), "1001", "--type", "U8", *link)
        assert (refused.status, "no such object" in refused.err or "06020000" in refused.err) == (1, True), refused.err
    finally:
        foreign.kill()
        foreign.wait()


@pytest.mark.parametrize("words", [(), ("1",), ("1000",), ("x",)])
def test_command_refuses_other_numbers_of_adapters(words: tuple[str, ...]) -> None:
    command = [sys.executable, "-m", "plctool.testing.can_hub", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 1
    assert "usage: python -m plctool.testing.can_hub COUNT, from 2 to 128 adapters" in done.stderr
