"""Block transport to the runtime in this process: the same services as over a line, on virtual time."""

from __future__ import annotations

import math

from plctool.core import error_name, ffi, lib
from plctool.errors import LinkError
from plctool.link.transport import NO_PLACES, TOOL_ADDRESS

_STEP_NS = 1_000_000  # longest piece of virtual time between two looks at the queue


class SimTransport:
    """Packets by function calls. The simulator has to be on (see plctool.sim); time passes only while waiting."""

    name = "the simulator"
    local_address = TOOL_ADDRESS
    max_packet = int(lib.BLK_MAX_SIZE)
    long_packet = 0
    packet_overhead = 0
    byte_rate = math.inf
    is_slow = False
    is_bus = False
    point_to_point = False
    heard_at = -math.inf
    peer_words = 0
    places = NO_PLACES

    def fileno(self) -> int | None:
        return None  # the simulator runs in this thread

    def now(self) -> float:
        return float(lib.SimNow()) / 1e9

    def send(self, *packets: bytes) -> None:
        for packet in packets:
            _check(lib.SimLinkSend(packet, len(packet)))

    def receive(self, timeout: float) -> bytes | None:
        buffer = ffi.new("RTS_UI8[]", self.max_packet)
        left = math.ceil(timeout * 1e9)  # never 0 for some time left: the caller would wait for ever
        while not (size := lib.SimLinkReceive(buffer, self.max_packet)):
            if left < 0:
                return None
            _check(lib.SimAdvance(min(left, _STEP_NS)))
            left = left - _STEP_NS if left else -1
        return bytes(ffi.buffer(buffer, size))

    def close(self) -> None:
        lib.SimLinkReset()


def _check(result: int) -> None:
    if result != lib.ERR_OK:
        raise LinkError(f"The simulator is off ({error_name(result)}); start it first.", "link-lost")
