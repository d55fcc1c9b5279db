"""Errors that are not bugs of plctool: one sentence that says what to do, a short code for machines, an exit code for
shells."""

from __future__ import annotations

import re
from collections.abc import Iterable

_AN = re.compile(r"[AEIO]|L(REAL|WORD|INT|TIME|DATE|TOD|DT)\b", re.IGNORECASE)
EXIT_INTERRUPTED = 130  # as shells say it of a process that Ctrl-C ended


class PlcError(Exception):
    """Base of all errors a user may see. `code` is a short slug; `exit_code` is the command's exit status."""

    exit_code = 1

    def __init__(self, message: str, code: str = "error") -> None:
        super().__init__(message)
        self.message = message
        self.code = code


class DeviceError(PlcError):
    """The device or the program said no. `result` is the device's ERR_* number, 0 when there is none."""

    exit_code = 1

    def __init__(self, message: str, code: str = "device", result: int = 0) -> None:
        super().__init__(message, code)
        self.result = result


class InternalError(PlcError):
    """A bug of ours. `where`: the location in the user's program that shows it, such as ` at main.st:7`, if known."""

    def __init__(self, error: Exception, where: str = "") -> None:
        what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        super().__init__(
            f"Internal error{where} ({what}); please report it, with what PLCTOOL_DEBUG=1 shows and the program.",
            "internal",
        )


class UsageError(PlcError):
    """Wrong use or bad input: a missing file, an unknown variable, a program that does not compile."""

    exit_code = 2

    def __init__(self, message: str, code: str = "usage") -> None:
        super().__init__(message, code)


class LinkError(PlcError):
    """The link could not be opened, was lost or timed out."""

    exit_code = 3

    def __init__(self, message: str, code: str = "link") -> None:
        super().__init__(message, code)


def listed(words: Iterable[str], conjunction: str = "and") -> str:
    """`a, b and c`."""
    *most, last = words
    return f"{', '.join(most)} {conjunction} {last}" if most else last


def counted(count: int, what: str) -> str:
    """`1 test`, `2 tests`."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def with_article(name: object) -> str:
    """`a BOOL`, `an INT`, `an LREAL`."""
    return f"{'an' if _AN.match(str(name)) else 'a'} {name}"


_SHORT = 4  # characters of a name that may differ in one of them only


def did_you_mean(name: str, candidates: Iterable[str]) -> str:
    """`; did you mean X?` for the candidate most like `name`, else nothing."""
    from difflib import get_close_matches

    # Of names that differ in case only the last in this order, whatever the order of the candidates.
    own = name.casefold()
    by_key = {key: c for c in sorted(candidates) if (key := c.casefold()) != own and _may_be_meant(own, key)}
    close = get_close_matches(own, list(by_key), n=1, cutoff=0.7)
    return f"; did you mean {by_key[close[0]]}?" if close else ""


def _may_be_meant(name: str, candidate: str) -> bool:
    """False if one of the names is short and they differ in more than one character or two that changed places."""
    if min(len(name), len(candidate)) > _SHORT:
        return True
    one, other = name, candidate
    while one and other and one[0] == other[0]:
        one, other = one[1:], other[1:]
    while one and other and one[-1] == other[-1]:
        one, other = one[:-1], other[:-1]
    return max(len(one), len(other)) <= 1 or (len(one) == 2 and one == other[::-1])
