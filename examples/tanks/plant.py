"""The plant: two tanks, a pump between them, a valve that fills the first, consumers at the second.

On the virtual clock: plctool run tanks.cdl --plant examples/tanks/plant.py. As a Modbus device: plant_server.py.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from plctool.sim import Simulator

INLET_MAX = 15.0  # l/s, valve open
PUMP_MAX = 20.0  # l/s at full speed
CONSUMER_MAX = 10.0  # l/s, tank full and valve open
PUMP_LAG = 0.3  # s

EVERY_MS = 10


@dataclass
class Tank:
    """`capacity`, `volume`: l."""

    capacity: float
    volume: float

    @property
    def level(self) -> float:
        """In %."""
        return self.volume / self.capacity * 100

    def flow(self, litres: float) -> None:
        """What has come in, or gone out."""
        self.volume = min(max(0.0, self.volume + litres), self.capacity)


@dataclass
class Plant:
    """What the controller sets, and what moves. `speed`: of the pump's converter, %; `demand`: opening of the valve of
    the consumers, 0..1."""

    pump: bool = False
    speed: float = 0.0
    inlet: bool = False
    demand: float = 1.0
    supply: Tank = field(default_factory=lambda: Tank(400.0, 280.0))
    process: Tank = field(default_factory=lambda: Tank(200.0, 10.0))
    pump_speed: float = 0.0  # %, follows the converter with a lag

    def step(self, seconds: float) -> None:
        """Time passes: 10 ms at a time, as the lag of the pump wants short steps."""
        self.pump_speed += ((self.speed if self.pump else 0.0) - self.pump_speed) * seconds / PUMP_LAG
        inlet_flow = INLET_MAX if self.inlet else 0.0
        pump_flow = PUMP_MAX * self.pump_speed / 100 if self.supply.volume > 0 else 0.0
        consumer_flow = CONSUMER_MAX * self.demand * sqrt(self.process.level / 100)  # Torricelli
        self.supply.flow((inlet_flow - pump_flow) * seconds)
        self.process.flow((pump_flow - consumer_flow) * seconds)


plant = Plant()


def step(plc: Simulator) -> None:
    """The simulated plant; plctool calls it each EVERY_MS of virtual time."""
    plant.pump, plant.speed, plant.inlet = (plc.output(f"Control.{name}") for name in ("pump", "speed", "inlet"))
    plant.step(EVERY_MS / 1000)
    plc.set_input("Control.level1", plant.supply.level)
    plc.set_input("Control.level2", plant.process.level)
