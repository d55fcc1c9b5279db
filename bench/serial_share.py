"""What a serial line carries during a download, byte by byte, on virtual time: the figures are those of every machine.
Tool and device take no time; what counts are the bytes, and the moments at which the line is idle."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from plctool.core import lib
from plctool.device import Plc
from plctool.link import bintag, l7, simplecom
from plctool.link.connection import Connection
from plctool.link.transport import BITS_PER_BYTE, DEFAULT_BAUD
from plctool.link.wire import Layout
from plctool.testing.sim_line import SimSerial

BYTE_RATE = DEFAULT_BAUD / BITS_PER_BYTE
_ROUTER_HEADER = 12  # with both addresses
_BLOCK_HEADER = Layout("CHANNEL_DATA").size
_MESSAGE_HEADER = Layout("CHANNEL_MESSAGE").size
_FLASH = (1 << 20, 4096, 8, 0xFF)


class Meter(SimSerial):
    """Counts what is sent to the device: bytes by what they are, and requests."""

    def __init__(self, packed: bool) -> None:
        super().__init__()
        self.is_slow = packed
        self.bytes: Counter[str] = Counter()
        self.requests = 0
        self.carrying = 0  # bytes of the line for requests with parts of the image
        self._message = b""
        self._sent = 0  # bytes of the line for the request under way

    def send(self, *packets: bytes) -> None:
        super().send(*packets)
        for packet in packets:
            framing = len(simplecom.encode(packet)) - len(packet)
            self._count(packet, framing)

    def _count(self, packet: bytes, framing: int) -> None:
        self.bytes["frames"] += simplecom.FRAME_OVERHEAD
        self.bytes["escapes"] += framing - simplecom.FRAME_OVERHEAD
        self.bytes["router"] += _ROUTER_HEADER
        package = packet[_ROUTER_HEADER:]
        if packet[3] != lib.ROUTER_SVC_CHANNEL or package[0] != lib.CHANNEL_PKG_DATA:
            self.bytes["open, acknowledge"] += len(package)
            return
        first = bool(package[1] & lib.CHANNEL_FLAG_FIRST)
        head = _BLOCK_HEADER + _MESSAGE_HEADER * first
        self.bytes["channel"] += head
        self._message = (b"" if first else self._message) + package[head:]
        self._sent = (0 if first else self._sent) + len(packet) + framing
        if first:
            self.requests += 1
            self._size = int.from_bytes(package[_BLOCK_HEADER : _BLOCK_HEADER + 4], "little")
        if len(self._message) == self._size:
            data = _image_bytes(self._message)
            self.bytes["image"] += data
            self.carrying += self._sent if data else 0
            self.bytes["requests"] += self._size - data


def _image_bytes(message: bytes) -> int:
    """Of the image, packed or not, in a request."""
    tags = bintag.decode(l7.decode(message).content)
    return sum(len(tags.find(tag) or b"") for tag in (lib.TAG_CDL_DATA, lib.TAG_CDL_PACKED))


@dataclass(frozen=True)
class Download:
    """One: `seconds` from the first name request until the program runs."""

    size: int
    seconds: float
    requests: int
    bytes: Counter[str]
    carrying: int  # of them, those of the requests with parts of the image

    @property
    def share(self) -> float:
        """Image bytes per byte that the line carries in this time."""
        return self.size / self.carried

    @property
    def best(self) -> float:
        """The share if nothing but these requests were sent, one after the other."""
        return self.size / self.carrying

    @property
    def carried(self) -> float:
        return self.seconds * BYTE_RATE

    @property
    def budget(self) -> str:
        idle = self.carried - self.bytes.total()
        return ", ".join(f"{what} {count:.0f}" for what, count in [*self.bytes.most_common(), ("idle", idle)])


@contextmanager
def _device() -> Iterator[None]:
    """A controller fresh from the factory."""
    assert lib.SimFlashConfigure(*_FLASH) == lib.ERR_OK
    assert lib.SimStart() == lib.ERR_OK
    try:
        yield
    finally:
        lib.SimStop()


def download(image: bytes, packed: bool) -> Download:
    """Of an image for this machine to a controller that has none."""
    meter = Meter(packed)
    with _device(), Plc(Connection(meter)) as plc:
        begin = meter.now()
        plc.flash(image)
        return Download(len(image), meter.now() - begin, meter.requests, meter.bytes, meter.carrying)


def main(images: dict[str, bytes]) -> None:
    print(
        f"\nThe same on virtual time, {DEFAULT_BAUD} baud: a fresh controller, from the first request until it"
        "\nruns, and what takes the time of the line to the device, in bytes of it"
    )
    for name, image in images.items():
        for packed in (False, True):
            found = download(image, packed)
            what = f"{name}, {len(image)} bytes, {'packed' if packed else 'as it is'}"
            print(
                f"  {what:<52}"
                f"{1e3 * found.seconds:>11.1f} ms  share {found.share:.1%}, of {found.best:.1%} that framing allows: "
                f"{found.share / found.best:.1%}; {found.requests} requests\n"
                f"      {found.budget}",
                flush=True,
            )
