"""The kinds of tables in a description, by their names."""

from __future__ import annotations

from collections.abc import Callable

from plctool.io.canopen.device import read_canopen_device
from plctool.io.canopen.manager import read_canopen
from plctool.io.gpio import read_gpio
from plctool.io.local import read_local
from plctool.io.modbus import read_modbus
from plctool.io.model import Connector, Context
from plctool.io.sim import read_sim
from plctool.io.sysfs import read_iio, read_pwm
from plctool.io.tables import Table

Kind = Callable[[Table, Context], list[Connector]]

KINDS: dict[str, Kind] = {
    "canopen": read_canopen,
    "canopen_device": read_canopen_device,
    "gpio": read_gpio,
    "iio": read_iio,
    "local": read_local,
    "modbus": read_modbus,
    "pwm": read_pwm,
    "sim": read_sim,
}
"""What reads the table `[NAME]`, or each of `[[NAME]]`. A kind that has tables in its table, such as [[modbus.rs485]],
opens them itself."""
