"""The source lines that an exception passed on its way out of a `__TRY`, as the program left them in a variable."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

TRAIL = "%trail"  # the variable: ARRAY[0..DEPTH] OF UDINT, the count and the numbers of the lines
DEPTH = 8  # lines that it has room for: the first ones and the last


class PassedLine(NamedTuple):
    """A line where an exception was raised, or the call in it that returned one."""

    pou: str
    file: str
    line: int


def passed_lines(known: Sequence[PassedLine], trail: Sequence[int]) -> list[PassedLine]:
    """The lines that the content of the variable names, first to last; none if it cannot be one."""
    count, *numbers = trail
    numbers = numbers[: min(count, DEPTH)]
    if not all(0 < number <= len(known) for number in numbers):
        return []
    return [known[number - 1] for number in numbers]
