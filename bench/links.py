"""What each link carries, with the same client and program: how long a read takes, variables per second with 'watch',
and how fast an image arrives. Of a network also the share of the image in all that is sent for it."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from plctool.compiler import compile_sources
from plctool.device import Plc
from plctool.link.connection import Connection
from plctool.link.serial import SerialTransport
from plctool.link.transport import BlockTransport
from plctool.link.transports import open_transport, parse_link
from plctool.link.wire import Layout
from plctool.testing.can_hub import CanHub
from plctool.testing.line import SerialLine
from plctool.testing.plcrt import Plcrt

BAUD = 115200
NETWORKS = ("UDP", "TCP")  # what IP adds is not counted
PACKET_HEADERS = 12 + Layout("CHANNEL_DATA").size  # of the router with both addresses, of a block
SECONDS = 1.0  # for each figure
WATCHED = 100  # variables
_VALUES = ", ".join(str(i * i % 65521) for i in range(5000))
PROGRAM = f"""PROGRAM Main
VAR n : DINT; {" ".join(f"v{i} : DINT;" for i in range(WATCHED))} a : ARRAY[0..4999] OF DINT := [{_VALUES}]; END_VAR
n := n + 1; a[0] := n; v0 := n;
END_PROGRAM
"""


@dataclass(frozen=True)
class Figures:
    """Median of a read [s], variables per second, bytes of an image per second, and per byte sent."""

    read: float
    variables: float
    image: float
    share: float


class Counted:
    """A transport that counts what is sent: packets and what the line carries besides them."""

    def __init__(self, transport: BlockTransport) -> None:
        self._transport = transport
        self.sent = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    def send(self, *packets: bytes) -> None:
        self.sent += sum(len(packet) + self._transport.packet_overhead for packet in packets)
        self._transport.send(*packets)

    @property
    def best_share(self) -> float:
        """Of data in packets of the longest kind."""
        return (self.max_packet - PACKET_HEADERS) / (self.max_packet + self.packet_overhead)


@contextmanager
def _links(folder: Path) -> Iterator[dict[str, BlockTransport]]:
    """Each link to a plcrt of its own."""
    with ExitStack() as stack:
        hub = stack.enter_context(CanHub(2))

        def plcrt(name: str, *options: str) -> Plcrt:
            return stack.enter_context(Plcrt(folder / name, *options))

        slow = stack.enter_context(SerialLine(plcrt("slow").port, BAUD))
        plcrt("can", "--can", f"slcan:{hub.paths[0]}")
        yield {
            f"serial, {BAUD} baud": SerialTransport(slow.path, BAUD, paced=True),
            "serial, pseudo terminal": open_transport(parse_link(f"serial:{plcrt('serial').port}")),
            "CAN, SLCAN over pseudo terminals": open_transport(parse_link(f"can:slcan:{hub.paths[1]}?node=1")),
            "UDP": open_transport(parse_link(f"udp:{plcrt('udp', '--udp', '127.11.74.0').udp}")),
            "TCP": open_transport(parse_link(f"tcp:{plcrt('tcp', '--tcp', '0').tcp}")),
        }


def _figures(plc: Plc, line: Counted, image: Path) -> Figures:
    plc.identity()
    sent, begin = line.sent, time.perf_counter()
    size = plc.flash(image).bytes
    arrived, share = time.perf_counter() - begin, size / (line.sent - sent)
    return Figures(_median_read(plc), WATCHED / _mean_seconds(plc), size / arrived, share)


def _median_read(plc: Plc) -> float:
    times, end = [], time.perf_counter() + SECONDS
    while (begin := time.perf_counter()) < end:
        plc.read("Main.n")
        times.append(time.perf_counter() - begin)
    return sorted(times)[len(times) // 2]


def _mean_seconds(plc: Plc) -> float:
    """From one reading of all variables to the next while they are watched."""
    names = [f"Main.v{i}" for i in range(WATCHED)]
    at = 0.0
    for readings, (at, _) in enumerate(plc.watch(names, interval=0.0)):
        if at >= SECONDS:
            return at / readings
    return at


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source, image = folder / "links.st", folder / "links.cdl"
        source.write_text(PROGRAM)
        compile_sources([source]).write(image)
        size = image.stat().st_size
        print(f"\nEach link on this machine: a read, {WATCHED} variables watched, an image of {size} bytes")
        with _links(folder) as links:
            for what, transport in links.items():
                line = Counted(transport)
                with Plc(Connection(line), image.with_suffix(".sym")) as plc:
                    found = _figures(plc, line, image)
                share = (
                    f", {found.share:.1%} of what is sent ({line.best_share:.1%} at best)" if what in NETWORKS else ""
                )
                print(
                    f"  {what:<52}{1e3 * found.read:>11.2f} ms  {found.variables:,.0f} variables/s, "
                    f"to running with {found.image / 1e3:,.1f} kB/s{share}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
