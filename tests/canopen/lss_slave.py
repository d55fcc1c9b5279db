"""A device that speaks LSS (CiA 305)."""

from __future__ import annotations

from collections.abc import Callable

import can

REPLY, REQUEST = 0x7E4, 0x7E5
Identity = tuple[int, int, int, int]  # vendor, product, revision, serial


class LssDevice:
    """Replies by `send` to the requests that `take` is given."""

    def __init__(
        self, send: Callable[[can.Message], None], identity: Identity, node: int = 0xFF, *, refuses: int = 0
    ) -> None:
        self._send, self.identity, self.node, self.refuses = send, identity, node, refuses
        self.bit_rate: int | None = None
        self.stored = False
        self._position, self._selected, self._matches = 0, False, 0

    def _reply(self, *data: int) -> None:
        frame = bytes(data).ljust(8, b"\0")
        self._send(can.Message(arbitration_id=REPLY, is_extended_id=False, data=frame))

    def take(self, message: can.Message) -> None:
        if message.arbitration_id != REQUEST or len(message.data) != 8:
            return
        data = bytes(message.data)
        command, number = data[0], int.from_bytes(data[1:5], "little")
        if command == 0x04:
            self._selected = data[1] == 1
        elif command == 0x51:
            self._fast_scan(number, data[5], data[6], data[7])
        elif 0x40 <= command <= 0x43:
            self._select(command - 0x40, number)
        elif self._selected:
            self._configure(command, data)

    def _select(self, part: int, number: int) -> None:
        self._matches = (self._matches if part else 0) + (number == self.identity[part])
        if part == 3 and self._matches == 4:
            self._selected = True
            self._reply(0x44)

    def _configure(self, command: int, data: bytes) -> None:
        if command == 0x11:
            if not self.refuses:
                self.node = data[1]
            self._reply(command, self.refuses)
        elif command == 0x13:
            self.bit_rate = data[2]
            self._reply(command, 0)
        elif command == 0x17:
            self.stored = True
            self._reply(command, 0)
        elif 0x5A <= command <= 0x5D:
            self._reply(command, *self.identity[command - 0x5A].to_bytes(4, "little"))
        elif command == 0x5E:
            self._reply(command, self.node)

    def _fast_scan(self, number: int, bit: int, part: int, following: int) -> None:
        if self.node != 0xFF or self._selected:
            return
        if bit == 0x80:
            self._position = 0
            self._reply(0x4F)
        elif part == self._position and (self.identity[part] ^ number) >> bit == 0:
            self._position = following
            if bit == 0 and part == 3 and following == 0:
                self._selected = True
            self._reply(0x4F)


class LssSlave(LssDevice):
    """A device on a virtual bus, in a thread of python-can."""

    def __init__(self, channel: str, identity: Identity, node: int = 0xFF, *, refuses: int = 0) -> None:
        self._bus = can.Bus(interface="virtual", channel=channel)
        super().__init__(self._bus.send, identity, node, refuses=refuses)
        self._notifier = can.Notifier(self._bus, [self.take], timeout=0.05)

    def close(self) -> None:
        self._notifier.stop()
        self._bus.shutdown()
