"""What a command of plctool leaves, and how it runs in the process of a test."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import pytest

from plctool.cli import main as cli


@dataclass
class Done:
    """Exit status and output of a command."""

    status: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """The one document on stdout."""
        return json.loads(self.out)

    @property
    def lines(self) -> list[Any]:
        """The document of each line of stdout."""
        return [json.loads(line) for line in self.out.splitlines()]


def run_here(capsys: pytest.CaptureFixture[str], *words: str) -> Done:
    """Runs `plctool WORDS` in this process."""
    capsys.readouterr()
    status = cli.main(words)
    captured = capsys.readouterr()
    return Done(status, captured.out, captured.err)
