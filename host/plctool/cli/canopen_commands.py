"""What `plctool canopen` does: each action reads its arguments, has the document made, and shows it."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from plctool.cli import canopen_documents

Show = Callable[..., int]
"""Prints a document or its text, as `main._show` does."""
EXIT_USAGE = 2


def _check(args: argparse.Namespace, show: Show) -> int:
    document, texts = canopen_documents.check(args.eds)
    show(document, lambda d: "\n".join([*texts, canopen_documents.check_text(d)]), colours=True)
    return EXIT_USAGE if any(d["severity"] == "error" for d in document["diagnostics"]) else 0


CANOPEN_ACTIONS: dict[str, Callable[[argparse.Namespace, Show], int]] = {"check": _check}
