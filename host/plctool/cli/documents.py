"""Documents, which `--json` prints, of what several commands report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from plctool.controller_documents import Document as Document

if TYPE_CHECKING:
    from plctool.compiler.syntax.diagnostics import Diagnostic

Texts = dict[str, str]
"""Values of variables by name, as ST writes them."""


def diagnostic_document(diagnostic: Diagnostic) -> Document:
    return {name: value for name, value in vars(diagnostic).items() if name != "missing"}
