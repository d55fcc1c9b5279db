"""Documents, which `--json` prints, of what several commands report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from plctool.controller_documents import Document as Document

if TYPE_CHECKING:
    from plctool.compiler.syntax.diagnostics import Diagnostic

Texts = dict[str, str]
"""Values of variables by name, as ST writes them."""


def diagnostic_document(diagnostic: Diagnostic) -> Document:
    """The fields of a diagnostic; `element` is there if it is about a diagram."""
    left_out = {"missing"} if diagnostic.element else {"missing", "element"}
    return {name: value for name, value in vars(diagnostic).items() if name not in left_out}
