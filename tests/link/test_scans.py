"""Devices that answer a request for their names: all that do so in time are found."""

from __future__ import annotations

import math

import pytest
from fake_device import DEVICE_NAME, NODE_NAME, SERIAL, VENDOR_NAME, FakeDevice, FakeLine

from plctool import device
from plctool.core import lib
from plctool.errors import LinkError
from plctool.link import router
from plctool.link.connection import Connection
from plctool.link.names import Node


def test_a_scan_finds_the_device() -> None:
    (node,) = Connection(FakeLine(FakeDevice())).scan(0.5)
    assert (node.node_name, node.device_name, node.vendor_name) == (NODE_NAME, DEVICE_NAME, VENDOR_NAME)
    assert (node.serial_number, node.version, node.address_text) == (SERIAL, "1.2.3.4", "0001")
    assert node.target_id == lib.TARGET_ID_CORTEX_M3


def test_a_scan_waits_as_many_times_as_long_as_patience_says(monkeypatch: pytest.MonkeyPatch) -> None:
    def scan() -> list[Node]:
        slow = Connection(FakeLine(FakeDevice(), latency=1.0))
        monkeypatch.setattr(device, "_open_link", lambda *_: slow)
        return device.scan("serial:slow")

    with pytest.raises(LinkError, match="No device answers"):
        scan()
    monkeypatch.setenv("PLCTOOL_PATIENCE", "3")
    assert [node.node_name for node in scan()] == [NODE_NAME]


def test_a_reply_that_arrived_while_the_tool_had_to_wait_is_found() -> None:
    class Stalled(FakeLine):
        """For a process that gets no time for a minute, right after it has looked."""

        def receive(self, timeout: float) -> bytes | None:
            if timeout > 0:
                self._advance(self.now() + 60)
                return None
            return super().receive(timeout)

    assert [node.node_name for node in Connection(Stalled(FakeDevice())).scan(0.5)] == [NODE_NAME]


@pytest.mark.parametrize(("byte_rate", "sizes"), [(math.inf, [8, 256, 256]), (11520.0, [8, 8, 8])])
def test_a_request_on_a_network_is_as_long_as_the_reply_when_it_is_repeated(
    monkeypatch: pytest.MonkeyPatch, byte_rate: float, sizes: list[int]
) -> None:
    """A device that many requests arrive at does not reply to short ones."""
    line = FakeLine(FakeDevice())
    line.byte_rate = byte_rate
    sent: list[bytes] = []
    monkeypatch.setattr(line, "send", lambda *packets: sent.extend(packets))
    assert Connection(line).scan(1.0) == []
    assert [len(packet.payload) for data in sent if (packet := router.decode(data))] == sizes
