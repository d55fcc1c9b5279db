"""The breakpoints that an editor wants, which are set in each program that is debugged."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from plctool.dap.messages import Message
from plctool.debug.breakpoints import Debugger, Halt
from plctool.errors import PlcError, UsageError

_HITS = re.compile(r"\s*(>=|>|=|==)?\s*(\d{1,9})\s*")
_LATER = "It is set when a test runs a program that has this line."

Install = Callable[[Debugger], tuple[int, Message]]
"""Sets a breakpoint, and returns its number and what the editor gets to see of it."""


def hits_of(text: str) -> int:
    """From the hit on that a hit condition says. Raises UsageError."""
    if not text:
        return 1
    match = _HITS.fullmatch(text)
    if match is None or match[1] in ("=", "=="):
        raise UsageError(f"'{text}' is not a number of hits; write for example 5, or > 5.", "hits")
    return int(match[2]) + (match[1] == ">")


@dataclass
class Wanted:
    """A breakpoint of the editor, by its number there; `line`: as the editor counts. `numbers`: what it is in each
    program."""

    id: int
    line: Any
    install: Install
    numbers: dict[Debugger, int] = field(default_factory=dict)

    def install_in(self, debugger: Debugger | None) -> Message:
        """Returns what the editor shows. None: there is no program yet."""
        shown: Message = {"id": self.id, "verified": False}
        if self.line is not None:
            shown["line"] = self.line
        if debugger is None:
            return shown | {"message": _LATER}
        try:
            number, found = self.install(debugger)
        except PlcError as error:
            return shown | {"message": str(error)}
        self.numbers[debugger] = number
        return shown | {"verified": True} | found


class WantedBreakpoints:
    """All of them, by the file they are in, or by what else they belong to."""

    def __init__(self) -> None:
        self._groups: dict[str, list[Wanted]] = {}
        self._last = 0

    def replace(self, group: str, installs: list[tuple[Any, Install]], debugger: Debugger | None) -> list[Message]:
        """Those of a group from now on."""
        for old in self._groups.pop(group, []):
            for other, number in old.numbers.items():
                with suppress(PlcError):
                    other.clear(number)
        added = self._groups.setdefault(group, [])
        for line, install in installs:
            self._last += 1
            added.append(Wanted(self._last, line, install))
        return [wanted.install_in(debugger) for wanted in added]

    def install(self, debugger: Debugger) -> list[Message]:
        """Sets all in a program that has just begun; returns what has changed for the editor."""
        return [wanted.install_in(debugger) for group in self._groups.values() for wanted in group]

    def forget(self, debugger: Debugger) -> None:
        """A program has ended."""
        for group in self._groups.values():
            for wanted in group:
                wanted.numbers.pop(debugger, None)

    def ids(self, debugger: Debugger, halt: Halt) -> list[int]:
        """Those that a program halted at."""
        numbers = {b.number for b in halt.breakpoints} | {c.breakpoint.number for c in halt.changed}
        every = (wanted for group in self._groups.values() for wanted in group)
        return [wanted.id for wanted in every if wanted.numbers.get(debugger) in numbers]
