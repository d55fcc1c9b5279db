"""The machine as CANopen devices on a bus: python examples/canopen/nodes.py slcan:/dev/pts/5

Two drives (5, 6) and the valve terminal (9), made by PyPI's canopen of their EDS. Enter makes the first drive fail.
"""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path

import canopen
from plant import EVERY_MS, Machine

from plctool.link.canbus import open_bus

FOLDER = Path(__file__).parent
BIT_RATE = 500_000
SYNC = 0x80
DRIVES, VALVES = (5, 6), 9


class Node:
    """A device on the bus: its dictionary, and the values in its PDOs by object."""

    def __init__(self, network: canopen.Network, number: int, eds: str) -> None:
        self.network = network
        self.node = canopen.LocalNode(number, str(FOLDER / eds))
        self.values: dict[int, int] = {}
        network.add_node(self.node)
        for pdo in range(2):
            network.subscribe(0x200 + 0x100 * pdo + number, self.receive)
        self.node.nmt.state = "INITIALISING"
        self.boot()

    def boot(self) -> None:
        """Ends a reset, which python canopen leaves to us."""
        if self.node.nmt.state == "INITIALISING":
            self.node.nmt.stop_heartbeat()
            self.node.nmt.state = "PRE-OPERATIONAL"

    def mapping(self, parameters: int) -> list[tuple[int, int]]:
        """Objects and their bits, by what the manager has written; nothing while the PDO is off."""
        if parameters not in self.node.object_dictionary or self.node.sdo[parameters][1].raw & 0x8000_0000:
            return []
        mapped = self.node.sdo[parameters + 0x200]
        entries = [mapped[sub].raw for sub in range(1, mapped[0].raw + 1)]
        return [(entry >> 16, entry & 0xFF) for entry in entries]

    def receive(self, cob: int, data: bytearray, timestamp: float) -> None:
        """An RPDO."""
        value = int.from_bytes(data, "little")
        for index, bits in self.mapping(0x1400 + (cob - 0x200) // 0x100):
            self.values[index] = value & ((1 << bits) - 1)
            value >>= bits

    def signed(self, index: int) -> int:
        """A value of 32 bits with its sign."""
        value = self.values.get(index, 0)
        return value - (1 << 32) if value >> 31 else value

    def send(self) -> None:
        """All TPDOs, in operation."""
        for pdo in range(2 if self.node.nmt.state == "OPERATIONAL" else 0):
            value = at = 0
            for index, bits in self.mapping(0x1800 + pdo):
                value |= (self.values.get(index, 0) & ((1 << bits) - 1)) << at
                at += bits
            if at:
                self.network.send_message(0x180 + 0x100 * pdo + self.node.id, value.to_bytes(-(-at // 8), "little"))


class Devices:
    """All devices of the machine; their PDOs are sent by a thread of their own, soon after each SYNC."""

    def __init__(self, link: str) -> None:
        self.network = canopen.Network(bus=open_bus(link, BIT_RATE, 0))
        self.network.connect()
        self.machine = Machine()
        self.drives = [Node(self.network, number, "drive.eds") for number in DRIVES]
        self.valves = Node(self.network, VALVES, "valves.eds")
        self.network.subscribe(SYNC, lambda cob, data, timestamp: self.due.set())
        self.due = threading.Event()
        self.ended = False
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self) -> None:
        before = time.monotonic()
        inputs = None
        while not self.ended:
            self.due.wait(EVERY_MS / 1000)
            now = time.monotonic()
            for node in (*self.drives, self.valves):
                node.boot()
            for node, drive in zip(self.drives, self.machine.drives, strict=True):
                drive.step(node.values.get(0x6040, 0), node.signed(0x60FF), now - before)
                node.values |= {0x6041: drive.status, 0x6064: int(drive.position)}
                if self.due.is_set():
                    node.send()
            self.due.clear()
            before = now
            new = (self.machine.part | self.machine.bad << 1, self.valves.node.nmt.state)
            self.valves.values[0x6000] = new[0]
            if new != inputs:
                self.valves.send()
            inputs = new

    def close(self) -> None:
        self.ended = True
        self.thread.join()
        for node in (*self.drives, self.valves):
            node.node.nmt.stop_heartbeat()
        self.network.disconnect()


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit("usage: nodes.py LINK, such as slcan:/dev/pts/5 or socketcan:can0")
    devices = Devices(sys.argv[1])
    print("nodes 5, 6 and 9 are on the bus", flush=True)
    try:
        for _ in sys.stdin:
            devices.machine.drives[0].fail()
        threading.Event().wait()
    except KeyboardInterrupt:
        devices.close()


if __name__ == "__main__":
    main()
