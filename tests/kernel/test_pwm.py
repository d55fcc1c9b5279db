"""plcrt and PWM of a real kernel: its driver of the chip pca9685, on an I2C bus that keeps its registers. See `run`."""

from __future__ import annotations

import ctypes
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.testing.waiting import eventually

ADDRESS = 0x40
OFF_L, STEPS = 0x08, 4096  # the first of the two registers in which a pulse of channel 0 ends; steps of a period
I2C_SLAVE_FORCE, I2C_SMBUS = 0x0706, 0x0720  # linux/i2c-dev.h
READ, BYTE_DATA = 1, 2

PROGRAM = """\
PROGRAM Main
VAR power : REAL := 25.0; ok : BOOL; END_VAR
ok := Heater.ok;
END_PROGRAM
"""
DESCRIPTION = """\
[[pwm]]
name = "Heater"
chip = "pwmchip0"
out = { pwm0 = { var = "Main.power", frequency = 1000 } }
"""


def simulated_bus() -> Path | None:
    """That of i2c-stub."""
    buses = Path("/sys/bus/i2c/devices").glob("i2c-*")
    return next((bus for bus in buses if (bus / "name").read_text().startswith("SMBus stub")), None)


pytestmark = pytest.mark.skipif(simulated_bus() is None, reason="there is no i2c-stub: make test-kernel")


class SmbusCall(ctypes.Structure):
    """struct i2c_smbus_ioctl_data."""

    _fields_ = (
        ("read_write", ctypes.c_uint8),
        ("command", ctypes.c_uint8),
        ("size", ctypes.c_uint32),
        ("data", ctypes.c_void_p),
    )


class Chip:
    """The chip, whose driver the kernel starts for a new device of its bus."""

    def __init__(self, bus: Path) -> None:
        self.bus = bus
        self.plug()

    def plug(self) -> None:
        (self.bus / "new_device").write_text(f"pca9685 {ADDRESS:#x}")

    def unplug(self) -> None:
        (self.bus / "delete_device").write_text(f"{ADDRESS:#x}")

    def register(self, number: int) -> int:
        """As the chip has it; with force, because the kernel's driver is at its address."""
        data = (ctypes.c_uint8 * 34)()
        call = SmbusCall(READ, number, BYTE_DATA, ctypes.addressof(data))
        device = os.open(f"/dev/{self.bus.name}", os.O_RDWR)
        try:
            fcntl.ioctl(device, I2C_SLAVE_FORCE, ADDRESS)
            fcntl.ioctl(device, I2C_SMBUS, call)
        finally:
            os.close(device)
        return int(data[0])

    def share(self) -> float:
        """Of the period in which channel 0 is on, in percent."""
        off = self.register(OFF_L) | self.register(OFF_L + 1) << 8
        on = self.register(OFF_L - 2) | self.register(OFF_L - 1) << 8
        if off & STEPS:
            return 0.0
        return 100.0 if on & STEPS else 100.0 * off / STEPS


@pytest.fixture
def chip() -> Iterator[Chip]:
    bus = simulated_bus()
    assert bus is not None
    chip = Chip(bus)
    yield chip
    if Path("/sys/class/pwm/pwmchip0").exists():
        chip.unplug()


def test_share_of_the_period_reaches_the_chip_and_is_off_on_stop(chip: Chip, plc: Plc, image: Path) -> None:
    plc.flash(image)
    eventually(lambda: plc.read("Main.ok"))
    eventually(lambda: chip.share() == pytest.approx(25.0, abs=0.1))
    for power in (100.0, 0.0, 62.5):
        plc.write({"Main.power": power})
        eventually(lambda power=power: chip.share() == pytest.approx(power, abs=0.1))
    plc.stop()
    eventually(lambda: chip.share() == 0.0)


def test_chip_that_is_pulled_is_lost_and_comes_back_with_its_output(chip: Chip, plc: Plc, image: Path) -> None:
    plc.flash(image)
    eventually(lambda: chip.share() == pytest.approx(25.0, abs=0.1))
    chip.unplug()
    plc.write({"Main.power": 75.0})  # an output: what it should be is known to be lost when it is to be written
    eventually(lambda: plc.read("Main.ok") is False)
    chip.plug()
    eventually(lambda: plc.read("Main.ok"))
    eventually(lambda: chip.share() == pytest.approx(75.0, abs=0.1))


def test_chip_that_the_kernel_has_not_refuses_the_program(plc: Plc, image: Path) -> None:
    with pytest.raises(DeviceError, match="pwmchip0"):
        plc.flash(image)
