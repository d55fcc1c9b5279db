"""A simulator whose virtual time follows the clock of this machine."""

from __future__ import annotations

import time

from plctool.controller import Controller
from plctool.sim import Simulator

STEP = 0.01  # between two steps [s]
_MOST = 0.2  # that is caught up at once [s]: a machine that slept, or a program that is slower than its tasks


class RealTime:
    """Called again and again, lets as much virtual time pass as the clock has. Returns when to call next [s]."""

    def __init__(self) -> None:
        self._last = time.monotonic()

    def __call__(self, plc: Controller) -> float:
        assert isinstance(plc, Simulator)
        now = time.monotonic()
        passed, self._last = min(now - self._last, _MOST), now
        plc.run_for(1000 * passed, check=False)
        return STEP
