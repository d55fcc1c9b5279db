"""`[[iio]]` and `[[pwm]]`: analog values and PWM of the Linux kernel (IoDrvSysfs).

    [[iio]]
    name = "Adc"
    device = "ads1115"
    every = "T#20ms"
    in  = { in_voltage0 = "Main.level", in_voltage1 = "Main.raw" }
    out = { out_voltage0 = { var = "Main.setpoint", on_stop = "hold" } }

    [[pwm]]
    name = "Heater"
    chip = "pwmchip0"
    out = { pwm0 = { var = "Main.power", frequency = 1000 } }

A channel of [[iio]] has the name of its file, without _raw. A REAL is in the kernel's unit, a DINT the raw number of
the converter; of PWM a REAL is percent of the period.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from plctool.core import lib
from plctool.iec.types import DINT, REAL, UDINT, USINT, StringType, base_of
from plctool.io.channels import channel_of
from plctool.io.common import read_connector
from plctool.io.mistakes import Mistakes
from plctool.io.model import Channel, Connector, Context, Parameter
from plctool.io.tables import Entry, Table

DRIVER = "IoDrvSysfs"
CHANNELS = int(lib.IO_SYSFS_CHANNELS)
_OUT, _REAL = int(lib.SYSFS_OPTION_OUT), int(lib.SYSFS_OPTION_REAL)
_DEVICE = re.compile(r"[A-Za-z0-9_][\w:,.@+-]{0,62}", re.ASCII)
_IIO_CHANNEL = re.compile(r"(in|out)_[a-z][a-z0-9_-]{0,50}")
_PWM_CHANNEL = re.compile(r"pwm(0|[1-9]\d{0,3})")
_DEFAULT_EVERY_US = 10_000
_MAX_EVERY_US = 60_000_000
_DEFAULT_FREQUENCY, _MAX_FREQUENCY = 1000, 10_000_000  # [Hz]
_NS = 1_000_000_000


@dataclass(eq=False)
class SysfsDevice(Connector):
    """A device of the kernel's. `periods`: of each channel [ns], 0 of those that are no PWM."""

    periods: list[int] = field(default_factory=list)

    def complete(self, mistakes: Mistakes) -> None:
        """Says of each channel whether it is a REAL, which only its variable knows."""
        for number, channel in enumerate(self.channels):
            if channel.variable_type is None:
                continue
            kind = base_of(channel.variable_type)
            is_raw = kind is DINT or (channel.at_address and kind.size == DINT.size)
            if kind is not REAL and not is_raw:
                message = f"{channel.target} has to be a REAL, in the kernel's unit, or a DINT, the raw number"
                mistakes.error(channel.pos, message)
                continue
            options = _OUT * channel.output | _REAL * (kind is REAL)
            if options:
                self._add(int(lib.SYSFS_OPTIONS) + number, USINT, options, f"{channel.name}.options")
        self.parameters.sort(key=lambda p: p.id)

    def add(self, channel: Channel, file: str, period: int = 0) -> None:
        """One more channel; `file`: what the kernel calls it."""
        number = len(self.channels)
        channel.parameter = int(lib.SYSFS_VALUE) + number
        self.channels.append(channel)
        self._add(int(lib.SYSFS_CHANNEL) + number, StringType(len(file)), file, f"{channel.name}.file")
        if period:
            self._add(int(lib.SYSFS_PERIOD) + number, UDINT, period, f"{channel.name}.period")

    def head(self, device: str, kind: int, every_us: int) -> None:
        """The parameters that it has without channels."""
        self._add(int(lib.SYSFS_DEVICE), StringType(len(device)), device, "device")
        self._add(int(lib.SYSFS_KIND), USINT, kind, "kind")
        self._add(int(lib.SYSFS_EVERY), UDINT, every_us // 1000, "every")
        self.takes = f"the device {device}"

    def _add(self, number: int, kind: object, value: object, name: str) -> None:
        self.parameters.append(Parameter(number, kind, value, name))  # type: ignore[arg-type]


def read_iio(table: Table, context: Context) -> list[Connector]:
    """Analog inputs and outputs of one device."""
    made = read_connector(SysfsDevice, table, DRIVER, default_name="iio")
    device = _device(table, "device", "ads1115")
    every = table.duration_us("every", 1000, _MAX_EVERY_US, _DEFAULT_EVERY_US) or _DEFAULT_EVERY_US
    made.head(device, int(lib.SYSFS_IIO), every)
    for entry, output in _entries(table):
        way = "out" if output else "in"
        found = _IIO_CHANNEL.fullmatch(entry.key)
        if found is None or found[1] != way:
            example = f"{way}_voltage0: the kernel's file {way}_voltage0_raw"
            table.mistakes.error(entry.key_pos, f"'{entry.key}' is no channel such as {example}")
            continue
        channel = channel_of(entry, table.mistakes, output=output)
        if channel is not None:
            channel.age_us = 0 if output else every
            made.add(channel, entry.key)
    return [made]


def read_pwm(table: Table, context: Context) -> list[Connector]:
    """Outputs of one PWM chip."""
    made = read_connector(SysfsDevice, table, DRIVER, default_name="pwm")
    made.head(_device(table, "chip", "pwmchip0"), int(lib.SYSFS_PWM), _DEFAULT_EVERY_US)
    for entry, output in _entries(table):
        if not output:
            table.mistakes.error(entry.key_pos, "PWM has outputs only; move it to out")
        elif _PWM_CHANNEL.fullmatch(entry.key) is None:
            table.mistakes.error(entry.key_pos, f"'{entry.key}' is no output of a chip such as pwm0")
        else:
            frequency = _frequency(entry)
            channel = channel_of(entry, table.mistakes, output=True, bits=32, type=REAL)
            if channel is not None:
                made.add(channel, entry.key, round(_NS / frequency))
    return [made]


def _entries(table: Table) -> Iterator[tuple[Entry, bool]]:
    """The channels, as many as a device can have."""
    for number, (entry, output) in enumerate(table.channels()):
        if number == CHANNELS:
            table.mistakes.error(entry.key_pos, f"a device can have {CHANNELS} channels")
        if number < CHANNELS:
            yield entry, output


def _frequency(entry: Entry) -> int:
    if not isinstance(entry.value, Table):
        return _DEFAULT_FREQUENCY
    return entry.value.number("frequency", 1, _MAX_FREQUENCY, _DEFAULT_FREQUENCY, unit="Hz") or _DEFAULT_FREQUENCY


def _device(table: Table, key: str, example: str) -> str:
    name = table.text(key, required=example)
    if name is not None and _DEVICE.fullmatch(name) is None:
        table.error(f"'{name}' is no name that the kernel gives to a device; write for example {example}", key)
    return name or example
