"""The machine: drives that follow their control word, and parts on the belts.

On the virtual clock: plctool run line.cdl --plant examples/canopen/plant.py. As CANopen devices on a bus: nodes.py.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from plctool.sim import Simulator

EVERY_MS = 10
PART_MM = 500  # from one part to the next
BAD_ONE_IN = 5
ACCELERATION = 2000  # mm/s per s


@dataclass
class Drive:
    """A drive of CiA 402 in profile velocity mode. `velocity`: mm/s; `position`: mm."""

    velocity: float = 0.0
    position: float = 0.0
    status: int = 0x40

    def step(self, control: int, target: int, seconds: float) -> None:
        """Time passes."""
        if self.status & 0x4F == 0x08:  # fault
            self.status = 0x40 if control & 0x80 else self.status
        elif control & 0x07 == 0x06:
            self.status = 0x21  # ready to switch on
        elif control & 0x0F == 0x07:
            self.status = 0x23 if self.status in (0x21, 0x23, 0x27) else self.status
        elif control & 0x0F == 0x0F:
            self.status = 0x27 if self.status in (0x23, 0x27) else self.status
        else:
            self.status = 0x40
        wanted = target if self.status == 0x27 else 0
        most = ACCELERATION * seconds
        self.velocity += min(max(wanted - self.velocity, -most), most)
        self.position += self.velocity * seconds

    def fail(self) -> None:
        """A fault, until it is reset."""
        self.status = 0x08


@dataclass
class Machine:
    """Two drives and the light barriers at the first belt."""

    drives: tuple[Drive, Drive] = field(default_factory=lambda: (Drive(), Drive()))

    @property
    def part(self) -> bool:
        """True while a part is in the light barrier."""
        return self.drives[0].position % PART_MM > PART_MM / 2

    @property
    def bad(self) -> bool:
        """True if the part in the light barrier has to be rejected."""
        return self.part and int(self.drives[0].position / PART_MM) % BAD_ONE_IN == BAD_ONE_IN - 1


machine = Machine()


def step(plc: Simulator) -> None:
    """The simulated machine; plctool calls it each EVERY_MS of virtual time."""
    for number, drive in enumerate(machine.drives, 1):
        drive.step(plc.output(f"Line.control{number}"), plc.output(f"Line.target{number}"), EVERY_MS / 1000)
        plc.set_input(f"Line.status{number}", drive.status)
        plc.set_input(f"Line.position{number}", int(drive.position))
    plc.set_input("Line.part", machine.part)
    plc.set_input("Line.bad", machine.bad)
    plc.set_input("Line.run", True)
    plc.set_input("Line.speed", 1000)
