"""The controller as a Modbus server (slave): which variables its addresses are."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from plctool.core import ffi, lib
from plctool.files import Pos
from plctool.iec.types import ArrayType, StringType, base_of
from plctool.io.channels import channel_of
from plctool.io.common import read_connector
from plctool.io.mistakes import Mistakes
from plctool.io.modbus.registers import (
    COILS,
    DISCRETE,
    HOLDING,
    INPUT,
    LAST_ADDRESS,
    ORDERS,
    REGISTER_BITS,
    TABLE_NAMES,
    Order,
    cannot_have,
    element_size,
    fits_coils,
    place,
    registers_of,
    registers_of_number,
    reverse_for,
    wire_address,
    wrong_reference,
)
from plctool.io.modbus.settings import (
    DRIVER,
    MAX_UNIT,
    counters,
    default_name,
    number_parameter,
    own_address_parameters,
    serial_settings,
    structure_parameter,
    text_parameter,
)
from plctool.io.model import Channel, Connector, bits_of
from plctool.io.names import MAX_LINE, is_line
from plctool.io.tables import Entry, Table

_KEY = re.compile(r"(\d{1,6})(?:\.(\d{1,2}))?", re.ASCII)
_OBJECTS = ("vendor", "product", "version", "url", "product_name", "model", "application")


@dataclass
class Object:
    """What is at an address of a server. `bit`: of its register."""

    table: int
    first: int
    bit: int | None
    writable: bool
    channel: Channel
    pos: Pos


@dataclass(eq=False)
class ModbusServer(Connector):
    """This PLC as a server. `as_bits`: its registers are coils and discrete inputs, too."""

    faults = ()  # its clients are not simulated
    counters = counters("requests", "exceptions", "written", "bad_frames", "accepted", "displaced")

    order: Order = ORDERS["ABCD"]
    as_bits: bool = False
    objects: list[Object] = field(default_factory=list)

    def complete(self, mistakes: Mistakes) -> None:
        """Makes the ranges: one for each object, and one for all bits of a register."""
        used: list[tuple[int, int, int, str]] = []
        number = 0
        for group in _groups(self.objects):
            if any(o.channel.variable_type is None for o in group):
                continue
            if not _are_bits_of_one(group, mistakes):
                continue
            of_bits = group[0].table in (COILS, DISCRETE)
            made = self._bit_range(group[0], mistakes) if of_bits else self._range(group, mistakes)
            if made is None or not _is_free(group[0], made, used, mistakes):
                continue
            for o in group:
                o.channel.parameter = int(lib.MODBUS_PARAM_RANGE) + number
            value = ffi.new("MODBUS_RANGE *", made)
            self.parameters.append(structure_parameter(int(lib.MODBUS_PARAM_RANGE) + number, value))
            number += 1

    def _bit_range(self, found: Object, mistakes: Mistakes) -> dict[str, int] | None:
        t = found.channel.variable_type
        assert t is not None
        if not fits_coils(t):
            mistakes.error(found.pos, cannot_have(found.channel, "coils"))
            return None
        found.channel.parameter_bit = 0
        return {
            "tables": found.table,
            "flags": int(lib.MODBUS_RANGE_WRITABLE) * found.writable,
            "first_bit": found.first,
            "reverse": 2,
            "bits": found.channel.size_bits,
        }

    def _range(self, group: list[Object], mistakes: Mistakes) -> dict[str, int] | None:
        first = group[0]
        t = first.channel.variable_type
        assert t is not None
        if element_size(t) < 0:
            mistakes.error(first.pos, cannot_have(first.channel, "registers"))
            return None
        reverse = reverse_for(t, self.order)
        if reverse is None:
            reverse = 2
            if isinstance(base_of(t), ArrayType | StringType):
                mistakes.error(first.pos, f"{first.channel.target} is {t}: name its elements, or choose another order")
                return None
            first.channel.big_endian = True
        for o in group:
            bit_type = o.channel.variable_type
            assert bit_type is not None
            if o.bit is not None and bits_of(bit_type) != 1:
                mistakes.error(o.pos, f"{o.channel.target} is {bit_type}; a bit of a register is for a BOOL")
                return None
            o.channel.parameter_bit = place(bit_type, 0, reverse, self.order, o.bit or 0)
        size = registers_of(t) * REGISTER_BITS
        tables = first.table
        if self.as_bits and first.first * REGISTER_BITS + size <= LAST_ADDRESS + 1:
            tables |= COILS if first.table == HOLDING else DISCRETE
        return {
            "tables": tables,
            "flags": int(lib.MODBUS_RANGE_WRITABLE) * first.writable
            | registers_of_number(t) - 1 << int(lib.MODBUS_RANGE_NUMBER_SHIFT),
            "first_register": first.first,
            "first_bit": first.first * REGISTER_BITS if tables != first.table else 0,
            "reverse": reverse,
            "bits": size,
        }


def _groups(objects: list[Object]) -> Iterator[list[Object]]:
    """Objects that are bits of one register together, all others alone."""
    groups: dict[tuple[int, int], list[Object]] = {}
    for number, found in enumerate(objects):
        key = (found.table, found.first) if found.bit is not None else (-1, number)
        groups.setdefault(key, []).append(found)
    yield from groups.values()


def _are_bits_of_one(group: list[Object], mistakes: Mistakes) -> bool:
    """Whether objects can share the memory of a register: none is a bit twice, and the network may write all or none.
    That is said of the register as a whole."""
    seen: dict[int | None, Object] = {}
    first = group[0]
    for o in group:
        other = seen.setdefault(o.bit, o)
        if other is not o:
            mistakes.error(o.pos, f"{o.channel.name} is the bit {other.channel.name} in line {other.pos.line}")
        elif o.writable is not first.writable:
            words = ("is read_only", "can be written")
            one, two = words[o.writable], words[first.writable]
            message = f"{o.channel.name} {one}, {first.channel.name} in line {first.pos.line} {two}"
            mistakes.error(o.pos, f"{message}: the bits of one register are all the same")
        else:
            continue
        return False
    return True


def _is_free(found: Object, made: dict[str, int], used: list[tuple[int, int, int, str]], mistakes: Mistakes) -> bool:
    """Whether no other range has these addresses; then they are used."""
    parts = []
    if made["tables"] & (HOLDING | INPUT):
        first = made["first_register"]
        parts.append((made["tables"] & (HOLDING | INPUT), first, first + made["bits"] // REGISTER_BITS))
    if made["tables"] & (COILS | DISCRETE):
        parts.append((made["tables"] & (COILS | DISCRETE), made["first_bit"], made["first_bit"] + made["bits"]))
    for table, start, end in parts:
        if end > LAST_ADDRESS + 1:
            mistakes.error(
                found.pos, f"{found.channel.target} goes beyond the last address of the {TABLE_NAMES[table]}"
            )
            return False
        for other, first, stop, target in used:
            if other == table and start < stop and first < end:
                what = TABLE_NAMES[table]
                mistakes.error(
                    found.pos, f"{found.channel.target} and {target} are at the same addresses of the {what}"
                )
                return False
    used += [(table, start, end, found.channel.target) for table, start, end in parts]
    return True


# ---- reading ---------------------------------------------------------------------------------------------------------


def _read_server(table: Table, name: str, role: int) -> ModbusServer:
    server = read_connector(ModbusServer, table, DRIVER, default_name=name)
    server.parameters.append(number_parameter(int(lib.MODBUS_PARAM_ROLE), role))
    server.order = table.choice("order", ORDERS, ORDERS["ABCD"]) or ORDERS["ABCD"]
    server.as_bits = table.flag("as_bits")
    gaps = table.number("gaps", 0, 0xFFFF)
    if gaps is not None:
        server.parameters.append(number_parameter(int(lib.MODBUS_PARAM_GAPS), gaps, "gaps"))
    for key, kind in (("holding", HOLDING), ("input", INPUT), ("coils", COILS), ("discrete", DISCRETE)):
        names = table.table(key)
        for entry in names.items() if names is not None else ():
            found = _read_object(entry, table, kind)
            if found is not None:
                server.objects.append(found)
                server.channels.append(found.channel)
    _identify(table, server)
    return server


def _identify(table: Table, server: ModbusServer) -> None:
    names = table.table("identification")
    for number, key in enumerate(_OBJECTS):
        text = names.text(key) if names is not None else None
        if text is None or names is None:
            continue
        if not is_line(text):
            names.error(f"{key} has 1 to {MAX_LINE} ASCII characters", key)
        else:
            server.parameters.append(text_parameter(int(lib.MODBUS_PARAM_OBJECT) + number, text, key))
    if names is not None:
        names.close()


def _read_object(entry: Entry, table: Table, kind: int) -> Object | None:
    if isinstance(entry.value, Table) and (bits := entry.value.keys_of_digits()):
        message = f'a bit of a register is written in quotes: "{entry.key}.{bits[0]}"'
        table.mistakes.error(entry.key_pos, message)
        return None
    match = _KEY.fullmatch(entry.key)
    first = wire_address(int(match[1]), kind) if match else None
    bit = int(match[2]) if match and match[2] is not None else None
    if first is not None and bit is not None and kind not in (COILS, DISCRETE) and bit >= REGISTER_BITS:
        table.mistakes.error(entry.key_pos, f"{entry.key}: the bits of a register are 0 to {REGISTER_BITS - 1}")
        return None
    if first is None or (bit is not None and kind in (COILS, DISCRETE)):
        table.mistakes.error(entry.key_pos, wrong_reference(entry.key, kind))
        return None
    from_network = kind in (HOLDING, COILS)
    if from_network and isinstance(entry.value, Table):
        from_network = not entry.value.flag("read_only")
    channel = channel_of(entry, table.mistakes, output=not from_network, holds=True)
    return None if channel is None else Object(kind, first, bit, from_network, channel, entry.key_pos)


def read_serial_server(table: Table) -> Connector:
    """A server on a serial line."""
    server = _read_server(table, default_name(table, "port"), int(lib.MODBUS_ROLE_SERIAL_SERVER))
    serial_settings(table, server)
    unit = table.number("unit", 1, MAX_UNIT, 1)
    server.parameters.append(number_parameter(int(lib.MODBUS_PARAM_UNIT), unit or 1, "unit"))
    return server


def read_tcp_server(table: Table) -> Connector:
    """A server on the network."""
    server = _read_server(table, "modbus_server", int(lib.MODBUS_ROLE_TCP_SERVER))
    address, port = own_address_parameters(table)
    server.parameters += [address, port]
    server.takes = f"the TCP port {port.value} of {ipaddress.IPv4Address(int(address.value))}"
    unit = table.number("unit", 0, MAX_UNIT, 0)
    server.parameters.append(number_parameter(int(lib.MODBUS_PARAM_UNIT), unit or 0, "unit"))
    return server
