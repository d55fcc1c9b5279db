"""`plctool lsp`: the language server, which editors start."""

from __future__ import annotations

import argparse
from importlib.util import find_spec

from plctool.cli.output import EXIT_OK
from plctool.cli.parser import Parser
from plctool.errors import UsageError


def lsp_arguments(command: Parser) -> None:
    command.add_argument("--stdio", action="store_true", help="use the standard input and output, as always")
    command.set_defaults(action=run_lsp)


def run_lsp(args: argparse.Namespace) -> int:
    """Serves until the editor ends. Raises UsageError if pygls is not installed."""
    missing = [name for name in ("pygls", "lsprotocol") if find_spec(name) is None]
    if missing:
        raise UsageError(
            f"The language server needs {', '.join(missing)}; install it with: pip install 'plctool[lsp]'",
            "not-installed",
        )
    from plctool.lsp.server import serve

    serve()
    return EXIT_OK
