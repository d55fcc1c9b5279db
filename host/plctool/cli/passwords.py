"""Where passwords come from: a file, the environment, or the user at a terminal. Never from the arguments, which every
user of the machine can see."""

from __future__ import annotations

import os
import sys
from functools import cache
from getpass import getpass
from pathlib import Path

from plctool.device import PASSWORD_VARIABLE
from plctool.errors import UsageError
from plctool.link.passwords import AskPassword

NEW_VARIABLE = "PLC_NEW_PASSWORD"


def password_source(file: Path | None) -> AskPassword:
    """The password of a device; asked for once."""

    @cache
    def ask() -> str | None:
        if (given := _given(file, PASSWORD_VARIABLE)) is not None:
            return given
        return _prompt("Password of the device: ") if _has_terminal() else None

    return ask


def new_password(file: Path | None) -> str:
    """The one to be set. Raises UsageError if there is none."""
    if (given := _given(file, NEW_VARIABLE)) is not None:
        return given
    if not _has_terminal():
        raise UsageError(
            f"Give the new password with --new-password-file or in the environment's {NEW_VARIABLE}, or run this in a "
            "terminal; --remove removes the one there is.",
            "no-password",
        )
    password = _prompt("New password: ")
    if _prompt("The same again: ") != password:
        raise UsageError("The two are not equal; nothing has been changed.", "bad-password")
    return password


def _given(file: Path | None, variable: str) -> str | None:
    return os.environ.get(variable) or None if file is None else _first_line(file)


def _first_line(file: Path) -> str:
    try:
        lines = file.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8"
        raise UsageError(f"The password file {file} cannot be read: {reason}.", "bad-password") from None
    if not lines or not lines[0]:
        raise UsageError(f"The first line of {file} is empty; write the password there.", "bad-password")
    return lines[0]


def _has_terminal() -> bool:
    return sys.stdin is not None and sys.stdin.isatty()


def _prompt(text: str) -> str:
    """Without echo."""
    try:
        return getpass(text)
    except EOFError:
        raise UsageError("No password was given.", "no-password") from None
