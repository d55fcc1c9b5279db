"""How long an LSS scan takes, on a bus with a virtual clock."""

from __future__ import annotations

from collections import deque

import can
from lss_slave import LssDevice

from plctool.canopen.bus import CanopenBus
from plctool.canopen.lss import LssMaster

FRAME_S = 0.00025  # at 500 kbit/s
REPLY_S = 0.001  # a device needs for a reply
DEVICES, LIMIT_S = 5, 15.0


class SlowBus:
    """A bus that takes time, without waiting for it."""

    def __init__(self) -> None:
        self._now = 0.0
        self._replies: deque[tuple[float, can.Message]] = deque()
        self.devices: list[LssDevice] = []

    def now(self) -> float:
        return self._now

    def send(self, message: can.Message) -> None:
        self._now += FRAME_S
        for device in self.devices:
            device.take(message)

    def reply(self, message: can.Message) -> None:
        self._replies.append((self._now + REPLY_S + FRAME_S * (len(self._replies) + 1), message))

    def receive(self, timeout: float) -> can.Message | None:
        end = self._now + timeout
        if not self._replies or self._replies[0][0] > end:
            self._now = end
            return None
        at, message = self._replies.popleft()
        self._now = max(self._now, at)
        return message

    def fileno(self) -> int | None:
        return None

    def close(self) -> None:
        pass


def test_lss_scan_of_five_devices_takes_seconds() -> None:
    bus = SlowBus()
    identities = [(0x319, 0x1008, 0x10002, 0x1000 * serial + 1) for serial in range(DEVICES)]
    bus.devices = [LssDevice(bus.reply, identity) for identity in identities]
    found = list(LssMaster(CanopenBus(bus, "slow"), 1.0).find_all())
    assert sorted((each.vendor, each.product, each.revision, each.serial) for each in found) == identities
    assert bus.now() < LIMIT_S, bus.now()
