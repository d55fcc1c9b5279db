"""Waiting for what other processes and the kernel do."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

PATIENCE = 60.0  # [s]; an emulated processor is slow


def eventually(question: Callable[[], Any]) -> Any:
    """Asks until the answer is true, and returns it."""
    end = time.monotonic() + PATIENCE
    while not (answer := question()):
        assert time.monotonic() < end
        time.sleep(0.02)
    return answer
