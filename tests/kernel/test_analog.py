"""plcrt and analog values of a real kernel: a driver of its own that has them without hardware. See `run`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from plctool.device import Plc
from plctool.errors import DeviceError
from plctool.testing.waiting import eventually

CONFIG = Path("/sys/kernel/config/iio/devices/dummy")
DEVICES = Path("/sys/bus/iio/devices")

pytestmark = pytest.mark.skipif(not CONFIG.exists(), reason="there is no iio_simple_dummy: make test-kernel")

PROGRAM = """\
PROGRAM Main
VAR level : REAL; count : DINT; setpoint : DINT; ok : BOOL; END_VAR
setpoint := count + 1;
ok := Adc.ok;
END_PROGRAM
"""
DESCRIPTION = """\
[[iio]]
name = "Adc"
device = "plc"
in = { in_voltage0 = { var = "Main.level", on_error = "zero" }, in_voltage1-voltage2 = "Main.count" }
out = { out_voltage0 = "Main.setpoint" }
"""


class Converter:
    """A device of the kernel's with the name "plc"."""

    def __init__(self) -> None:
        self.plug()

    def plug(self) -> None:
        (CONFIG / "plc").mkdir()
        found = [d for d in DEVICES.glob("iio:device*") if (d / "name").read_text().strip() == "plc"]
        assert len(found) == 1
        self.folder = found[0]

    def unplug(self) -> None:
        (CONFIG / "plc").rmdir()

    def read(self, file: str) -> float:
        return float((self.folder / file).read_text())


@pytest.fixture
def converter() -> Iterator[Converter]:
    converter = Converter()
    yield converter
    if (CONFIG / "plc").exists():
        converter.unplug()


def test_values_in_and_out_and_a_device_that_is_pulled(converter: Converter, plc: Plc, image: Path) -> None:
    expected = (converter.read("in_voltage0_raw") + converter.read("in_voltage0_offset")) * converter.read(
        "in_voltage0_scale"
    )
    count = int(converter.read("in_voltage1-voltage2_raw"))
    assert expected and count
    plc.flash(image)
    eventually(lambda: plc.read("Main.ok"))
    eventually(lambda: plc.read("Main.level") == pytest.approx(expected))
    eventually(lambda: converter.read("out_voltage0_raw") == count + 1)

    converter.unplug()
    eventually(lambda: plc.read("Main.ok") is False and plc.read("Main.level") == 0)
    assert plc.read("Main.count") == count  # held
    converter.plug()
    eventually(lambda: plc.read("Main.ok") and plc.read("Main.level") == pytest.approx(expected))
    eventually(lambda: converter.read("out_voltage0_raw") == count + 1)

    plc.stop()
    eventually(lambda: converter.read("out_voltage0_raw") == 0)


def test_device_that_the_kernel_has_not_refuses_the_program(plc: Plc, image: Path) -> None:
    with pytest.raises(DeviceError, match="the kernel has no device plc"):
        plc.flash(image)
