"""Reads source files: Structured Text in any usual encoding, and the XML that TwinCAT 3 keeps it in.

SPDX-License-Identifier: Apache-2.0
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator
from pathlib import Path

from plctool.compiler.source import Source
from plctool.compiler.syntax.lexer import Lexer
from plctool.errors import UsageError

SUFFIXES = frozenset((".st", ".exp", ".tcpou", ".tcgvl", ".tcdut", ".tcio"))
"""Of files that are taken from folders, in lower case: Structured Text, exports of CODESYS 2, TwinCAT 3."""

_UNITS = frozenset(("FUNCTION", "FUNCTION_BLOCK", "PROGRAM", "INTERFACE"))
_PART = re.compile(
    r"<!\[CDATA\[(?P<code>.*?)\]\]>|<(?P<tag>/?\w+)(?:[^>]*?\bName=\"(?P<name>[^\"]*)\")?[^>]*?(?P<empty>/?)>",
    re.DOTALL,
)
_OTHER_LANGUAGES = frozenset(("SFC", "NWL", "FBD", "LD", "IL", "CFC"))


def find_sources(folder: Path) -> list[Path]:
    """All source files in a folder and those below it."""
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file())


def read_source(path: Path) -> Source:
    """The text of a file. Raises OSError when it cannot be read, UsageError when it holds another language."""
    text = decode(path.read_bytes())
    return Source(str(path), structured_text(text, path) if path.suffix.lower().startswith(".tc") else text)


def decode(data: bytes) -> str:
    """The text of a file: UTF-16 with its mark, UTF-8, or else one byte per character, as older systems write it."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def structured_text(xml: str, path: Path) -> str:
    """The code in a file of TwinCAT 3, each line where it was, with the END_... that are not written there."""
    return "".join(_pieces(xml, path))


def _pieces(xml: str, path: Path) -> Iterator[str]:
    at, unit = 0, ""
    for match in _PART.finditer(xml):
        yield _blank(xml[at : match.start()])
        at = match.end()
        code, tag = match["code"], match["tag"]
        if code is not None:
            unit = unit or _unit_keyword(code)
            yield f"{_blank('<![CDATA[')}{code}{_blank(']]>')}"
            continue
        if tag in _OTHER_LANGUAGES:
            raise UsageError(f"{path} holds {tag}; only Structured Text can be compiled.", "language")
        yield f"{_blank(match[0])}{'' if match['empty'] else _keyword(tag, match['name'], unit)}"
    yield _blank(xml[at:])


def _keyword(tag: str, name: str | None, unit: str) -> str:
    """What stands for a tag in Structured Text."""
    if tag in ("/POU", "/Itf"):
        return f"END_{unit}\n"
    if tag == "Action":
        return f"ACTION {name}:"
    if tag in ("Get", "Set"):
        return tag.upper()
    return f"END_{tag[1:].upper()}" if tag in ("/Method", "/Action", "/Property", "/Get", "/Set") else ""


def _unit_keyword(declaration: str) -> str:
    """Which unit a declaration begins."""
    tokens = Lexer(declaration, lambda offset, code, message: None)
    return next((token.type for token in tokens if token.type in _UNITS), "")


def _blank(text: str) -> str:
    """As many lines, and as many characters in the last one."""
    head, newline, last = text.rpartition("\n")
    return "\n" * (head.count("\n") + len(newline)) + " " * len(last)
