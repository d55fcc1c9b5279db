"""`[modbus]`: devices that this PLC asks as a client (master), and this PLC as a server (slave). IoDrvModbus.

    [[modbus.rs485]]                       # a serial line
    port = "/dev/ttyS1"
    baud = 38400
    [[modbus.rs485.device]]
    name = "Meter"
    unit = 3
    [[modbus.rs485.device.read]]
    function = 4
    address = 30001
    every = "T#100ms"
    var = "Main.power"

    [[modbus.tcp]]                         # a device, or a gateway with several
    host = "192.168.0.7"
    [[modbus.tcp.device]]
    name = "Drive"
    [[modbus.tcp.device.write]]
    function = 16
    address = 40011
    on_change = true
    vars = ["Main.speed", "Main.ramp"]

    [modbus.server.tcp]
    holding = { 40001 = "Main.setpoint", 40003 = "Main.recipe" }
    input = { 30001 = "Main.power" }

An address is a reference as manuals of devices have it: 1.. for coils, 10001.. for discrete inputs, 30001.. for input
registers, 40001.. for holding registers, with six digits for more than 9999. It is checked against the function, so
that a number from 0 is not taken for one from 1; `wire = 0` is the number as it is sent. docs/modbus.md.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from plctool.core import ffi, lib
from plctool.files import Pos
from plctool.iec.types import BOOL, BYTE, UDINT, ArrayType, Elementary, StringType, StructType, Type, base_of
from plctool.io.channels import channel_of, is_target, read_channel, read_substitute
from plctool.io.common import read_connector
from plctool.io.mistakes import Mistakes
from plctool.io.model import HOLD, ZERO, Channel, Connector, Context, Parameter, Substitute, bits_of, holds_bools
from plctool.io.names import MAX_LINE, MAX_NAME, is_line
from plctool.io.tables import Entry, Table, each

DRIVER = "IoDrvModbus"

_MAX_UNIT = int(lib.MODBUS_MAX_UNIT)
_REGISTER = int(lib.MODBUS_REGISTER_BITS)
_LAST = 65535  # address on the wire
_MAX_TIMEOUT_US = 60_000_000
_MAX_INTERVAL_US = 3_600_000_000
_TURNAROUND_US = 5000  # what a device takes to reply, for the load of a line

_COILS, _DISCRETE = int(lib.MODBUS_COILS), int(lib.MODBUS_DISCRETE_INPUTS)
_HOLDING, _INPUT = int(lib.MODBUS_HOLDING_REGISTERS), int(lib.MODBUS_INPUT_REGISTERS)
_PREFIX = {_COILS: 0, _DISCRETE: 1, _INPUT: 3, _HOLDING: 4}
_TABLE_NAME = {_COILS: "coils", _DISCRETE: "discrete inputs", _INPUT: "input registers", _HOLDING: "holding registers"}
_PARITIES = {"none": 0, "even": 1, "odd": 2}
_BAUDS = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600)
_REVERSE_FLAGS = {
    1: 0,
    2: int(lib.MODBUS_JOB_REVERSE_2),
    4: int(lib.MODBUS_JOB_REVERSE_4),
    8: int(lib.MODBUS_JOB_REVERSE_8),
}


@dataclass(frozen=True)
class _Order:
    """In which order the bytes of a number ABCD come: A is its highest."""

    high_register_first: bool
    high_byte_first: bool


_ORDERS = {
    "ABCD": _Order(True, True),
    "CDAB": _Order(False, True),
    "BADC": _Order(True, False),
    "DCBA": _Order(False, False),
}


@dataclass(frozen=True)
class _Function:
    """What a function code is. `most`: bits or registers of one request; `request` and `reply`: bytes of their PDU
    without data."""

    code: int
    table: int
    most: int
    writes: bool
    request: int
    reply: int

    @property
    def of_bits(self) -> bool:
        """Whether it is about bits; else registers."""
        return self.table in (_COILS, _DISCRETE)


_FUNCTIONS = {
    f.code: f
    for f in (
        _Function(1, _COILS, int(lib.MODBUS_MAX_READ_BITS), False, 5, 2),
        _Function(2, _DISCRETE, int(lib.MODBUS_MAX_READ_BITS), False, 5, 2),
        _Function(3, _HOLDING, int(lib.MODBUS_MAX_READ_REGISTERS), False, 5, 2),
        _Function(4, _INPUT, int(lib.MODBUS_MAX_READ_REGISTERS), False, 5, 2),
        _Function(5, _COILS, 1, True, 5, 5),
        _Function(6, _HOLDING, 1, True, 5, 5),
        _Function(15, _COILS, int(lib.MODBUS_MAX_WRITE_BITS), True, 6, 5),
        _Function(16, _HOLDING, int(lib.MODBUS_MAX_WRITE_REGISTERS), True, 6, 5),
        _Function(22, _HOLDING, 1, True, 7, 7),
    )
}


# ---- where a variable is in registers ------------------------------------------------------------------------------


def element_size(t: Type) -> int:
    """The bytes of one number of a type: 2, 4 or 8; 1 for BOOL and numbers of a byte, which have a register of their
    own; 0 for strings and arrays of bytes, whose bytes follow each other, and -1 for what registers cannot have."""
    t = base_of(t)
    if isinstance(t, ArrayType):
        inner = element_size(t.element)
        return {1: -1 if base_of(t.element) is BOOL else 0, 0: -1}.get(inner, inner)
    if isinstance(t, StringType):
        return 2 if t.wide else 0
    if isinstance(t, StructType):
        return -1
    return 1 if bits_of(t) == 1 else t.size


def registers_of(t: Type) -> int:
    """How many registers a variable takes."""
    return 1 if element_size(t) == 1 else -(-t.size // 2)


def fits_coils(t: Type) -> bool:
    """Whether coils can have a variable: all its bits in memory are its value. An array of BOOL has a byte for each
    element, a structure and a string have bytes that mean nothing."""
    inner = base_of(t)
    while isinstance(inner, ArrayType):
        inner = base_of(inner.element)
    return isinstance(inner, Elementary) and not holds_bools(t)


def _cannot_have(channel: Channel, what: str) -> str:
    t = channel.variable_type
    hint = "use registers" if isinstance(t, StringType) else "name its elements"
    return f"{channel.target} is {t}, which {what} cannot have: {hint}"


def _reverse_for(t: Type, order: _Order) -> int | None:
    """The group of bytes in reverse order (Modbus.h) with which a variable needs no more; None: there is none."""
    size = element_size(t)
    if size == 0 or (not order.high_byte_first and not order.high_register_first):
        return 1
    if not order.high_byte_first:
        return 1 if size <= 2 else None
    return max(2, size) if order.high_register_first else 2


def _place(t: Type, register: int, reverse: int, order: _Order, bit: int = 0) -> int:
    """The bit in the driver's memory of a variable at a register; of a BOOL bit `bit` of the register."""
    if element_size(t) != 1:
        return register * _REGISTER
    byte = 2 * register + (bit // 8 if not order.high_byte_first else 1 - bit // 8)
    return 8 * (byte ^ (reverse - 1)) + bit % 8


# ---- devices -------------------------------------------------------------------------------------------------------


@dataclass
class _Job:
    """A read or write of a device. `first`: address on the wire."""

    function: _Function
    first: int
    interval_us: int
    on_change: bool
    verify: bool
    channels: list[Channel]
    pos: Pos


@dataclass(eq=False)
class ModbusLine(Connector):
    """A line of a client. `char_us`: of a serial line, how long a character takes; `load`: share of the time that its
    cyclic requests take."""

    char_us: float | None = None
    silence_us: float = 0.0

    def transaction_us(self, request: int, reply: int) -> float:
        """How long PDUs of these sizes take with all that is around them; 0 on a network."""
        if self.char_us is None:
            return 0.0
        around = 3  # unit and CRC
        return (request + reply + 2 * around) * self.char_us + 2 * self.silence_us + _TURNAROUND_US


@dataclass(eq=False)
class ModbusDevice(Connector):
    """A device of a client."""

    order: _Order = _ORDERS["ABCD"]
    jobs: list[_Job] = field(default_factory=list)

    def complete(self, mistakes: Mistakes) -> None:
        """Makes the jobs, whose sizes are those of the variables."""
        for number, job in enumerate(self.jobs):
            if any(c.variable_type is None for c in job.channels):
                continue
            made = self._bits(job, mistakes) if job.function.of_bits else self._registers(job, mistakes)
            if made is None:
                continue
            count, flags, mask = made
            if count > job.function.most or job.first + count - 1 > _LAST:
                mistakes.error(job.pos, _too_much(job, count))
                continue
            self._add(number, job, count, flags, mask)
            self._note_time(job, count, mistakes)

    def _bits(self, job: _Job, mistakes: Mistakes) -> tuple[int, int, int] | None:
        at = 0
        for channel in job.channels:
            assert channel.variable_type is not None
            if not fits_coils(channel.variable_type):
                mistakes.error(channel.pos, _cannot_have(channel, "coils"))
                return None
            if channel.size_bits > 1 and at % 8:
                message = f"{channel.target} would begin within a byte: name it before variables of type BOOL"
                mistakes.error(channel.pos, message)
                return None
            channel.parameter_bit = at
            at += channel.size_bits
        return at, 0, 0

    def _registers(self, job: _Job, mistakes: Mistakes) -> tuple[int, int, int] | None:
        types = [c.variable_type for c in job.channels if c.variable_type is not None]
        for channel, t in zip(job.channels, types, strict=True):
            if element_size(t) < 0:
                mistakes.error(channel.pos, _cannot_have(channel, "registers"))
                return None
        reverse = self._common_reverse(job, types, mistakes)
        if reverse is None:
            return None
        at = 0
        for channel, t in zip(job.channels, types, strict=True):
            channel.parameter_bit = _place(t, at, reverse, self.order)
            size = element_size(t)
            channel.big_endian = size >= 2 and reverse != (_reverse_for(t, self.order) or 0)
            at += registers_of(t)
        return at, _REVERSE_FLAGS[reverse], self._mask(types[0])

    def _mask(self, t: Type) -> int:
        """The bits of a register, as it is sent, that a variable has."""
        mask = 1 if bits_of(t) == 1 else 0xFF if element_size(t) == 1 else 0xFFFF
        return mask if self.order.high_byte_first else (mask << 8 | mask >> 8) & 0xFFFF

    def _common_reverse(self, job: _Job, types: list[Type], mistakes: Mistakes) -> int | None:
        """One for all variables. Where there is none, numbers are turned round one by one, which arrays cannot be."""
        wanted = {_reverse_for(t, self.order) for t in types}
        if len(wanted) == 1 and None not in wanted:
            return wanted.pop()
        for channel, t in zip(job.channels, types, strict=True):
            if isinstance(base_of(t), ArrayType | StringType) and element_size(t) != 0:
                message = f"{channel.target} is {t}: with this order of bytes it needs a table of its own"
                if len(types) == 1:
                    message = f"{channel.target} is {t}, which cannot have this order of bytes: name its elements"
                mistakes.error(channel.pos, message)
                return None
        texts = [c for c, t in zip(job.channels, types, strict=True) if element_size(t) == 0]
        if texts and self.order is not _ORDERS["ABCD"]:
            mistakes.error(texts[0].pos, f"{texts[0].target} needs a table of its own with this order of bytes")
            return None
        return 1 if self.order.high_byte_first else 2

    def _add(self, number: int, job: _Job, count: int, flags: int, mask: int) -> None:
        flags |= int(lib.MODBUS_JOB_ON_CHANGE) * job.on_change | int(lib.MODBUS_JOB_VERIFY) * job.verify
        writes = job.function.writes
        value = ffi.new(
            "MODBUS_JOB *",
            {
                "function": job.function.code,
                "flags": flags,
                "read_address": 0 if writes else job.first,
                "read_count": 0 if writes else count,
                "write_address": job.first if writes else 0,
                "write_count": count if writes else 0,
                "mask": mask if job.function.code == lib.MODBUS_MASK_WRITE_REGISTER else 0,
                "interval_ms": job.interval_us // 1000,
            },
        )
        self.parameters.append(_structure(int(lib.MODBUS_PARAM_JOB) + number, value))
        for channel in job.channels:
            channel.parameter = int(lib.MODBUS_PARAM_JOB) + number

    def _note_time(self, job: _Job, count: int, mistakes: Mistakes) -> None:
        line = self.parent
        assert isinstance(line, ModbusLine)
        data = -(-count // 8) if job.function.of_bits else 2 * count
        many = job.function.most > 1
        writes = job.function.writes
        took = line.transaction_us(
            job.function.request + data * (writes and many), job.function.reply + data * (not writes)
        )
        if job.verify:
            took += line.transaction_us(5, 2 + data)
        for channel in job.channels:
            channel.age_us = job.interval_us + int(took)
        if line.char_us is None or job.interval_us == 0:
            return
        before = line.load or 0.0
        line.load = before + took / job.interval_us
        if before <= 1.0 < line.load:
            message = f"the line {line.name} is too slow for all that is asked on it: ask less often, or raise its baud"
            mistakes.warning(job.pos, message)


def _too_much(job: _Job, count: int) -> str:
    what = "bits" if job.function.of_bits else "registers"
    if count > job.function.most:
        return f"function {job.function.code} has {job.function.most} {what} at most, these are {count}"
    return f"{count} {what} from here on are more than the last address"


def _structure(number: int, value: Any) -> Parameter:
    data = bytes(ffi.buffer(value))
    return Parameter(number, ArrayType(BYTE, ((0, len(data) - 1),)), data)


# ---- reading lines -------------------------------------------------------------------------------------------------


def read_modbus(table: Table, context: Context) -> list[Connector]:
    """All lines and servers, each line before its devices."""
    made: list[Connector] = []
    for one in table.tables("rs485"):
        made += _read_client(one, _serial_client)
        one.close()
    for one in table.tables("tcp"):
        made += _read_client(one, _tcp_client)
        one.close()
    servers = table.table("server")
    if servers is not None:
        made += each(servers.tables("rs485"), _read_serial_server)
        made += each(servers.tables("tcp"), _read_tcp_server)
        servers.close()
    return made


def _number(number: int, value: int, name: str = "") -> Parameter:
    return Parameter(number, UDINT, value, name)


def _text(number: int, value: str, name: str = "") -> Parameter:
    return Parameter(number, StringType(len(value)), value, name)


def _read_client(table: Table, read: Callable[[Table], ModbusLine]) -> list[Connector]:
    line = read(table)
    return [line, *each(table.tables("device"), lambda t: _read_device(t, line))]


def _serial_settings(table: Table, connector: Connector) -> tuple[int, int]:
    """Adds the parameters of a serial line; its baud, and the bits of a character."""
    bauds = {str(b): b for b in _BAUDS}
    port = table.text("port", required="/dev/ttyS1") or "?"
    if not is_line(port):
        table.error(f"port has 1 to {MAX_LINE} ASCII characters", "port")
    connector.takes = f"the line {port}"
    baud = table.number("baud", _BAUDS[0], _BAUDS[-1], 19200, unit="baud") or 19200
    if str(baud) not in bauds:
        table.error(f"{baud} is not a speed of serial lines: write {', '.join(bauds)}", "baud")
    parity = table.choice("parity", _PARITIES, _PARITIES["even"])
    stop_bits = table.number("stop_bits", 1, 2, 1) or 1
    connector.parameters += [
        _text(int(lib.MODBUS_PARAM_LINE), port, "port"),
        _number(int(lib.MODBUS_PARAM_BAUD), baud, "baud"),
        _number(int(lib.MODBUS_PARAM_PARITY), parity or 0, "parity"),
        _number(int(lib.MODBUS_PARAM_STOP_BITS), stop_bits, "stop_bits"),
        _number(int(lib.MODBUS_PARAM_RS485), int(table.flag("drive")), "drive"),
    ]
    return baud, 9 + (parity != 0) + stop_bits


def _default_name(table: Table, key: str) -> str:
    found = table.text(key)
    return f"modbus_{(found or 'line').rpartition('/')[2]}"[:MAX_NAME]


def _serial_client(table: Table) -> ModbusLine:
    line = read_connector(ModbusLine, table, DRIVER, default_name=_default_name(table, "port"))
    line.parameters.append(_number(int(lib.MODBUS_PARAM_ROLE), int(lib.MODBUS_ROLE_SERIAL_CLIENT)))
    baud, bits = _serial_settings(table, line)
    line.char_us = bits * 1e6 / baud
    line.silence_us = 1750.0 if baud > 19200 else 3.5 * line.char_us
    return line


def _address_parameters(table: Table, key: str, default: str) -> list[Parameter]:
    host = table.text(key, default or None, required="" if default else "192.168.0.7") or "0.0.0.0"
    try:
        address = int(ipaddress.IPv4Address(host))
    except ValueError:
        table.error(f"'{host}' is not an address: write for example \"192.168.0.7\"", key)
        address = 0
    port = table.number("port", 1, 65535, int(lib.MODBUS_PORT))
    return [
        _number(int(lib.MODBUS_PARAM_ADDRESS), address, key),
        _number(int(lib.MODBUS_PARAM_PORT), port or int(lib.MODBUS_PORT), "port"),
    ]


def _tcp_client(table: Table) -> ModbusLine:
    line = read_connector(ModbusLine, table, DRIVER, default_name=_default_name(table, "host"))
    line.parameters.append(_number(int(lib.MODBUS_PARAM_ROLE), int(lib.MODBUS_ROLE_TCP_CLIENT)))
    line.parameters += _address_parameters(table, "host", "")
    return line


def _read_device(table: Table, line: ModbusLine) -> Connector:
    serial = line.char_us is not None
    device = read_connector(ModbusDevice, table, DRIVER, parent=line)
    unit = table.number("unit", 0, _MAX_UNIT if serial else 255, None if serial else 255, required=serial)
    timeout_us = table.duration_us("timeout", 1000, _MAX_TIMEOUT_US, 1_000_000)
    device.order = table.choice("order", _ORDERS, _ORDERS["ABCD"]) or _ORDERS["ABCD"]
    device.parameters += [
        _number(int(lib.MODBUS_PARAM_UNIT), unit or 0, "unit"),
        _number(int(lib.MODBUS_PARAM_TIMEOUT), (timeout_us or 1_000_000) // 1000, "timeout"),
    ]
    for key, writes in (("read", False), ("write", True)):
        device.jobs += each(table.tables(key), lambda t, writes=writes: _read_job(t, writes))  # type: ignore[misc]
    if unit == 0 and serial and any(not j.function.writes for j in device.jobs):
        table.error("unit 0 is all devices of the line, which do not reply: they can be written only", "unit")
    device.channels = [channel for job in device.jobs for channel in job.channels]
    return device


def _read_job(table: Table, writes: bool) -> _Job | None:
    known = [code for code, f in _FUNCTIONS.items() if f.writes is writes]
    code = table.number("function", 1, 127, None, required=True)
    function = _FUNCTIONS.get(code) if code in known and code is not None else None
    if function is None and code is not None:
        verb = "write" if writes else "read"
        table.error(f"function {code} cannot be here: to {verb} there are {', '.join(map(str, known))}", "function")
    on_change = writes and table.flag("on_change")
    interval_us = table.duration_us("every", 1000, _MAX_INTERVAL_US, None, required="" if on_change else "T#100ms")
    verify = writes and table.flag("verify")
    channels = _job_channels(table, writes)
    first = _read_address(table, function)
    if function is None or first is None or not channels or (interval_us is None and not on_change):
        return None
    if function.most == 1 and len(channels) > 1:
        table.error(f"function {function.code} writes one variable; use {15 if function.of_bits else 16}", "vars")
        return None
    return _Job(function, first, interval_us or 0, on_change, verify, channels, table.pos)


def _job_channels(table: Table, writes: bool) -> list[Channel]:
    """Of `var = ""`, or of `vars = []`, one after the other."""
    if "vars" not in table:
        channel = read_channel(table, "", output=writes)
        return [] if channel is None else [replace(channel, name=channel.target)]
    names = table.raw("vars")
    key = "on_stop" if writes else "on_error"
    substitute = read_substitute(table, key, Substitute(ZERO if writes else HOLD))
    pos = table.value_pos("vars")
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        table.error('vars is a list of variables: write for example vars = ["Main.a", "Main.b"]', "vars")
        return []
    good = [n for n in names if is_target(n, pos, table.mistakes, output=writes)]
    return [Channel(n, n, pos, writes, substitute=substitute) for n in good]


def _read_address(table: Table, function: _Function | None) -> int | None:
    """The address on the wire, of `address = 40001` or `wire = 0`."""
    wire = table.number("wire", 0, _LAST)
    if "wire" in table:
        if "address" in table:
            table.error("write address or wire, not both", "wire")
        return wire
    address = table.number("address", 1, 465536, None, required=True)
    if address is None or function is None:
        return None
    found = wire_address(address, function.table)
    if found is None:
        table.error(_wrong_reference(str(address), function.table), "address")
    return found


def wire_address(reference: int, table: int) -> int | None:
    """The address on the wire of a reference such as 40001; None if it is not one of this table."""
    prefix = _PREFIX[table]
    if prefix == 0:
        return reference - 1 if 1 <= reference <= _LAST + 1 else None
    for base, last in ((prefix * 10000, 9999), (prefix * 100000, _LAST + 1)):
        if base < reference <= base + last:
            return reference - base - 1
    return None


def _wrong_reference(text: str, table: int) -> str:
    prefix = _PREFIX[table]
    first, last = (1, _LAST + 1) if prefix == 0 else (prefix * 10000 + 1, prefix * 10000 + 9999)
    return (
        f"{text} is not the address of {_TABLE_NAME[table]}: they are {first} to {last}, and wire = 0 is the first one"
    )


# ---- servers -------------------------------------------------------------------------------------------------------

_KEY = re.compile(r"(\d{1,6})(?:\.(\d{1,2}))?", re.ASCII)


@dataclass
class _Object:
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

    order: _Order = _ORDERS["ABCD"]
    as_bits: bool = False
    objects: list[_Object] = field(default_factory=list)

    def complete(self, mistakes: Mistakes) -> None:
        """Makes the ranges: one for each object, and one for all bits of a register."""
        used: list[tuple[int, int, int, str]] = []
        number = 0
        for group in _groups(self.objects):
            if any(o.channel.variable_type is None for o in group):
                continue
            if not _are_bits_of_one(group, mistakes):
                continue
            of_bits = group[0].table in (_COILS, _DISCRETE)
            made = self._bit_range(group[0], mistakes) if of_bits else self._range(group, mistakes)
            if made is None or not _is_free(group[0], made, used, mistakes):
                continue
            for o in group:
                o.channel.parameter = int(lib.MODBUS_PARAM_RANGE) + number
            value = ffi.new("MODBUS_RANGE *", made)
            self.parameters.append(_structure(int(lib.MODBUS_PARAM_RANGE) + number, value))
            number += 1

    def _bit_range(self, found: _Object, mistakes: Mistakes) -> dict[str, int] | None:
        t = found.channel.variable_type
        assert t is not None
        if not fits_coils(t):
            mistakes.error(found.pos, _cannot_have(found.channel, "coils"))
            return None
        found.channel.parameter_bit = 0
        return {
            "tables": found.table,
            "flags": int(lib.MODBUS_RANGE_WRITABLE) * found.writable,
            "first_bit": found.first,
            "reverse": 2,
            "bits": found.channel.size_bits,
        }

    def _range(self, group: list[_Object], mistakes: Mistakes) -> dict[str, int] | None:
        first = group[0]
        t = first.channel.variable_type
        assert t is not None
        if element_size(t) < 0:
            mistakes.error(first.pos, _cannot_have(first.channel, "registers"))
            return None
        reverse = _reverse_for(t, self.order)
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
            o.channel.parameter_bit = _place(bit_type, 0, reverse, self.order, o.bit or 0)
        size = registers_of(t) * _REGISTER
        tables = first.table
        if self.as_bits and first.first * _REGISTER + size <= _LAST + 1:
            tables |= _COILS if first.table == _HOLDING else _DISCRETE
        return {
            "tables": tables,
            "flags": int(lib.MODBUS_RANGE_WRITABLE) * first.writable,
            "first_register": first.first,
            "first_bit": first.first * _REGISTER if tables != first.table else 0,
            "reverse": reverse,
            "bits": size,
        }


def _groups(objects: list[_Object]) -> Iterator[list[_Object]]:
    """Objects that are bits of one register together, all others alone."""
    groups: dict[tuple[int, int], list[_Object]] = {}
    for number, found in enumerate(objects):
        key = (found.table, found.first) if found.bit is not None else (-1, number)
        groups.setdefault(key, []).append(found)
    yield from groups.values()


def _are_bits_of_one(group: list[_Object], mistakes: Mistakes) -> bool:
    """Whether objects can share the memory of a register: none is a bit twice, and the network may write all or none.
    That is said of the register as a whole."""
    seen: dict[int | None, _Object] = {}
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


def _is_free(found: _Object, made: dict[str, int], used: list[tuple[int, int, int, str]], mistakes: Mistakes) -> bool:
    """Whether no other range has these addresses; then they are used."""
    parts = []
    if made["tables"] & (_HOLDING | _INPUT):
        first = made["first_register"]
        parts.append((made["tables"] & (_HOLDING | _INPUT), first, first + made["bits"] // _REGISTER))
    if made["tables"] & (_COILS | _DISCRETE):
        parts.append((made["tables"] & (_COILS | _DISCRETE), made["first_bit"], made["first_bit"] + made["bits"]))
    for table, start, end in parts:
        if end > _LAST + 1:
            mistakes.error(
                found.pos, f"{found.channel.target} goes beyond the last address of the {_TABLE_NAME[table]}"
            )
            return False
        for other, first, stop, target in used:
            if other == table and start < stop and first < end:
                what = _TABLE_NAME[table]
                mistakes.error(
                    found.pos, f"{found.channel.target} and {target} are at the same addresses of the {what}"
                )
                return False
    used += [(table, start, end, found.channel.target) for table, start, end in parts]
    return True


def _read_server(table: Table, name: str, role: int) -> ModbusServer:
    server = read_connector(ModbusServer, table, DRIVER, default_name=name)
    server.parameters.append(_number(int(lib.MODBUS_PARAM_ROLE), role))
    server.order = table.choice("order", _ORDERS, _ORDERS["ABCD"]) or _ORDERS["ABCD"]
    server.as_bits = table.flag("as_bits")
    for key, kind in (("holding", _HOLDING), ("input", _INPUT), ("coils", _COILS), ("discrete", _DISCRETE)):
        names = table.table(key)
        for entry in names.items() if names is not None else ():
            found = _read_object(entry, table, kind)
            if found is not None:
                server.objects.append(found)
                server.channels.append(found.channel)
    _identify(table, server)
    return server


_OBJECTS = ("vendor", "product", "version", "url", "product_name", "model", "application")


def _identify(table: Table, server: ModbusServer) -> None:
    names = table.table("identification")
    for number, key in enumerate(_OBJECTS):
        text = names.text(key) if names is not None else None
        if text is None or names is None:
            continue
        if not is_line(text):
            names.error(f"{key} has 1 to {MAX_LINE} ASCII characters", key)
        else:
            server.parameters.append(_text(int(lib.MODBUS_PARAM_OBJECT) + number, text, key))
    if names is not None:
        names.close()


def _read_object(entry: Entry, table: Table, kind: int) -> _Object | None:
    if isinstance(entry.value, Table) and (bits := entry.value.keys_of_digits()):
        message = f'a bit of a register is written in quotes: "{entry.key}.{bits[0]}"'
        table.mistakes.error(entry.key_pos, message)
        return None
    match = _KEY.fullmatch(entry.key)
    first = wire_address(int(match[1]), kind) if match else None
    bit = int(match[2]) if match and match[2] is not None else None
    if first is None or (bit is not None and (kind in (_COILS, _DISCRETE) or bit >= _REGISTER)):
        table.mistakes.error(entry.key_pos, _wrong_reference(entry.key, kind))
        return None
    from_network = kind in (_HOLDING, _COILS)
    if from_network and isinstance(entry.value, Table):
        from_network = not entry.value.flag("read_only")
    channel = channel_of(entry, table.mistakes, output=not from_network)
    return None if channel is None else _Object(kind, first, bit, from_network, channel, entry.key_pos)


def _read_serial_server(table: Table) -> Connector:
    server = _read_server(table, _default_name(table, "port"), int(lib.MODBUS_ROLE_SERIAL_SERVER))
    _serial_settings(table, server)
    unit = table.number("unit", 1, _MAX_UNIT, 1)
    server.parameters.append(_number(int(lib.MODBUS_PARAM_UNIT), unit or 1, "unit"))
    return server


def _read_tcp_server(table: Table) -> Connector:
    server = _read_server(table, "modbus_server", int(lib.MODBUS_ROLE_TCP_SERVER))
    address, port = _address_parameters(table, "address", "0.0.0.0")
    server.parameters += [address, port]
    server.takes = f"the TCP port {port.value} of {ipaddress.IPv4Address(int(address.value))}"
    unit = table.number("unit", 0, _MAX_UNIT, 0)
    server.parameters.append(_number(int(lib.MODBUS_PARAM_UNIT), unit or 0, "unit"))
    return server
