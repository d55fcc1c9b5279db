"""Analog values and PWM of the Linux kernel: what their description becomes, and its mistakes."""

from __future__ import annotations

from pathlib import Path

import pytest
from io_support import build, configuration, messages

from plctool.core import lib
from plctool.sim import Simulator

PROGRAM = """\
PROGRAM Main
VAR level, share : REAL; count, raw : DINT; flag : BOOL; END_VAR
share := level / 2.0; raw := count;
END_PROGRAM
"""
ADC = """\
[[iio]]
name = "Adc"
device = "ads1115"
every = "T#20ms"
in = { in_voltage0 = "Main.level", in_voltage1 = "Main.count" }
out = { out_voltage0 = "Main.raw" }
"""
HEATER = """\
[[pwm]]
name = "Heater"
chip = "pwmchip0"
out = { pwm1 = { var = "Main.share", frequency = 2000 } }
"""


def test_parameters_say_files_units_and_periods(tmp_path: Path) -> None:
    adc, heater = configuration(build(tmp_path, PROGRAM, ADC + HEATER)).connectors
    assert (adc.driver, heater.driver) == ("IoDrvSysfs", "IoDrvSysfs")

    found, periods = ({p.id: bytes(p.value) for p in c.parameters} for c in (adc, heater))
    files = [found[int(lib.SYSFS_CHANNEL) + n].rstrip(b"\0") for n in range(3)]
    assert files == [b"in_voltage0", b"in_voltage1", b"out_voltage0"]
    options = [found.get(int(lib.SYSFS_OPTIONS) + n, b"\0")[0] for n in range(3)]
    assert options == [int(lib.SYSFS_OPTION_REAL), 0, int(lib.SYSFS_OPTION_OUT)]
    assert int.from_bytes(found[int(lib.SYSFS_EVERY)], "little") == 20
    assert int.from_bytes(periods[int(lib.SYSFS_PERIOD)], "little") == 500_000


def test_simulator_has_the_values(tmp_path: Path) -> None:
    built = build(tmp_path, PROGRAM, ADC + HEATER)
    with Simulator(built.image, built.symbols) as plc:
        plc.set_input("Adc.in_voltage0", 50.0)
        plc.set_input("Adc.in_voltage1", -3)
        plc.run_cycles(2)
        assert plc.output("Heater.pwm1") == 25.0
        assert plc.output("Main.raw") == -3


def test_age_of_an_input_is_that_of_its_readings(tmp_path: Path) -> None:
    ages = {c["channel"]: c["age_us"] for c in build(tmp_path, PROGRAM, ADC).symbols.io["channels"]}
    assert ages["in_voltage0"] == 20_000 + 10_000  # and the interval of the task


def test_input_of_a_device_that_is_not_enabled_has_no_age(tmp_path: Path) -> None:
    text = ADC.replace('name = "Adc"', 'name = "Adc"\nenabled = false')
    assert {c["age_us"] for c in build(tmp_path, PROGRAM, text).symbols.io["channels"]} == {None}


@pytest.mark.parametrize(
    "description, expected",
    [
        (ADC.replace("Main.level", "Main.flag"), "5: Main.flag has to be a REAL, in the kernel's unit, or a DINT"),
        (ADC.replace("ads1115", "../x"), "3: '../x' is no name that the kernel gives to a device"),
        (ADC.replace('device = "ads1115"\n', ""), "1: [iio] needs device"),
        (ADC.replace("in_voltage1", "out_voltage1"), "5: 'out_voltage1' is no channel such as in_voltage0"),
        (HEATER.replace("Main.share", "Main.raw"), "4: Main.raw is DINT, but Heater.pwm1 is REAL"),
        (HEATER.replace("pwm1 =", "lamp ="), "4: 'lamp' is no output of a chip such as pwm0"),
        (HEATER.replace("2000", "0"), "4: frequency is 0 Hz; it can be 1 to 10000000 Hz"),
        (HEATER.replace("out =", "in ="), "4: PWM has outputs only; move it to out"),
        (ADC + ADC.replace('"Adc"', '"Other"'), "8: Other cannot have the device ads1115, which Adc in line 2 has"),
    ],
)
def test_mistakes(tmp_path: Path, description: str, expected: str) -> None:
    found = messages(tmp_path, PROGRAM, description)
    assert any(m.startswith(expected) for m in found), found


def test_more_channels_than_a_device_can_have(tmp_path: Path) -> None:
    lines = "\n".join(f'in_voltage{n} = "%ID{n}"' for n in range(33))
    found = messages(tmp_path, PROGRAM, f'[iio]\ndevice = "x"\n[iio.in]\n{lines}\n')
    assert "36: a device can have 32 channels" in found, found
