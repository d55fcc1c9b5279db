"""The process of a command, before and around what the command does."""

from __future__ import annotations

import subprocess
import sys

import pytest

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
