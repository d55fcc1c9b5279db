"""CANopen's frames, which have 11-bit identifiers, on a bus of python-can."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import can

from plctool.errors import LinkError
from plctool.link.canbus import Bus, PythonCanBus, open_bus

NMT, SYNC, EMCY, SDO_REPLY, SDO_REQUEST, HEARTBEAT = 0x000, 0x080, 0x080, 0x580, 0x600, 0x700
LSS_REPLY, LSS_REQUEST = 0x7E4, 0x7E5
FRAME_BYTES = 8
_MAX_BACKLOG = 100_000  # frames that are dropped before a request


@dataclass(frozen=True)
class Frame:
    """A data frame with an 11-bit identifier and the time at which it was received, in seconds."""

    identifier: int
    data: bytes
    time: float


class CanopenBus:
    """A bus whose errors are LinkErrors; `name` is its place in messages."""

    def __init__(self, bus: Bus, name: str) -> None:
        self._bus, self.name = bus, name
        self._listeners: list[Callable[[Frame], None]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._bus.close()

    def now(self) -> float:
        """Seconds of a clock that only goes forward."""
        return self._bus.now()

    def listen(self, listener: Callable[[Frame], None]) -> None:
        """Calls `listener` for each frame that is received from now on, whatever it is received for."""
        self._listeners.append(listener)

    def send(self, identifier: int, data: bytes) -> None:
        """Sends a frame. Raises LinkError."""
        try:
            self._bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data))
        except (can.CanError, OSError) as error:
            raise LinkError(f"CAN {self.name} does not send: {error}. Check the adapter, the bit rate and that another "
                            "node is on.", "lost") from error  # fmt: skip

    def receive(self, timeout: float) -> Frame | None:
        """The next frame, None if none comes in time. Raises LinkError."""
        end = self.now() + timeout
        while True:
            try:
                message = self._bus.receive(max(0.0, end - self.now()))
            except (can.CanError, OSError) as error:
                raise LinkError(f"CAN {self.name} is lost: {error}.", "lost") from error
            if message is not None and not (
                message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd
            ):
                frame = Frame(message.arbitration_id, bytes(message.data), self.now())
                for listener in self._listeners:
                    listener(frame)
                return frame
            if self.now() >= end:
                return None

    def frames(self, seconds: float) -> Iterator[Frame]:
        """The frames of the next seconds."""
        end = self.now() + seconds
        while (left := end - self.now()) > 0:
            if (frame := self.receive(left)) is not None:
                yield frame

    def drain(self) -> None:
        """Drops what was received before: late replies."""
        for _ in range(_MAX_BACKLOG):
            if self.receive(0.0) is None:
                return


def open_canopen(place: str, bit_rate: int) -> CanopenBus:
    """Opens INTERFACE:CHANNEL. Raises LinkError, and UsageError for what is no interface."""
    return CanopenBus(PythonCanBus(open_bus(place, bit_rate, 0)), place)
