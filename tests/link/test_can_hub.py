"""The CAN bus of the tests behaves as adapters do."""

from __future__ import annotations

from contextlib import ExitStack

import serial

from plctool.testing.can_hub import CanHub

FRAMES = [b"T1F40010110%d\r" % i for i in range(3)]
PATIENCE = 60.0  # for what is bound to come [s]


def test_an_adapter_hears_what_is_sent_while_it_is_open() -> None:
    with CanHub(3) as hub, ExitStack() as stack:
        sender, hearer, witness = (stack.enter_context(serial.Serial(path, timeout=PATIENCE)) for path in hub.paths)
        witness.write(b"L\r")

        def is_sent(frame: bytes) -> None:
            sender.write(frame)
            assert witness.read_until(b"\r") == frame

        sender.write(b"O\r")
        for command, frame in zip((b"C\r", b"O\r", b"C\r"), FRAMES, strict=True):
            hearer.write(b"S6\r" + command + b"T1F400102100\r")
            for port in (sender, witness):
                assert port.read_until(b"\r") == b"T1F400102100\r"
            is_sent(frame)
        assert hearer.read_until(b"\r") == FRAMES[1]
        hearer.timeout = 0
        assert hearer.read() == b""
