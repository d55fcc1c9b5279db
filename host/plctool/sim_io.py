"""Simulated inputs and outputs: the devices of a description in this process, made by IoDrvSim from the image.

A channel is known by the name of its device and its own (`Bench.button`), by its own if no other has it (`button`), and
by its variable (`Main.start`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from plctool.core import Core, error_name, lib
from plctool.debug.symbols import SymbolTable
from plctool.debug.variables import Symbol
from plctool.errors import DeviceError, UsageError, did_you_mean
from plctool.iec.addresses import parse_address
from plctool.iec.areas import Area
from plctool.iec.types import BOOL, UDINT, Type, base_of
from plctool.iec.values import decode, encode
from plctool.io.faults import FAULTS, check_name


@dataclass(frozen=True)
class SimChannel:
    """A channel of the symbol file. `core`: the runtime that simulates it; `bit`: the first of its `bits` in the
    parameter of the device; `area_bit`: in the inputs or outputs. `enabled`: the device is; else there is none that
    could measure anything. `event`: what its edges post, "" for nothing."""

    core: Core
    device: str
    name: str
    output: bool
    symbol: Symbol
    area_bit: int
    parameter: int
    bit: int
    bits: int
    big_endian: bool
    enabled: bool
    event: str = ""
    rising: bool = False
    falling: bool = False

    @property
    def title(self) -> str:
        """Its name with that of the device."""
        return f"{self.device}.{self.name}"

    def read(self) -> bytes:
        """What the device has now."""
        ffi = self.core.ffi
        data = ffi.new("RTS_UI8[]", -(-self.bits // 8))
        _check(self.core.lib.SimIoRead(self.device.encode(), self._place(), data), self.title)
        return self._ordered(bytes(ffi.buffer(data)))

    def write(self, data: bytes) -> None:
        """What the device measures from now on; an edge is the event of the line, as on a board."""
        was = self.read() if self.event else data
        _check(self.core.lib.SimIoWrite(self.device.encode(), self._place(), self._ordered(data)), self.title)
        if was != data and (self.rising if any(data) else self.falling) and not self._is_absent():
            self.core.lib.SimPostEvent(self.event.encode())  # refused if no task waits for it

    def _is_absent(self) -> bool:
        return bool(read_parameter(self.core, self.device, FAULTS["absent"], UDINT))

    def _place(self) -> Any:
        return self.core.ffi.new("SIM_IO_PLACE *", (self.parameter, self.bit, self.bits, self.output))

    def _ordered(self, data: bytes) -> bytes:
        return data[::-1] if self.big_endian else data


class SimIo:
    """The channels of the program with these symbols."""

    def __init__(self, symbols: SymbolTable, core: Core) -> None:
        disabled = {d["name"] for d in symbols.io.get("devices", []) if not d.get("enabled", True)}
        self.channels = [
            _channel(core, entry, symbols, entry["device"] not in disabled) for entry in symbols.io.get("channels", [])
        ]
        self._names: dict[str, list[SimChannel]] = {}
        for c in self.channels:
            for name in {c.title.casefold(), c.name.casefold(), c.symbol.name.casefold()}:
                self._names.setdefault(name, []).append(c)

    def find(self, name: str) -> SimChannel:
        """The channel with a name. Raises UsageError if there is none, or there are several."""
        found = self._names.get(name.casefold(), [])
        if len(found) == 1:
            return found[0]
        if found:
            titles = " or ".join(c.title for c in found)
            raise UsageError(f"There are several channels {name}; write {titles}.", "ambiguous")
        hint = did_you_mean(name, [c.title for c in self.channels]) or "; 'plctool io map' lists them."
        raise UsageError(f"There is no channel {name}{hint}", "unknown-channel")

    def _enabled(self, name: str) -> SimChannel:
        channel = self.find(name)
        if not channel.enabled:
            hint = "take enabled = false out of its description"
            raise UsageError(f"{channel.title} is of a device that is not enabled; {hint}.", "not-enabled")
        return channel

    def set_input(self, name: str, value: Any) -> None:
        """What a device measures from now on. Raises UsageError for a value that does not fit."""
        channel = self._enabled(name)
        if channel.output:
            raise UsageError(f"{channel.title} is an output: the program sets it.", "output")
        channel.write(encode(channel.symbol.type, value))

    def value(self, name: str) -> Any:
        """What a device has now: an output as it left the program, or as it is while that is stopped."""
        channel = self._enabled(name)
        return decode(channel.symbol.type, channel.read())

    def follow(self, first_bit: int, end_bit: int, memory: Callable[[int, int], memoryview]) -> None:
        """Bits of the inputs were written: the devices measure that from now on. `memory` gives bytes of the inputs, by
        offset and size."""
        for c in self.channels:
            if c.enabled and not c.output and c.area_bit < end_bit and first_bit < c.area_bit + c.bits:
                data = bytes(memory(c.area_bit // 8, -(-c.bits // 8)))
                shift = c.area_bit % 8
                c.write(bytes([data[0] >> shift & (1 << c.bits) - 1]) if c.bits < 8 else data)


def set_fault(core: Core, device: str, fault: str, value: int) -> None:
    """Makes a simulated device fail (io/faults.py), or with 0 work again."""
    check_name(fault)
    if core.lib.SimIoFault(device.encode("ascii", "replace"), FAULTS[fault], value) != lib.ERR_OK:
        hint = "'plctool io map' lists the devices, and a line can only be absent"
        raise UsageError(f"There is no simulated device {device} that can be '{fault}'; {hint}.", "no-device")


def read_parameter(core: Core, device: str, number: int, t: Type) -> Any:
    """A parameter of a device or line. Raises DeviceError."""
    data = core.ffi.new("RTS_UI8[]", t.size)
    place = core.ffi.new("SIM_IO_PLACE *", (number, 0, 8 * t.size, False))
    _check(core.lib.SimIoRead(device.encode("ascii", "replace"), place, data), f"{device} with parameter {number}")
    return decode(t, bytes(core.ffi.buffer(data)))


def set_modbus(core: Core, device: str, reference: int, value: int) -> None:
    """What a simulated Modbus device replies to a request of the program for this coil or register."""
    from plctool.io.modbus.registers import place_of_reference

    place = place_of_reference(reference)
    if place is None:
        raise UsageError(f"{reference} is no coil or register; 40001 is the first holding register.", "bad-reference")
    if not 0 <= value <= 0xFFFF:
        raise UsageError(f"A register holds 0 to 65535, not {value}.", "bad-value")
    result = core.lib.SimModbusSet(device.encode("ascii", "replace"), *place, value)
    if result != lib.ERR_OK:
        reason = "a Modbus device of this name" if result == lib.ERR_NO_OBJECT else "room for more registers"
        raise DeviceError(f"The simulator does not have {reason} ({device}).", "no-device", result)


def _channel(core: Core, entry: dict[str, Any], symbols: SymbolTable, enabled: bool) -> SimChannel:
    address = parse_address(entry["address"])
    assert address is not None
    area_bit = address.offset * 8 + address.bit
    symbol = symbols.resolve(entry["variable"])
    if entry["bits"] == 1 and base_of(symbol.type) is not BOOL:  # an address of a bit
        symbol = Symbol(symbol.name, symbol.area, symbol.offset, BOOL, symbol.bit)
    return SimChannel(
        core, entry["device"], entry["channel"], entry["output"], symbol, area_bit, entry["parameter"],
        entry["parameter_bit"], entry["bits"], entry["big_endian"], enabled,
        entry.get("event", ""), entry.get("rising", False), entry.get("falling", False),
    )  # fmt: skip


def is_input(symbol: Symbol) -> bool:
    """Whether a variable is where devices write."""
    return symbol.pointer is None and symbol.area == Area.INPUT.value


def _check(result: int, name: str) -> None:
    if result != lib.ERR_OK:
        raise DeviceError(f"The simulated device does not have {name} ({error_name(result)}).", "no-channel", result)
