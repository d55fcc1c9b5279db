"""Files that hold programs but no text: what to do instead.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import codecs
import re
from pathlib import Path

from plctool.compiler.base.source import Finding
from plctool.compiler.syntax.plain_text import plain_text

_CODESYS_3 = "open it in CODESYS and export the units with Project, Export PLCopenXML"
_CODESYS_2 = "open it in CODESYS 2.3 and export it with Project, Export, into one .EXP file"
_SOURCES = "give the sources of the library, or declare what the program uses of it"
_ARCHIVE = "unpack it, and give the folder of the PLC project in it"

WHAT_TO_DO = {
    ".project": _CODESYS_3,
    ".projectarchive": _CODESYS_3,
    ".export": _CODESYS_3,
    ".library": f"{_CODESYS_3}; or {_SOURCES}",
    ".compiled-library": _SOURCES,
    ".compiled-library-v3": _SOURCES,
    ".pro": _CODESYS_2,
    ".lib": f"{_CODESYS_2}; or {_SOURCES}",
    ".tnzip": _ARCHIVE,
    ".tpzip": _ARCHIVE,
    ".tszip": _ARCHIVE,
    ".zap13": "export the blocks from TIA Portal as .scl, and write them as Structured Text",
}
"""By suffix in lower case."""

_SIEMENS = re.compile(
    r"^[ \t]*(?:(?:FUNCTION(?:_BLOCK)?|TYPE)[ \t]+\"|(?:ORGANIZATION|DATA)_BLOCK[ \t]+[\"\w])",
    re.IGNORECASE | re.MULTILINE,
)
_SIEMENS_ADVICE = (
    "this is SCL of Siemens; write names without # and quotes, leave out VERSION, BEGIN and REGION, "
    "and make VAR_GLOBAL of DATA_BLOCK, PROGRAM of ORGANIZATION_BLOCK"
)

_SEEN = 4096  # bytes that are looked at for what no text has


def refusal(path: Path, data: bytes) -> str:
    """What to say of a file that is no text; "" for a text."""
    known = WHAT_TO_DO.get(path.suffix.lower())
    if known is not None:
        return f"this is not source text; {known}"
    if b"\0" in data[:_SEEN] and not data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "this is a binary file, no program text; export the program as text or PLCopen XML"
    return ""


def refused_text(text: str) -> Finding | None:
    """What to say of a text that is a language of its own, once rather than of each of its lines; None for others."""
    found = _SIEMENS.search(text) and _SIEMENS.search(plain_text(text, strings=True))
    if not found:
        return None
    at = found.end() - len(found.group().lstrip())
    line = text.count("\n", 0, at) + 1
    return Finding(line, at - text.rfind("\n", 0, at), "language", _SIEMENS_ADVICE)
