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
    TABLE_NAMES,
    Order,
    cannot_have,
    element_size,
    first_reference,
    fits_coils,
    place,
    reference_of,
    registers_of,
    reverse_for,
    wire_address,
    wrong_reference,
)
from plctool.io.modbus.settings import (
    DRIVER,
    MAX_UNIT,
    counters,
    default_name,
    host_parameters,
    number_parameter,
    serial_settings,
    structure_parameter,
)
from plctool.io.model import HOLD, ZERO, Channel, Connector, Parameter, Substitute, bits_of
from plctool.io.tables import Table, each

_MAX_TIMEOUT_US = 60_000_000
_MAX_RETRIES = 10
_ASK_AGAIN_US = (100_000, 3_600_000_000)
_MAX_INTERVAL_US = 3_600_000_000
_READ_WRITE = int(lib.MODBUS_READ_WRITE_REGISTERS)
_TURNAROUND_US = 5000  # what a device takes to reply, for the load of a line
_TIMEOUT_US = int(lib.MODBUS_TIMEOUT_MS) * 1000
_AROUND = 3  # bytes around a PDU: unit and CRC
_BROADCAST_US = 100_000  # for all devices of a line to do what is asked of them (Modbus over Serial Line 2.4.1)
# By whether the host is found by name, and whether the frames are those of a serial line.
_ROLES = {
    (False, False): int(lib.MODBUS_ROLE_TCP_CLIENT),
    (False, True): int(lib.MODBUS_ROLE_RTU_TCP_CLIENT),
    (True, False): int(lib.MODBUS_ROLE_NAMED_TCP_CLIENT),
    (True, True): int(lib.MODBUS_ROLE_NAMED_RTU_TCP_CLIENT),
}
_REVERSE_FLAGS = {
    1: 0,
    2: int(lib.MODBUS_JOB_REVERSE_2),
    4: int(lib.MODBUS_JOB_REVERSE_4),
    8: int(lib.MODBUS_JOB_REVERSE_8),
}


@dataclass(frozen=True)
class Function:
    """What a function code is. `most_read`, `most_written`: bits or registers of one request, 0: none; `request` and
    `reply`: bytes of their PDU without data."""

    code: int
    table: int
    most_read: int
    most_written: int
    request: int
    reply: int

    @property
    def kind(self) -> str:
        """The table of a description that it is in."""
        return "read_write" if self.most_read and self.most_written else "read" if self.most_read else "write"

    @property
    def of_bits(self) -> bool:
        """Whether it is about bits; else registers."""
        return self.table in (COILS, DISCRETE)


FUNCTIONS = {
    f.code: f
    for f in (
        Function(1, COILS, int(lib.MODBUS_MAX_READ_BITS), 0, 5, 2),
        Function(2, DISCRETE, int(lib.MODBUS_MAX_READ_BITS), 0, 5, 2),
        Function(3, HOLDING, int(lib.MODBUS_MAX_READ_REGISTERS), 0, 5, 2),
        Function(4, INPUT, int(lib.MODBUS_MAX_READ_REGISTERS), 0, 5, 2),
        Function(5, COILS, 0, 1, 5, 5),
        Function(6, HOLDING, 0, 1, 5, 5),
        Function(15, COILS, 0, int(lib.MODBUS_MAX_WRITE_BITS), 6, 5),
        Function(16, HOLDING, 0, int(lib.MODBUS_MAX_WRITE_REGISTERS), 6, 5),
        Function(22, HOLDING, 0, 1, 7, 7),
        Function(23, HOLDING, int(lib.MODBUS_MAX_READ_REGISTERS), int(lib.MODBUS_MAX_READ_WRITE_REGISTERS), 10, 2),
    )
}


@dataclass
class Part:
    """What a job reads, or what it writes. `first`: address on the wire; `count`: bits or registers, once the variables
    are known."""

    first: int
    channels: list[Channel]
    pos: Pos
    count: int = 0

    @property
    def end(self) -> int:
        """The address after the last one."""
        return self.first + self.count


def _nothing() -> Part:
    return Part(0, [], Pos("", 0, 0))


@dataclass
class Job:
    """A read or write of a device, or both at a time. `took_us`: on the line, with the device's reply; `mask`: the bits
    that function 22 writes."""

    function: Function
    interval_us: int
    on_change: bool
    verify: bool
    pos: Pos
    read: Part = field(default_factory=_nothing)
    write: Part = field(default_factory=_nothing)
    took_us: float = 0.0
    mask: int = 0

    @property
    def channels(self) -> list[Channel]:
        """All of them."""
        return self.read.channels + self.write.channels

    @property
    def parts(self) -> list[tuple[Part, int]]:
        """Each with the most that one request has of it."""
        both = ((self.read, self.function.most_read), (self.write, self.function.most_written))
        return [(part, most) for part, most in both if most]


@dataclass(frozen=True)
class Patience:
    """How long a line waits for a device. None: not stated, so the driver's default holds. A device has those of its
    line that it does not state itself."""

    timeout_us: int | None = None
    pause_us: int = 0
    retries: int | None = None
    ask_again_us: int | None = None

    def parameters(self) -> list[Parameter]:
        """Those of a device that are not the driver's defaults; the time-out is always there."""
        made = []
        if self.pause_us:
            made.append(number_parameter(int(lib.MODBUS_PARAM_PAUSE), self.pause_us // 1000, "pause"))
        if self.retries is not None:
            made.append(number_parameter(int(lib.MODBUS_PARAM_RETRIES), self.retries, "retries"))
        if self.ask_again_us is not None:
            made.append(number_parameter(int(lib.MODBUS_PARAM_ASK_AGAIN), self.ask_again_us // 1000, "ask_again"))
        return made


@dataclass(eq=False)
class ModbusLine(Connector):
    """A line of a client. `char_us`: of a serial line, how long a character takes; `load`: share of the time that its
    cyclic requests take."""

    faults = ("absent",)  # it is pulled
    counters = counters("bad_frames")

    is_rtu: bool = False  # frames of a serial line, also on the network
    char_us: float | None = None
    silence_us: float = 0.0
    patience: Patience = Patience()
    devices: list[ModbusDevice] = field(default_factory=list)

    def note_ages(self) -> None:
        """A job that is due waits for each of the others once at most: the one that has been due longest comes next.
        What changes when the device has just begun to reply is in the next reply."""
        jobs = [job for device in self.devices if device.enabled for job in device.jobs]
        round_us = int(sum(job.took_us for job in jobs))
        for job in jobs:
            for channel in job.channels:
                channel.age_us = round_us + max(job.interval_us, int(job.took_us))

    def check_writes(self, mistakes: Mistakes) -> None:
        """Warns of what two writes of one unit have in common: each undoes what the other wrote."""
        seen: list[tuple[ModbusDevice, Job]] = []
        for device in (d for d in self.devices if d.enabled):
            for job in (j for j in device.jobs if j.write.count):
                other = next((j for d, j in seen if d.unit == device.unit and _write_the_same(j, job)), None)
                if other is not None:
                    first = max(job.write.first, other.write.first)
                    last = min(job.write.end, other.write.end) - 1
                    what = f"{TABLE_NAMES[job.function.table]} {reference_of(first, job.function.table)}"
                    what += f" to {reference_of(last, job.function.table)}" if last > first else ""
                    message = f"{what} of {device.name} are written by line {other.write.pos.line} as well"
                    mistakes.warning(job.write.pos, f"{message}: each undoes what the other wrote")
                seen.append((device, job))

    def transaction_us(self, request: int, reply: int) -> float:
        """How long PDUs of these sizes take with all that is around them; 0 on a network."""
        if self.char_us is None:
            return 0.0
        return (request + reply + 2 * _AROUND) * self.char_us + 2 * self.silence_us + _TURNAROUND_US

    def broadcast_us(self, request: int, pause_us: int) -> float:
        """How long a PDU to all devices takes."""
        return (request + _AROUND) * (self.char_us or 0.0) + self.silence_us + pause_us


@dataclass(eq=False)
class ModbusDevice(Connector):
    """A device of a client. `broadcast_us`: of all devices at once, how long the line is left to them after a request;
    `pause_us`: of its line after each request to it."""

    counters = counters("requests", "timeouts", "exceptions", "others", "unverified", "last_exception", "busy")

    broadcast_us: int | None = None
    pause_us: int = 0
    unit: int = 0
    order: Order = ORDERS["ABCD"]
    jobs: list[Job] = field(default_factory=list)

    def complete(self, mistakes: Mistakes) -> None:
        """Makes the jobs, whose sizes are those of the variables."""
        for number, job in enumerate(self.jobs):
            if any(c.variable_type is None for c in job.channels):
                continue
            flags = self._bits(job, mistakes) if job.function.of_bits else self._registers(job, mistakes)
            if flags is None or not _fits(job, mistakes):
                continue
            self._add(number, job, flags)
            self._note_time(job, mistakes)
        self._check_restarts(mistakes)
        line = self.parent
        if isinstance(line, ModbusLine) and self in line.devices[-1:]:
            line.note_ages()
            line.check_writes(mistakes)

    def _check_restarts(self, mistakes: Mistakes) -> None:
        """Warns of a device that is asked on change only: while nothing changes its restart is not seen."""
        if self.enabled and self.jobs and all(job.interval_us == 0 for job in self.jobs):
            message = f"nothing is asked of {self.name} at intervals, so a restart of it is not seen"
            mistakes.warning(self.jobs[0].pos, f'{message}, and its outputs stay off: add every = "T#10s"')

    def _bits(self, job: Job, mistakes: Mistakes) -> int | None:
        for part, _ in job.parts:
            for channel in part.channels:
                assert channel.variable_type is not None
                if not fits_coils(channel.variable_type):
                    mistakes.error(channel.pos, cannot_have(channel, "coils"))
                    return None
                if channel.size_bits > 1 and part.count % 8:
                    message = f"{channel.target} would begin within a byte: name it before variables of type BOOL"
                    mistakes.error(channel.pos, message)
                    return None
                channel.parameter_bit = part.count
                part.count += channel.size_bits
        return 0

    def _registers(self, job: Job, mistakes: Mistakes) -> int | None:
        types = [c.variable_type for c in job.channels if c.variable_type is not None]
        for channel, t in zip(job.channels, types, strict=True):
            if element_size(t) < 0:
                mistakes.error(channel.pos, cannot_have(channel, "registers"))
                return None
        reverse = self._common_reverse(job, types, mistakes)
        if reverse is None:
            return None
        for part, _ in job.parts:
            self._place(part, reverse)
        return _REVERSE_FLAGS[reverse]

    def _place(self, part: Part, reverse: int) -> None:
        for channel in part.channels:
            t = channel.variable_type
            assert t is not None
            channel.parameter_bit = place(t, part.count, reverse, self.order)
            channel.big_endian = element_size(t) >= 2 and reverse != (reverse_for(t, self.order) or 0)
            part.count += registers_of(t)

    def _mask(self, job: Job) -> int:
        """The bits of a register, as it is sent, that its variable has."""
        t = job.channels[0].variable_type
        assert t is not None
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

    def _add(self, number: int, job: Job, flags: int) -> None:
        if job.function.code == lib.MODBUS_MASK_WRITE_REGISTER:
            job.mask = self._mask(job)
        flags |= int(lib.MODBUS_JOB_ON_CHANGE) * job.on_change | int(lib.MODBUS_JOB_VERIFY) * job.verify
        value = ffi.new(
            "MODBUS_JOB *",
            {
                "function": job.function.code,
                "flags": flags,
                "read_address": job.read.first,
                "read_count": job.read.count,
                "write_address": job.write.first,
                "write_count": job.write.count,
                "mask": job.mask,
                "interval_ms": job.interval_us // 1000,
            },
        )
        self.parameters.append(structure_parameter(int(lib.MODBUS_PARAM_JOB) + number, value))
        for channel in job.channels:
            channel.parameter = int(lib.MODBUS_PARAM_JOB) + number

    def _note_time(self, job: Job, mistakes: Mistakes) -> None:
        line = self.parent
        assert isinstance(line, ModbusLine)
        function = job.function
        written = _data_size(function, job.write.count) if function.most_written > 1 else 0
        if self.broadcast_us is not None:
            job.took_us = line.broadcast_us(function.request + written, self.broadcast_us)
        else:
            job.took_us = line.transaction_us(
                function.request + written, function.reply + _data_size(function, job.read.count)
            )
        if job.verify:
            job.took_us += line.transaction_us(5, 2 + _data_size(function, job.write.count)) + self.pause_us
        job.took_us += self.pause_us
        if not self.enabled or line.char_us is None or job.interval_us == 0:
            return
        before = line.load or 0.0
        line.load = before + job.took_us / job.interval_us
        if before <= 1.0 < line.load:
            message = f"the line {line.name} is too slow for all that is asked on it: ask less often, or raise its baud"
            mistakes.warning(job.pos, message)


def _write_the_same(one: Job, other: Job) -> bool:
    """Whether two jobs write the same coils or registers; those of function 22 bits of them."""
    both_masked = one.function.code == other.function.code == lib.MODBUS_MASK_WRITE_REGISTER
    return (
        one.function.table == other.function.table
        and one.write.first < other.write.end
        and other.write.first < one.write.end
        and not (both_masked and one.mask & other.mask == 0)
    )


def _data_size(function: Function, count: int) -> int:
    return -(-count // 8) if function.of_bits else 2 * count


def _fits(job: Job, mistakes: Mistakes) -> bool:
    """Whether one request can have it all; reports it if not."""
    function = job.function
    what = "bits" if function.of_bits else "registers"
    for part, most in job.parts:
        if part.count > most:
            message = f"function {function.code} has {'one' if most == 1 else most} {what if most > 1 else what[:-1]}"
            several = {5: 15, 6: 16}.get(function.code)
            hint = f"use {several}" if several is not None else "name the others in a further table"
            if function.code == lib.MODBUS_MASK_WRITE_REGISTER:
                hint = "it is for a variable of at most 16 bits"
            mistakes.error(part.pos, f"{message} at most, these are {part.count}: {hint}")
            return False
        if part.first + part.count - 1 > LAST_ADDRESS:
            mistakes.error(part.pos, f"{part.count} {what} from here on are more than the last address")
            return False
    return True


# ---- reading ---------------------------------------------------------------------------------------------------------


def read_serial_client(table: Table) -> list[Connector]:
    """A serial line of this PLC, and its devices."""
    line = read_connector(ModbusLine, table, DRIVER, default_name=default_name(table, "port"))
    line.parameters.append(number_parameter(int(lib.MODBUS_PARAM_ROLE), int(lib.MODBUS_ROLE_SERIAL_CLIENT)))
    baud, bits = serial_settings(table, line)
    line.is_rtu = True
    line.char_us = bits * 1e6 / baud
    line.silence_us = 1750.0 if baud > 19200 else 3.5 * line.char_us
    line.patience = _read_patience(table, Patience())
    return [line, *_read_devices(table, line)]


def read_tcp_client(table: Table) -> list[Connector]:
    """A device on the network, or a gateway and the devices at it."""
    line = read_connector(ModbusLine, table, DRIVER, default_name=default_name(table, "host"))
    line.is_rtu = bool(table.choice("framing", {"tcp": False, "rtu": True}, False))
    by_name, place = host_parameters(table)
    line.parameters.append(number_parameter(int(lib.MODBUS_PARAM_ROLE), _ROLES[by_name, line.is_rtu]))
    line.parameters += place
    line.patience = _read_patience(table, Patience())
    return [line, *_read_devices(table, line)]


def _read_patience(table: Table, of_line: Patience) -> Patience:
    """Of a line or a device, which has that of its line unless it says otherwise."""
    return Patience(
        table.duration_us("timeout", 1000, _MAX_TIMEOUT_US, of_line.timeout_us),
        table.duration_us("pause", 0, _MAX_TIMEOUT_US, of_line.pause_us) or 0,
        table.number("retries", 0, _MAX_RETRIES, of_line.retries),
        table.duration_us("ask_again", *_ASK_AGAIN_US, of_line.ask_again_us),
    )


def _read_devices(table: Table, line: ModbusLine) -> list[Connector]:
    devices = each(table.tables("device"), lambda t: _read_device(t, line))
    _warn_of_equal_units(line, table.mistakes)
    return list(devices)


def _warn_of_equal_units(line: ModbusLine, mistakes: Mistakes) -> None:
    """Two devices with one unit are one that is described twice, which its orders of bytes may need, or a mistake."""
    seen: dict[tuple[int, Order], ModbusDevice] = {}
    for device in (d for d in line.devices if d.enabled):
        first = seen.setdefault((device.unit, device.order), device)
        if first is not device:
            message = f"{device.name} has the unit {device.unit} of {first.name} in line {first.pos.line}"
            mistakes.warning(device.pos, f"{message}: both are one device; give it its own unit, or one table")


def _read_device(table: Table, line: ModbusLine) -> Connector:
    serial = line.is_rtu
    device = read_connector(ModbusDevice, table, DRIVER, parent=line)
    line.devices.append(device)
    unit = table.number("unit", 0, MAX_UNIT if serial else 255, None if serial else 255, required=1 if serial else None)
    device.unit = unit or 0
    to_all = serial and unit == 0
    of_line = replace(line.patience, timeout_us=None) if to_all else line.patience
    patience = _read_patience(table, of_line)
    timeout_us = patience.timeout_us or (_BROADCAST_US if to_all else _TIMEOUT_US)
    device.broadcast_us = timeout_us if to_all else None
    device.pause_us = patience.pause_us
    device.order = table.choice("order", ORDERS, ORDERS["ABCD"]) or ORDERS["ABCD"]
    device.parameters += [
        number_parameter(int(lib.MODBUS_PARAM_UNIT), unit or 0, "unit"),
        number_parameter(int(lib.MODBUS_PARAM_TIMEOUT), timeout_us // 1000, "timeout"),
        *patience.parameters(),
    ]
    for kind in ("read", "write", "read_write"):
        device.jobs += each(table.tables(kind), lambda t, kind=kind: _read_job(t, kind))  # type: ignore[misc]
    if to_all and any(j.function.most_read or j.verify for j in device.jobs):
        table.error("unit 0 is all devices of the line, which do not reply: they can be written only", "unit")
    device.channels = [channel for job in device.jobs for channel in job.channels]
    return device


def _read_job(table: Table, kind: str) -> Job | None:
    function = _read_function(table, kind)
    on_change = kind == "write" and table.flag("on_change")
    table.belongs("it is a key of the device", "order", "unit", "timeout", "pause", "retries", "ask_again")
    if kind == "read":
        table.belongs("only what is written has it", "verify", "on_change", "on_stop")
    if kind == "write" and not on_change and "on_change" not in table and "every" not in table:
        table.error(f'[{table.name}] needs every = "T#1s" or on_change = true, or both')
    needed = kind != "write"
    interval_us = table.duration_us("every", 1000, _MAX_INTERVAL_US, None, required="T#100ms" if needed else "")
    verify = kind != "read" and table.flag("verify")
    read, write = _nothing(), _nothing()
    if kind != "write":
        read = _read_part(table, kind, function, writes=False)
    if kind != "read":
        write = _read_part(table, kind, function, writes=True)
    if function is None or (interval_us is None and not on_change):
        return None
    job = Job(function, interval_us or 0, on_change, verify, table.pos, read, write)
    if not all(part.channels for part, _ in job.parts):
        return None
    if function.most_written == 1 and len(write.channels) > 1:
        table.error(f"function {function.code} writes one variable; use {15 if function.of_bits else 16}", "vars")
        return None
    return job


def _read_function(table: Table, kind: str) -> Function | None:
    known = [code for code, f in FUNCTIONS.items() if f.kind == kind]
    if known == [_READ_WRITE]:
        code = table.number("function", 1, 127, _READ_WRITE)
    else:
        code = table.number("function", 1, 127, None, required=3)
    if code is None or code in known:
        return FUNCTIONS.get(code or 0)
    verb = "read and write at a time" if kind == "read_write" else kind
    table.error(f"function {code} cannot be here: to {verb} there are {', '.join(map(str, known))}", "function")
    return None


def _read_part(table: Table, kind: str, function: Function | None, *, writes: bool) -> Part:
    """What a job reads or writes: it has a table of its own where there are both. Without channels after a mistake."""
    if kind != "read_write":
        return _read_variables(table, function, writes=writes)
    key = "write" if writes else "read"
    inner = table.table(key)
    if inner is None:
        if key not in table:
            message = f"[{table.name}] reads and writes: add a table [{table.name}.{key}] with its address and vars"
            table.error(message)
        return _nothing()
    part = _read_variables(inner, function, writes=writes)
    inner.close()
    return part


def _read_variables(table: Table, function: Function | None, *, writes: bool) -> Part:
    channels = _job_channels(table, writes)
    first = _read_address(table, function)
    return _nothing() if first is None or not channels else Part(first, channels, table.pos)


def _job_channels(table: Table, writes: bool) -> list[Channel]:
    """Of `var = ""`, or of `vars = []`, one after the other."""
    if not table.only_one("var", "vars"):
        return []
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
    if not table.only_one("address", "wire"):
        return None
    wire = table.number("wire", 0, LAST_ADDRESS)
    if "wire" in table:
        return wire
    example = first_reference(function.table) if function else 40001
    address = table.number("address", None, None, None, required=example)
    if address is None or function is None:
        return None
    found = wire_address(address, function.table)
    if found is None:
        table.error(wrong_reference(str(address), function.table), "address")
    return found
