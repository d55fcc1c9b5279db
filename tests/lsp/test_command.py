"""`plctool lsp` as a command."""

from __future__ import annotations

import pytest

from plctool.cli.commands import lsp
from plctool.cli.main import main
from plctool.errors import UsageError


def test_without_pygls_the_command_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lsp, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match=r"needs pygls, lsprotocol; install it with: pip install 'plctool\[lsp\]'"):
        lsp.run_lsp(lsp.argparse.Namespace())


def test_the_command_is_in_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["lsp", "--help"])
    assert "--stdio" in capsys.readouterr().out
