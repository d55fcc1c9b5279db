"""Foreign CANopen nodes on a bus: python canopen's LocalNode, with the EDS of the example."""

from __future__ import annotations

from pathlib import Path

import canopen
from canopen_programs import VALVES

from plctool.link.canbus import open_bus

NODE = 9


class ForeignNode:
    """A node on the bus of a link while the context lasts."""

    def __init__(self, link: str, eds: Path = VALVES, node: int = NODE) -> None:
        self._bus = open_bus(link, 500000, 0)
        self._network = canopen.Network(bus=self._bus)
        self.node = canopen.LocalNode(node, str(eds))
        self.outputs: list[bytes] = []

    def __enter__(self) -> ForeignNode:
        self._network.connect()
        self._network.add_node(self.node)
        self._network.subscribe(0x200 + self.node.id, lambda cob, data, time: self.outputs.append(bytes(data)))
        self.node.nmt.state = "INITIALISING"
        self.node.nmt.state = "PRE-OPERATIONAL"
        return self

    def __exit__(self, *exc: object) -> None:
        self.node.nmt.stop_heartbeat()
        self._network.disconnect()

    def send_inputs(self, data: bytes) -> None:
        self._network.send_message(0x180 + self.node.id, data)
