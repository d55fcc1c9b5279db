"""Runs plctool in this process."""

from __future__ import annotations

import pytest

from plctool.cli import main as cli


class Tool:
    """Runs plctool with the given words."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *words: str) -> tuple[int, str]:
        """Exit status, and all that it said."""
        self._capsys.readouterr()
        status = cli.main(words)
        captured = self._capsys.readouterr()
        return status, captured.out + captured.err


@pytest.fixture
def tool(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Tool:
    """plctool, without a gateway."""
    monkeypatch.setenv("PLCTOOL_GATEWAY", "off")
    return Tool(capsys)
