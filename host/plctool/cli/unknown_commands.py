"""What to say of a first word that is not a command."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path

from plctool.errors import UsageError, did_you_mean
from plctool.project import IMAGE_SUFFIX

_LATER = {
    "online": "flash replaces the program, and keeps RETAIN variables",
}
_OTHER_NAMES = {
    "compile": "build", "make": "build", "simulate": "run", "download": "flash", "monitor": "watch",
    "upload": "flash, or source get", "init": "new", "format": "fmt", "create": "new",
}  # fmt: skip
"""What commands are called elsewhere."""


def check_command(word: str, commands: Mapping[str, object]) -> None:
    """Raises UsageError for a word that is not a command, with what its user seems to mean."""
    if word in _LATER:
        raise UsageError(f"'{word}' is not in this version of plctool; {_LATER[word]}.", "not-yet")
    if word not in commands:
        meant = _meant(word, commands)
        raise UsageError(f"'{word}' is not a command{meant}{'' if meant.endswith('?') else '.'}", "usage")


def _meant(word: str, commands: Mapping[str, object]) -> str:
    if word == "help":
        return "; write plctool --help"
    if word in _OTHER_NAMES:
        return f"; did you mean {_OTHER_NAMES[word]}?"
    if Path(word).suffix.lower() == IMAGE_SUFFIX:
        return f"; did you mean plctool run {shlex.quote(word)}?"
    if _is_source(word):
        return f"; did you mean plctool build {shlex.quote(word)}?"
    return did_you_mean(word, commands) or "; 'plctool --help' lists the commands"


def _is_source(word: str) -> bool:
    from plctool.compiler.sources.source_files import READERS

    return Path(word).suffix.lower() in READERS
