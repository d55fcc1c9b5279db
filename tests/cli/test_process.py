"""The process of a command, before and around what the command does."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

C_LOCALE = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
INTERRUPTED = """
import runpy
import sys

class Finder:
    def find_spec(self, name, path, target=None):
        if name == "plctool.cli.main":
            raise KeyboardInterrupt

sys.meta_path.insert(0, Finder())
sys.argv = ["plctool", "--version"]
"""
STARTS = [
    "from plctool.__main__ import run; sys.exit(run())",  # as the console script does
    "runpy.run_module('plctool', run_name='__main__')",
]


@pytest.mark.parametrize("start", STARTS)
def test_ctrl_c_while_modules_are_imported_exits_130_without_a_word(start: str) -> None:
    done = subprocess.run([sys.executable, "-c", INTERRUPTED + start], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


@pytest.mark.parametrize(
    ("value", "status", "out", "err"),
    [
        (b'"\xc3\xa4"', 0, b'Main.ws = "\\xe4"\n', b""),
        (b'"\xe4"', 2, b"", b'plctool: Main.ws="\\udce4" is not UTF-8; type it in the encoding of this terminal.\n'),
    ],
)
def test_characters_that_the_locale_does_not_have(
    tool: Any, scratch: Path, value: bytes, status: int, out: bytes, err: bytes
) -> None:
    (scratch / "main.st").write_text("PROGRAM Main VAR ws : WSTRING[10]; END_VAR END_PROGRAM")
    assert tool("build", "main.st").status == 0
    words = [b"run", b"app.cdl", b"--set", b"Main.ws=" + value, b"--get", b"Main.ws"]
    command = [os.fsencode(sys.executable), b"-m", b"plctool", *words]
    done = subprocess.run(command, check=False, capture_output=True, env=os.environ | C_LOCALE)
    assert (done.returncode, done.stderr) == (status, err)
    assert done.stdout.startswith(out)
