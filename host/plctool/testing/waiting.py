"""Waiting for what other processes and devices do."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

PATIENCE = 60.0
"""For what is bound to happen, seconds; machines under load, and emulated ones, are slow."""

T = TypeVar("T")


def eventually(question: Callable[[], T]) -> T:
    """Asks until the answer is true, and returns it. Raises AssertionError after PATIENCE."""
    end = time.monotonic() + PATIENCE
    while not (answer := question()):
        assert time.monotonic() < end, "did not happen in time"
        time.sleep(0.01)
    return answer
