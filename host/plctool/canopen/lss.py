"""Layer setting services (CiA 305): finds nodes without a number, gives numbers and bit rates."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import astuple, dataclass

from plctool.canopen.bus import FRAME_BYTES, LSS_REPLY, LSS_REQUEST, CanopenBus
from plctool.errors import DeviceError, LinkError, UsageError

_SWITCH_ALL, _SET_NODE, _SET_BIT_RATE, _STORE, _FAST_SCAN = 0x04, 0x11, 0x13, 0x17, 0x51
_SELECT, _SELECTED, _FOUND, _ASK_IDENTITY, _ASK_NODE = 0x40, 0x44, 0x4F, 0x5A, 0x5E
_WAITING = 0
_BEGIN = 0x80  # of a fast scan, in place of a bit
_PARTS = 4  # numbers of an identity
BIT_RATES = (1000, 800, 500, 250, 125, 0, 50, 20, 10)  # kbit/s by their index; 5 is not used
NO_NODE = 0xFF
FAST_SCAN_TIMEOUT = 0.05  # for a reply to one question [s]
_TRIES = 5  # of a fast scan, each with twice the time
_MAX_NODES = 127

_IDENTITY = re.compile(r"\s*[:,]\s*")


@dataclass(frozen=True)
class Identity:
    """The four numbers of object 1018h, which are different for each device."""

    vendor: int
    product: int
    revision: int
    serial: int

    def __str__(self) -> str:
        return ":".join(f"0x{number:X}" for number in astuple(self))


def parse_identity(text: str) -> Identity:
    """VENDOR:PRODUCT:REVISION:SERIAL. Raises UsageError."""
    try:
        numbers = [int(part, 0) for part in _IDENTITY.split(text.strip())]
    except ValueError:
        numbers = []
    if len(numbers) != _PARTS or not all(0 <= number <= 0xFFFF_FFFF for number in numbers):
        raise UsageError(f"'{text}' is not VENDOR:PRODUCT:REVISION:SERIAL; write for example 0x319:0x1008:0x10002:7.")
    return Identity(*numbers)


class LssMaster:
    """The only LSS master of a network. `timeout`: for a reply to a setting [s]."""

    def __init__(self, bus: CanopenBus, timeout: float, fast_timeout: float = FAST_SCAN_TIMEOUT) -> None:
        self._bus, self._timeout, self._fast = bus, timeout, fast_timeout

    # ---- finding ----

    def find_all(self) -> Iterator[Identity]:
        """Each node without a number: it stays selected until `release`, and so does not take part in later scans."""
        self.release()
        for _ in range(_MAX_NODES):
            found = self._find()
            if found is None:
                return
            yield found

    def _find(self) -> Identity | None:
        """Selects one node without a number by a fast scan. Raises LinkError if replies are late again and again."""
        timeout = self._fast
        for _ in range(_TRIES):
            if not self._asks(0, _BEGIN, 0, 0, max(timeout, self._timeout)):
                return None
            found = self._scan_bits(timeout)
            if found is not None and self._is_selected(found):
                return found
            timeout *= 2
        raise LinkError(
            "The fast scan found nodes, but their replies are not consistent: they are late, or two devices have one "
            "identity. Take devices off the bus one by one.",
            "lss-scan",
        )

    def _scan_bits(self, timeout: float) -> Identity | None:
        numbers = []
        for part in range(_PARTS):
            number = 0
            for bit in reversed(range(32)):
                if not self._asks(number, bit, part, part, timeout):
                    number |= 1 << bit
            if not self._asks(number, 0, part, (part + 1) % _PARTS, timeout):
                return None
            numbers.append(number)
        return Identity(*numbers)

    def _is_selected(self, identity: Identity) -> bool:
        """True if a selected node has this identity: late replies may have changed a bit of it."""
        parts = [number.to_bytes(4, "little") for number in astuple(identity)]
        return all(self._ask(_ASK_IDENTITY + i, b"", bytes([_ASK_IDENTITY + i]) + p) for i, p in enumerate(parts))

    def _asks(self, number: int, bit: int, part: int, following: int, timeout: float) -> bool:
        """True if a node replies that the upper bits of this part of its identity are those of `number`."""
        self._bus.drain()
        self._send(_FAST_SCAN, number.to_bytes(4, "little") + bytes([bit, part, following]))
        end = self._bus.now() + timeout
        while (left := end - self._bus.now()) > 0:
            frame = self._bus.receive(left)
            if frame is not None and frame.identifier == LSS_REPLY and frame.data[:1] == bytes([_FOUND]):
                for _ in self._bus.frames(timeout / 10):  # other nodes say the same
                    pass
                return True
        return False

    # ---- settings ----

    def select(self, identity: Identity) -> None:
        """Brings one node into configuration state. Raises LinkError if it is not there."""
        self.release()
        *first, last = astuple(identity)
        for i, number in enumerate(first):
            self._send(_SELECT + i, number.to_bytes(4, "little"))
        reply = self._ask(_SELECT + 3, last.to_bytes(4, "little"), bytes([_SELECTED]))
        if reply is None:
            raise LinkError(f"No device with the identity {identity} replies to LSS.", "timeout")

    def release(self) -> None:
        """Brings all nodes back into waiting state; those with a new number boot with it."""
        self._send(_SWITCH_ALL, bytes([_WAITING]))

    def set_node(self, node: int) -> None:
        """Gives the selected node a number. Raises DeviceError if it refuses."""
        self._set(_SET_NODE, bytes([node]), f"the node number {node}")

    def set_bit_rate(self, kilobits: int) -> None:
        """Gives the selected node a bit rate, which holds after its next power-up."""
        self._set(_SET_BIT_RATE, bytes([0, BIT_RATES.index(kilobits)]), f"{kilobits} kbit/s")

    def store(self) -> None:
        """Has the selected node keep its settings."""
        self._set(_STORE, b"", "to store its settings")

    def node(self) -> int:
        """The number that the selected node has or will have, NO_NODE if none."""
        reply = self._ask(_ASK_NODE, b"", bytes([_ASK_NODE]))
        if reply is None:
            raise LinkError("The device does not reply to LSS any more.", "timeout")
        return reply[1]

    def _set(self, command: int, data: bytes, what: str) -> None:
        reply = self._ask(command, data, bytes([command]))
        if reply is None:
            raise LinkError(f"The device does not reply to LSS (setting: {what}). Check it with 'lss scan'.", "timeout")
        if reply[1]:
            detail = f"error {reply[1]}" + (f", of the manufacturer {reply[2]}" if reply[1] == 0xFF else "")
            raise DeviceError(f"The device refuses {what} ({detail}).", "lss-refused", reply[1])

    def _ask(self, command: int, data: bytes, expected: bytes) -> bytes | None:
        """The first reply that begins with `expected`, None if none comes in time."""
        self._bus.drain()
        self._send(command, data)
        for frame in self._bus.frames(self._timeout):
            is_reply = frame.identifier == LSS_REPLY and len(frame.data) == FRAME_BYTES
            if is_reply and frame.data.startswith(expected):
                return frame.data
        return None

    def _send(self, command: int, data: bytes) -> None:
        self._bus.send(LSS_REQUEST, (bytes([command]) + data).ljust(FRAME_BYTES, b"\0"))
