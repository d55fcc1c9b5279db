"""What a device reports about its stack when the application stopped."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from plctool.core import lib


@dataclass(frozen=True)
class Trace:
    """What the stack had when the application stopped. `words`: by distance from the stack pointer in bytes, the code
    offsets to which calls may return. `link`: the same of the link register of processors that have one."""

    words: dict[int, int] = field(default_factory=dict)
    link: int | None = None

    @staticmethod
    def of(calls: Iterable[tuple[int, int]]) -> Trace:
        """From (target, distance) of each EXCEPT_CALL."""
        words = {distance: target for target, distance in calls}
        return Trace({d: t for d, t in words.items() if d != lib.EXCEPT_LINK}, words.get(lib.EXCEPT_LINK))
