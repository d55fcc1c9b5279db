"""Pseudo terminals of tests: the number of one that is done with is not given out again at once.

A gateway that a tool has just started knows its terminal by the number (/dev/pts/7). If it opened that after the test,
it would hold the terminal of another test that got the number in the meantime.
"""

from __future__ import annotations

import os
from collections import deque

KEPT = 100  # more than a suite uses while one process is being started

_kept: deque[int] = deque()


def retire(terminal: int) -> None:
    """Takes over the descriptor of a terminal whose other end is closed; closes it when KEPT more have come."""
    _kept.append(terminal)
    if len(_kept) > KEPT:
        os.close(_kept.popleft())
