"""Runs plctool in this process."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from done import run_here


class Tool:
    """Runs plctool with the given words."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *words: str) -> tuple[int, str]:
        """Exit status, and all that it said."""
        done = run_here(self._capsys, *words)
        return done.status, done.out + done.err


@pytest.fixture
def tool(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Tool:
    """plctool, without a gateway."""
    monkeypatch.setenv("PLCTOOL_GATEWAY", "off")
    return Tool(capsys)
