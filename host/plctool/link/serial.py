"""Block transport over a serial line: any port or URL that pyserial opens."""

from __future__ import annotations

import errno
import math
import os
import re
import time
from collections import deque
from contextlib import suppress
from typing import Any

from plctool.errors import LinkError
from plctool.link import simplecom
from plctool.link.transport import BITS_PER_BYTE, DEFAULT_BAUD, NO_PLACES, TOOL_ADDRESS

_POLL = 0.01  # longest single wait for a byte [s]
_WRITE_TIMEOUT = 5.0
_ESCAPE_SHARE = 256  # one byte in so many is escaped, on average
_FAST = 60_000  # from here on packing takes longer than it saves [bytes/s]


class SerialTransport:
    """Packets in serial frames. Opening fails with a LinkError that says what to do. `paced`: whether bytes take the
    time that the baud rate says; None: not over networks and pseudo terminals."""

    def __init__(self, url: str, baud: int = DEFAULT_BAUD, paced: bool | None = None) -> None:
        self.name = url
        self.local_address = TOOL_ADDRESS
        self.max_packet = simplecom.MAX_PACKET
        self.long_packet = simplecom.LONG_PACKET
        self.packet_overhead = simplecom.FRAME_OVERHEAD
        self.point_to_point = False
        self.heard_at = -math.inf
        self.peer_words = 1
        self.places = NO_PLACES
        real = is_real_line(url) if paced is None else paced
        self.byte_rate = baud / BITS_PER_BYTE / (1 + 1 / _ESCAPE_SHARE) if real else math.inf
        self.is_slow = self.byte_rate < _FAST
        self.is_bus = False
        self._decoder = simplecom.Decoder()
        self._packets: deque[bytes] = deque()
        self._port = open_port(url, baud)

    def now(self) -> float:
        return time.monotonic()

    def fileno(self) -> int | None:
        """None for a URL that has none."""
        with suppress(AttributeError, OSError):  # io.UnsupportedOperation is an OSError
            return int(self._port.fileno())
        return None

    def send(self, *packets: bytes) -> None:
        try:
            self._port.write(b"".join(map(simplecom.encode, packets)))
        except OSError as error:
            raise self._lost(error) from error

    def receive(self, timeout: float) -> bytes | None:
        end = time.monotonic() + timeout
        while not self._packets:
            try:
                waiting = self._port.in_waiting
                if not waiting and time.monotonic() >= end:
                    return None
                data = self._port.read(waiting or 1)
            except OSError as error:
                raise self._lost(error) from error
            self._packets.extend(self._decoder.feed(data))
        return self._packets.popleft()

    def close(self) -> None:
        self._port.close()

    def _lost(self, error: OSError) -> LinkError:
        return lost_port(self.name, error)


def lost_port(name: str, error: OSError) -> LinkError:
    """The error of a line that was there."""
    return LinkError(f"The serial line {name} was lost ({error}); check the cable and try again.", "link-lost")


def is_real_line(url: str) -> bool:
    """Whether bytes take the time the baud rate says."""
    return "://" not in url and not os.path.realpath(url).startswith("/dev/pts/")


def open_port(url: str, baud: int, parity: str = "N") -> Any:
    """A port of pyserial, which may be open once, and whose reads wait for a moment. Raises LinkError."""
    import serial  # slow to import, and only needed here

    try:
        return serial.serial_for_url(
            url, baudrate=baud, parity=parity, timeout=_POLL, write_timeout=_WRITE_TIMEOUT, exclusive=True
        )
    except ValueError as error:
        raise LinkError(f"Cannot open {url}: {error}.", "open") from error
    except OSError as error:
        raise LinkError(f"Cannot open {url}: {_advice(error, url)}", "open") from error


def _advice(error: OSError, url: str) -> str:
    """What is wrong with the port and what to do about it, as the end of a sentence."""
    address = re.search(r"[\w.-]+:\d+$", url)
    if _errno(error) == errno.ENOENT and address is not None:
        return f"there is no such port; if it is an address, write --tcp {address[0]}."
    advice = {
        errno.ENOENT: "there is no such port; check the name and that the adapter is plugged in.",
        errno.EACCES: "permission denied; add yourself to the port's group (often dialout) and log in again.",
        errno.EBUSY: "another program uses it; close that one first.",
        errno.EAGAIN: "another program uses it; close that one first.",
        errno.EISDIR: "it is not a serial port; name one such as /dev/ttyS0.",
        errno.ENOTTY: "it is not a serial port; name one such as /dev/ttyS0.",
    }
    return advice.get(_errno(error), f"{error}.")


def _errno(error: OSError) -> int:
    """The number of what went wrong. When a port cannot be set up, pyserial has it only in the cause of its error."""
    cause = error.__context__
    return error.errno or (cause.args[0] if cause and cause.args and isinstance(cause.args[0], int) else 0)
