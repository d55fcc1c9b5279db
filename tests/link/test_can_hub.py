"""The CAN bus of the tests behaves as adapters do."""

from __future__ import annotations

from contextlib import ExitStack

import serial

from plctool.testing.can_hub import CanHub
from plctool.testing.waiting import eventually

UNHEARD, OWN, HEARD, CLOSED, AGAIN = (b"T1F40010110%d\r" % i for i in range(5))
PATIENCE = 60.0  # for what is bound to come [s]


def test_an_adapter_carries_frames_while_it_is_open() -> None:
    with CanHub(2) as hub, ExitStack() as stack:
        other, adapter = (stack.enter_context(serial.Serial(path, timeout=PATIENCE)) for path in hub.paths)
        other.write(b"S6\rO\r" + UNHEARD)
        eventually(lambda: hub.frames == 1)
        adapter.write(b"S6\rO\r" + OWN)
        eventually(lambda: hub.frames == 2)
        other.write(HEARD)
        eventually(lambda: hub.frames == 3)
        adapter.write(b"C\r" + CLOSED + b"L\r" + AGAIN)
        assert [other.read_until(b"\r") for _ in range(2)] == [OWN, AGAIN]
        assert adapter.read_until(b"\r") == HEARD
        other.timeout = adapter.timeout = 0
        assert (other.read(), adapter.read()) == (b"", b"")
