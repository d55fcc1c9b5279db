"""The plant as a Modbus device: python examples/tanks/plant_server.py [--port 5020]

Enter pulls the bus, and plugs it in again; the plant itself goes on. Its registers, all REAL with the high one first:

    input registers    30001 level of the supply tank, 30003 of the process tank, in %
    holding registers  40001 speed of the pump in %
    coils              1 pump, 2 inlet valve; both go off when no request has come for a second
"""

from __future__ import annotations

import argparse
import asyncio
import os
import struct
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress

from plant import EVERY_MS, Plant

try:
    from pymodbus.server import ModbusTcpServer
    from pymodbus.simulator import DataType, SimData, SimDevice
except ImportError:
    sys.exit("The plant needs pymodbus, 3.16 or newer; type: pip install --upgrade pymodbus")

READ_INPUT_REGISTERS = 4
WRITE_COILS = (5, 15)
COILS = ("pump", "inlet")
SILENCE_S = 1.0  # after which the outputs go off


class Device:
    """The plant at a port."""

    def __init__(self, plant: Plant, port: int) -> None:
        self.plant = plant
        self.port = port
        self.server: ModbusTcpServer | None = None
        self.asked_at = 0.0  # time of the last request [s]

    async def plug_in(self) -> None:
        """Replies from now on. Port 0 becomes one that is free."""
        coils, inputs = ([SimData(0, values=[False] * 16, datatype=DataType.BITS)] for _ in range(2))
        holding = [SimData(0, count=2, datatype=DataType.REGISTERS)]
        registers = [SimData(0, count=4, datatype=DataType.REGISTERS)]
        device = SimDevice(0, simdata=(coils, inputs, holding, registers), action=self.exchange)
        self.server = ModbusTcpServer(device, address=("127.0.0.1", self.port))
        await self.server.serve_forever(background=True)
        self.port = self.server.transport.sockets[0].getsockname()[1]

    async def pull(self) -> None:
        """No connection goes on."""
        if self.server:
            await self.server.shutdown()
        self.server = None

    async def exchange(
        self, function: int, start: int, address: int, count: int, registers: list[int], values: Sequence[int] | None
    ) -> None:
        """A request: `registers` are those of its table, from address `start` on; `values` what it writes."""
        self.asked_at = asyncio.get_running_loop().time()
        if function == READ_INPUT_REGISTERS:
            registers[0:4] = words(self.plant.supply.level) + words(self.plant.process.level)
        elif values and function in WRITE_COILS:
            for name, value in zip(COILS[address:], values, strict=False):
                setattr(self.plant, name, bool(value))
        elif values:
            written = [*registers[:address], *values, *registers[address + len(values) :]]
            self.plant.speed = min(max(0.0, real(written[:2])), 100.0)

    async def run(self) -> None:
        """The plant moves in real time, in steps of EVERY_MS."""
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            due += EVERY_MS / 1000
            await asyncio.sleep(max(0.0, due - loop.time()))
            if loop.time() - self.asked_at > SILENCE_S:
                self.plant.pump = self.plant.inlet = False
            self.plant.step(EVERY_MS / 1000)


def words(value: float) -> list[int]:
    """A REAL in registers."""
    return list(struct.unpack(">HH", struct.pack(">f", value)))


def real(registers: list[int]) -> float:
    """The REAL in registers."""
    (value,) = struct.unpack(">f", struct.pack(">HH", *registers))
    return float(value)


async def serve(port: int) -> None:
    """Until the process is ended."""
    device = Device(Plant(), port)
    try:
        await device.plug_in()
    except RuntimeError:  # of pymodbus
        sys.exit(f"Port {port} is in use; choose another one with --port, and in tanks.io.toml.")
    print(f"modbus: 127.0.0.1:{device.port}", flush=True)
    await asyncio.gather(device.run(), follow_keys(device))


async def follow_keys(device: Device) -> None:
    """Pulls the bus at Enter, and plugs it in at the next one; until the end of stdin."""
    loop, pressed = asyncio.get_running_loop(), asyncio.Queue[bytes]()

    def read() -> None:
        while got := os.read(sys.stdin.fileno(), 100):
            loop.call_soon_threadsafe(pressed.put_nowait, got)

    threading.Thread(target=read, daemon=True).start()
    while await pressed.get():
        await (device.pull() if device.server else device.plug_in())
        state = "connected" if device.server else "pulled"
        print(f"bus {state}; process tank {device.plant.process.level:.1f} %", flush=True)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description="The plant as a Modbus device. Enter pulls the bus.")
    help = "TCP port on this machine, 0 for any that is free (%(default)s)"
    parser.add_argument("--port", type=int, default=5020, help=help)
    with suppress(KeyboardInterrupt):
        asyncio.run(serve(parser.parse_args().port))


if __name__ == "__main__":
    main()
