"""Finds the nodes of a network: by their heartbeats, and by asking all 127 for object 1000h."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from dataclasses import dataclass

from plctool.canopen.bus import FRAME_BYTES, SDO_REPLY, SDO_REQUEST, CanopenBus, Frame
from plctool.canopen.nmt import heartbeat_of
from plctool.canopen.sdo import SdoClient
from plctool.canopen.words import LAST_NODE
from plctool.errors import DeviceError, LinkError

_AT_ONCE = 8  # nodes that are asked before replies are awaited: queues of adapters are short
_PAUSE = 0.02  # for the replies of these [s]
_ASK_TYPE = bytes([0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0])
_MULTIPLEXER = _ASK_TYPE[1:4]


@dataclass
class Node:
    """A node that answered or sent a heartbeat. Numbers are None if it does not say."""

    number: int
    state: int | None = None
    device_type: int | None = None
    vendor: int | None = None
    product: int | None = None
    revision: int | None = None
    serial: int | None = None
    name: str = ""
    problem: str = ""


class _Heard:
    """Counts replies and requests for the device type, and keeps the last state of each node."""

    def __init__(self) -> None:
        self.states: dict[int, int] = {}
        self.replies: Counter[int] = Counter()
        self.asked: Counter[int] = Counter()

    def __call__(self, frame: Frame) -> None:
        if beat := heartbeat_of(frame):
            self.states[beat[0]] = beat[1]
        for base, count in ((SDO_REPLY, self.replies), (SDO_REQUEST, self.asked)):
            node = frame.identifier - base
            is_about_type = len(frame.data) == FRAME_BYTES and frame.data[1:4] == _MULTIPLEXER
            if 1 <= node <= LAST_NODE and is_about_type:
                count[node] += 1


def scan(bus: CanopenBus, listen: float, timeout: float) -> list[Node]:
    """The nodes that send a heartbeat within `listen` seconds or reply to an SDO. Raises LinkError if there are none,
    or the bus does not work."""
    heard = _Heard()
    bus.drain()
    bus.listen(heard)
    for first in range(1, LAST_NODE + 1, _AT_ONCE):
        for number in range(first, min(first + _AT_ONCE, LAST_NODE + 1)):
            heard.asked[number] += 1
            bus.send(SDO_REQUEST + number, _ASK_TYPE)
        for _ in bus.frames(_PAUSE):
            pass
    for _ in bus.frames(listen):
        pass
    numbers = sorted(heard.states.keys() | heard.replies.keys())
    if not numbers:
        raise LinkError(
            f"No CANopen device answers on {bus.name}. Check the bit rate (--bitrate), the wires and that they are on.",
            "no-answer",
        )
    duplicates = {number for number, count in heard.replies.items() if count > heard.asked[number]}
    nodes = [_identified(bus, number, heard, timeout) for number in numbers]
    for node in nodes:
        node.state = heard.states.get(node.number)
        if node.number in duplicates:
            node.problem = "several devices have this number"
    return nodes


def _identified(bus: CanopenBus, number: int, heard: _Heard, timeout: float) -> Node:
    node = Node(number)
    if not heard.replies[number]:
        node.problem = "does not reply to SDO"
        return node
    client = SdoClient(bus, number, timeout)
    try:
        node.device_type = _number(client, 0x1000, 0)
        node.vendor, node.product, node.revision, node.serial = (_number(client, 0x1018, sub) for sub in range(1, 5))
        with suppress(DeviceError):
            node.name = client.read(0x1008, 0).rstrip(b"\0").decode("latin-1")
    except LinkError:
        node.problem = "stopped replying to SDO"
    return node


def _number(client: SdoClient, index: int, sub: int) -> int | None:
    """A number of the dictionary, None if the device has none."""
    with suppress(DeviceError):
        data = client.read(index, sub)
        return int.from_bytes(data, "little") if len(data) <= 4 else None
    return None
