"""The controller as a Modbus client (master): lines, their devices, and what is asked of each and how often."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from plctool.core import ffi, lib
from plctool.files import Pos
from plctool.iec.types import ArrayType, StringType, Type, base_of
from plctool.io.channels import is_target, read_channel, read_substitute
from plctool.io.common import read_connector
from plctool.io.mistakes import Mistakes
from plctool.io.modbus.registers import (
    COILS,
    DISCRETE,
    HOLDING,
    INPUT,
    LAST_ADDRESS,
    ORDERS,
    Order,
    cannot_have,
    element_size,
    fits_coils,
    place,
    registers_of,
    reverse_for,
    wire_address,
    wrong_reference,
)
from plctool.io.modbus.settings import (
    DRIVER,
    MAX_UNIT,
    address_parameters,
    default_name,
    number_parameter,
    serial_settings,
    structure_parameter,
)
from plctool.io.model import HOLD, ZERO, Channel, Connector, Substitute, bits_of
from plctool.io.tables import Table, each

_MAX_TIMEOUT_US = 60_000_000
_MAX_INTERVAL_US = 3_600_000_000
_TURNAROUND_US = 5000  # what a device takes to reply, for the load of a line
_REVERSE_FLAGS = {
    1: 0,
    2: int(lib.MODBUS_JOB_REVERSE_2),
    4: int(lib.MODBUS_JOB_REVERSE_4),
    8: int(lib.MODBUS_JOB_REVERSE_8),
}


@dataclass(frozen=True)
class Function:
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
        return self.table in (COILS, DISCRETE)


FUNCTIONS = {
    f.code: f
    for f in (
        Function(1, COILS, int(lib.MODBUS_MAX_READ_BITS), False, 5, 2),
        Function(2, DISCRETE, int(lib.MODBUS_MAX_READ_BITS), False, 5, 2),
        Function(3, HOLDING, int(lib.MODBUS_MAX_READ_REGISTERS), False, 5, 2),
        Function(4, INPUT, int(lib.MODBUS_MAX_READ_REGISTERS), False, 5, 2),
        Function(5, COILS, 1, True, 5, 5),
        Function(6, HOLDING, 1, True, 5, 5),
        Function(15, COILS, int(lib.MODBUS_MAX_WRITE_BITS), True, 6, 5),
        Function(16, HOLDING, int(lib.MODBUS_MAX_WRITE_REGISTERS), True, 6, 5),
        Function(22, HOLDING, 1, True, 7, 7),
    )
}


@dataclass
class Job:
    """A read or write of a device. `first`: address on the wire."""

    function: Function
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

    order: Order = ORDERS["ABCD"]
    jobs: list[Job] = field(default_factory=list)

    def complete(self, mistakes: Mistakes) -> None:
        """Makes the jobs, whose sizes are those of the variables."""
        for number, job in enumerate(self.jobs):
            if any(c.variable_type is None for c in job.channels):
                continue
            made = self._bits(job, mistakes) if job.function.of_bits else self._registers(job, mistakes)
            if made is None:
                continue
            count, flags, mask = made
            if count > job.function.most or job.first + count - 1 > LAST_ADDRESS:
                mistakes.error(job.pos, _too_much(job, count))
                continue
            self._add(number, job, count, flags, mask)
            self._note_time(job, count, mistakes)

    def _bits(self, job: Job, mistakes: Mistakes) -> tuple[int, int, int] | None:
        at = 0
        for channel in job.channels:
            assert channel.variable_type is not None
            if not fits_coils(channel.variable_type):
                mistakes.error(channel.pos, cannot_have(channel, "coils"))
                return None
            if channel.size_bits > 1 and at % 8:
                message = f"{channel.target} would begin within a byte: name it before variables of type BOOL"
                mistakes.error(channel.pos, message)
                return None
            channel.parameter_bit = at
            at += channel.size_bits
        return at, 0, 0

    def _registers(self, job: Job, mistakes: Mistakes) -> tuple[int, int, int] | None:
        types = [c.variable_type for c in job.channels if c.variable_type is not None]
        for channel, t in zip(job.channels, types, strict=True):
            if element_size(t) < 0:
                mistakes.error(channel.pos, cannot_have(channel, "registers"))
                return None
        reverse = self._common_reverse(job, types, mistakes)
        if reverse is None:
            return None
        at = 0
        for channel, t in zip(job.channels, types, strict=True):
            channel.parameter_bit = place(t, at, reverse, self.order)
            size = element_size(t)
            channel.big_endian = size >= 2 and reverse != (reverse_for(t, self.order) or 0)
            at += registers_of(t)
        return at, _REVERSE_FLAGS[reverse], self._mask(types[0])

    def _mask(self, t: Type) -> int:
        """The bits of a register, as it is sent, that a variable has."""
        mask = 1 if bits_of(t) == 1 else 0xFF if element_size(t) == 1 else 0xFFFF
        return mask if self.order.high_byte_first else (mask << 8 | mask >> 8) & 0xFFFF

    def _common_reverse(self, job: Job, types: list[Type], mistakes: Mistakes) -> int | None:
        """One for all variables. Where there is none, numbers are turned round one by one, which arrays cannot be."""
        wanted = {reverse_for(t, self.order) for t in types}
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
        if texts and self.order is not ORDERS["ABCD"]:
            mistakes.error(texts[0].pos, f"{texts[0].target} needs a table of its own with this order of bytes")
            return None
        return 1 if self.order.high_byte_first else 2

    def _add(self, number: int, job: Job, count: int, flags: int, mask: int) -> None:
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
        self.parameters.append(structure_parameter(int(lib.MODBUS_PARAM_JOB) + number, value))
        for channel in job.channels:
            channel.parameter = int(lib.MODBUS_PARAM_JOB) + number

    def _note_time(self, job: Job, count: int, mistakes: Mistakes) -> None:
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


def _too_much(job: Job, count: int) -> str:
    what = "bits" if job.function.of_bits else "registers"
    if count > job.function.most:
        return f"function {job.function.code} has {job.function.most} {what} at most, these are {count}"
    return f"{count} {what} from here on are more than the last address"


# ---- reading ---------------------------------------------------------------------------------------------------------


def read_serial_client(table: Table) -> list[Connector]:
    """A serial line of this PLC, and its devices."""
    line = read_connector(ModbusLine, table, DRIVER, default_name=default_name(table, "port"))
    line.parameters.append(number_parameter(int(lib.MODBUS_PARAM_ROLE), int(lib.MODBUS_ROLE_SERIAL_CLIENT)))
    baud, bits = serial_settings(table, line)
    line.char_us = bits * 1e6 / baud
    line.silence_us = 1750.0 if baud > 19200 else 3.5 * line.char_us
    return [line, *_read_devices(table, line)]


def read_tcp_client(table: Table) -> list[Connector]:
    """A device on the network, or a gateway and the devices at it."""
    line = read_connector(ModbusLine, table, DRIVER, default_name=default_name(table, "host"))
    line.parameters.append(number_parameter(int(lib.MODBUS_PARAM_ROLE), int(lib.MODBUS_ROLE_TCP_CLIENT)))
    line.parameters += address_parameters(table, "host", "")
    return [line, *_read_devices(table, line)]


def _read_devices(table: Table, line: ModbusLine) -> list[Connector]:
    return each(table.tables("device"), lambda t: _read_device(t, line))


def _read_device(table: Table, line: ModbusLine) -> Connector:
    serial = line.char_us is not None
    device = read_connector(ModbusDevice, table, DRIVER, parent=line)
    unit = table.number("unit", 0, MAX_UNIT if serial else 255, None if serial else 255, required=serial)
    timeout_us = table.duration_us("timeout", 1000, _MAX_TIMEOUT_US, 1_000_000)
    device.order = table.choice("order", ORDERS, ORDERS["ABCD"]) or ORDERS["ABCD"]
    device.parameters += [
        number_parameter(int(lib.MODBUS_PARAM_UNIT), unit or 0, "unit"),
        number_parameter(int(lib.MODBUS_PARAM_TIMEOUT), (timeout_us or 1_000_000) // 1000, "timeout"),
    ]
    for key, writes in (("read", False), ("write", True)):
        device.jobs += each(table.tables(key), lambda t, writes=writes: _read_job(t, writes))  # type: ignore[misc]
    if unit == 0 and serial and any(not j.function.writes for j in device.jobs):
        table.error("unit 0 is all devices of the line, which do not reply: they can be written only", "unit")
    device.channels = [channel for job in device.jobs for channel in job.channels]
    return device


def _read_job(table: Table, writes: bool) -> Job | None:
    known = [code for code, f in FUNCTIONS.items() if f.writes is writes]
    code = table.number("function", 1, 127, None, required=True)
    function = FUNCTIONS.get(code) if code in known and code is not None else None
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
    return Job(function, first, interval_us or 0, on_change, verify, channels, table.pos)


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


def _read_address(table: Table, function: Function | None) -> int | None:
    """The address on the wire, of `address = 40001` or `wire = 0`."""
    wire = table.number("wire", 0, LAST_ADDRESS)
    if "wire" in table:
        if "address" in table:
            table.error("write address or wire, not both", "wire")
        return wire
    address = table.number("address", 1, 465536, None, required=True)
    if address is None or function is None:
        return None
    found = wire_address(address, function.table)
    if found is None:
        table.error(wrong_reference(str(address), function.table), "address")
    return found
