"""Traces: what a controller is asked to record, and what it has recorded (group 0x60, docs/protocol.md)."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Protocol

from plctool.core import lib
from plctool.debug.forced import ForcedPlace, name_forced, place_of
from plctool.debug.recording import Column, Recording, number_reader
from plctool.debug.symbols import SymbolTable
from plctool.debug.variables import Symbol
from plctool.errors import DeviceError, UsageError, with_article
from plctool.iec.types import ELEMENTARY, Elementary, Kind, PointerType, StringType, base_of
from plctool.link import bintag, l7
from plctool.link.services import TaskInfo
from plctool.link.session import Session
from plctool.link.wire import Layout

_CONFIG = Layout("TRACE_CONFIG")
_PLACE = Layout("MON2_PLACE")
_STATE = Layout("TRACE_STATE")
_OFFSETS = struct.Struct("<4I")
_NAME_SIZE = 15
_TIME = 2  # values of a sample before its records: low and high half
_COMPARISONS = {
    "<": lib.TRACE_LESS,
    "<=": lib.TRACE_LESS | lib.TRACE_EQUAL,
    "=": lib.TRACE_EQUAL,
    ">=": lib.TRACE_GREATER | lib.TRACE_EQUAL,
    ">": lib.TRACE_GREATER,
    "<>": lib.TRACE_LESS | lib.TRACE_GREATER,
}
_CONDITION = re.compile(r"\s*(.*?)\s*(<=|>=|<>|<|>|=)\s*(.+?)\s*")
_NOT = re.compile(r"\s*NOT\b\s*(.+?)\s*", re.IGNORECASE)
_RECORD_SIZES = (1, 2, 4)  # bytes
TRACE_FILE = "trace."  # persistent traces are files of the controller; TRACE_FILE of CmpTraceMgr.h
_Number = Callable[[bytes], int | float]
_SYSTEM_TYPE = ELEMENTARY["LREAL"]

# Values of the system: where the device has them, what it counts is divided by, unit.
SYSTEM_VALUES = {
    "@cycle": (lib.TRACE_CYCLE_NS, 1000.0, "us"),
    "@late": (lib.TRACE_LATE_NS, 1000.0, "us"),
    "@load": (lib.TRACE_CYCLE_NS, 0.0, "%"),  # by the interval of the task
}


@dataclass(frozen=True)
class TraceOptions:
    """How a trace records. `samples`: how many in all, None without end. `before`: how many of them from before the
    trigger. `level`: the trigger need not have been false before. `keep`: without a tool that asks for it."""

    every: int = 1
    samples: int | None = None
    trigger: str | None = None
    before: int = 0
    level: bool = False
    name: str = ""
    keep: bool = False


@dataclass(frozen=True)
class TraceState:
    """What a controller says of a packet; samples are numbered from 0. `samples` are those from `first` on, each the
    time [ns] and the bytes of the records."""

    state: int
    written: int
    trigger: int
    first: int
    capacity: int
    samples: list[tuple[int, bytes]] = field(default_factory=list)


@dataclass(frozen=True)
class TraceConfig:
    """A packet on a controller, as its records are there: the larger ones first. `trigger`: what it compares."""

    image_crc: int
    name: str
    flags: int
    task: int
    every: int
    samples: int
    before: int
    places: list[ForcedPlace]
    trigger: ForcedPlace | None
    data: bytes

    def is_about(self, symbols: Sequence[Symbol], tasks: Collection[int] = ()) -> bool:
        """True if it records or compares one of these variables, or by way of one, or is of one of these tasks."""
        places = [*self.places, *([] if self.trigger is None else [self.trigger])]
        return self.task in tasks or any(place.needs(symbol) for place in places for symbol in symbols)

    def for_image(self, image_crc: int) -> bytes:
        """The same for another application, in which what it is about is at the same places."""
        head = _CONFIG.unpack(self.data)._asdict()
        return _CONFIG.pack(**head | {"image_crc": image_crc}) + self.data[_CONFIG.size :]

    @property
    def is_kept(self) -> bool:
        return bool(self.flags & lib.TRACE_KEEP)

    @property
    def sizes(self) -> list[int]:
        return [place.size for place in self.places]


class TraceAccess(Protocol):
    """What a controller does with packets, each in its way. Raises DeviceError with the device's result."""

    def create_trace(self, config: bytes) -> int: ...
    def delete_trace(self, packet: int) -> None: ...
    def next_trace(self, packet: int) -> tuple[int, bytes] | None: ...
    def read_trace(self, packet: int, first: int, sizes: Sequence[int]) -> TraceState: ...


# ---- configurations --------------------------------------------------------------------------------------------------


def columns_of(table: SymbolTable, names: Sequence[str]) -> list[Column]:
    """The variables, all values of structures and arrays, and the system values by these names. Raises UsageError for
    what cannot be traced."""
    columns = []
    for name in names:
        if name.startswith("@"):
            columns.append(_system_column(name))
            continue
        found = table.scalars([name])
        columns += [Column.of(own, _traceable(symbol)) for own, symbol in found.items()]
    unique = {column.name.casefold(): column for column in columns}
    if not unique:
        raise UsageError("Name what is to be traced, such as Main.speed or '@cycle'.", "usage")
    return list(unique.values())


def _system_column(name: str) -> Column:
    found = SYSTEM_VALUES.get(name.casefold())
    if found is None:
        raise UsageError(f"There is no value {name}; there are {', '.join(SYSTEM_VALUES)}.", "unknown-variable")
    return Column(name.casefold(), _SYSTEM_TYPE, found[2])


def _traceable(symbol: Symbol) -> Symbol:
    if symbol.fixed is not None:
        raise UsageError(f"{symbol.name} is a constant, whose value does not change.", "not-traceable")
    if isinstance(symbol.type, StringType):
        raise UsageError(f"{symbol.name} is a string, which cannot be traced; read it.", "not-traceable")
    if isinstance(symbol.type, PointerType) or not isinstance(base_of(symbol.type), Elementary):
        raise UsageError(f"{symbol.name} is {with_article(symbol.type)}, which cannot be traced.", "not-traceable")
    if len(symbol.place[2]) > lib.PLACE_POINTERS:
        raise UsageError(
            f"{symbol.name} is at the end of more than {lib.PLACE_POINTERS} pointers; trace it by the name that it was "
            "declared with.",
            "pointers",
        )
    return symbol


def encode_config(
    table: SymbolTable, columns: Sequence[Column], task: int, interval_us: int, options: TraceOptions
) -> bytes:
    """What a packet for these columns is created with. Raises UsageError for an invalid trigger."""
    _check_options(options)
    places = [place for place, _ in _records(columns)]
    if len(places) > lib.TRACE_MAX_RECORDS:
        raise UsageError(
            f"A trace takes at most {lib.TRACE_MAX_RECORDS} values, of 8 bytes half as many; name fewer than "
            f"{len(columns)}.",
            "too-many",
        )
    flags = lib.TRACE_KEEP if options.keep else 0
    trigger: dict[str, Any] = {}
    if options.trigger is not None:
        more, trigger = _trigger(table, options.trigger, interval_us)
        flags |= more | (lib.TRACE_LEVEL if options.level else 0)
    head = _CONFIG.pack(
        image_crc=table.image_crc,
        name=options.name.encode("ascii"),
        flags=flags,
        task=task,
        records=len(places),
        every=options.every,
        samples=options.samples or 0,
        before=options.before,
        **trigger,
    )
    return head + b"".join(_PLACE.pack(**_members(place)) for place in places)


def _check_options(options: TraceOptions) -> None:
    if options.every < 1:
        raise UsageError("A trace records every cycle (1), or every n-th one; n is 1 or more.", "usage")
    if options.samples is not None and options.samples < 1:
        raise UsageError("A trace has at least one sample.", "usage")
    if options.before and options.trigger is None:
        raise UsageError("Samples from before the trigger need a trigger; add one, such as 'Main.x > 5'.", "usage")
    if options.before and options.samples is not None and options.before >= options.samples:
        raise UsageError("Less than all samples can be from before the trigger.", "usage")
    if options.name and not re.fullmatch(rf"[A-Za-z0-9_-]{{1,{_NAME_SIZE}}}", options.name):
        raise UsageError(f"{options.name!r} cannot be a name: up to {_NAME_SIZE} letters, digits, _ and -.", "usage")


def _records(columns: Sequence[Column]) -> list[tuple[ForcedPlace, tuple[int, int]]]:
    """The places of all columns as the device takes them: values of 8 bytes in halves, the larger ones first; with each
    the column and the byte of its value where it belongs."""
    records = []
    for index, column in enumerate(columns):
        place = _system_place(column) if column.symbol is None else place_of(column.symbol)
        step = min(place.size, 4)
        records += [(_part(place, at, step), (index, at)) for at in range(0, place.size, step)]
    return sorted(records, key=lambda record: -record[0].size)


def _system_place(column: Column) -> ForcedPlace:
    return ForcedPlace(lib.TRACE_SYSTEM, SYSTEM_VALUES[column.name][0], (), 4)


def _part(place: ForcedPlace, at: int, size: int) -> ForcedPlace:
    way = (place.offset, *place.hops)
    first, *rest = (*way[:-1], way[-1] + at)
    return replace(place, offset=first, hops=tuple(rest), size=size)


def _members(place: ForcedPlace) -> dict[str, Any]:
    way = [place.offset, *place.hops]
    offsets = _OFFSETS.pack(*way, *[0] * (1 + lib.PLACE_POINTERS - len(way)))
    return {"area": place.area, "pointers": len(place.hops), "size": place.size, "mask": place.mask, "offset": offsets}


def _trigger(table: SymbolTable, text: str, interval_us: int) -> tuple[int, dict[str, Any]]:
    """Flags and members of the configuration."""
    name, comparison, value = _parse_condition(text)
    if name.startswith("@"):
        return _system_trigger(_system_column(name), comparison, value, interval_us)
    symbol = _traceable(table.resolve(name))
    column = Column.of(symbol.name, symbol)
    if value is None and not column.is_bool:
        raise UsageError(f"{symbol.name} is no BOOL; write for example '{symbol.name} > 5'.", "trigger")
    wanted = comparison != "<>" if value is None else symbol.parse(value)
    comparison = "=" if value is None else comparison
    constant = symbol.change(wanted).data
    base = base_of(column.type)
    assert isinstance(base, Elementary)
    flags = lib.TRACE_REAL if base.kind is Kind.REAL else lib.TRACE_SIGNED if base.signed else 0
    if flags & lib.TRACE_REAL and symbol.decode(constant) != symbol.decode(constant):
        raise UsageError("NAN is not less than, equal to or greater than any value.", "trigger")
    members = _members(place_of(symbol))
    return lib.TRACE_TRIGGER | flags, {**members, **_comparison(comparison, int.from_bytes(constant, "little"))}


def _parse_condition(text: str) -> tuple[str, str, str | None]:
    """Name, comparison and value; without a value "=" or "<>" for a BOOL that is to be TRUE or FALSE."""
    match = _CONDITION.fullmatch(text)
    if match:
        if not match[1]:
            raise UsageError(f"The trigger '{text}' has no variable; write for example 'Main.x > 5'.", "trigger")
        return match[1], match[2], match[3]
    if negated := _NOT.fullmatch(text):
        return negated[1], "<>", None
    if not text.strip():
        raise UsageError("The trigger is empty; write for example 'Main.x > 5'.", "trigger")
    return text.strip(), "=", None


def _system_trigger(column: Column, comparison: str, value: str | None, interval_us: int) -> tuple[int, dict[str, Any]]:
    try:
        number = float(value or "")
    except ValueError:
        advice = f"compare it with one, as in '{column.name} > 500'"
        raise UsageError(f"{column.name} is a number [{column.unit}]; {advice}.", "trigger") from None
    raw = round(number * _scale(column, interval_us))
    if not 0 <= raw < 1 << 32:
        raise UsageError(f"{column.name} is never {value} {column.unit}.", "trigger")
    return lib.TRACE_TRIGGER, {**_members(_system_place(column)), **_comparison(comparison, raw)}


def _comparison(comparison: str, constant: int) -> dict[str, int]:
    return {"comparison": _COMPARISONS[comparison], "constant": constant}


def _scale(column: Column, interval_us: int) -> float:
    """How many ns are 1 of what is shown."""
    return SYSTEM_VALUES[column.name][1] or interval_us * 10.0


def decode_config(data: bytes) -> TraceConfig:
    """A packet as the controller has it. Raises DeviceError for what is none."""
    if len(data) < _CONFIG.size:
        raise bintag.malformed("a trace is cut off")
    head = _CONFIG.unpack(data)
    places = [_place(entry) for entry in _PLACE.unpack_each(data[_CONFIG.size :])]
    if len(places) != head.records:
        raise bintag.malformed("records of a trace are missing")
    name = head.name.split(b"\0", 1)[0].decode("ascii", "replace")
    trigger = _place(head, (*_RECORD_SIZES, 8)) if head.flags & lib.TRACE_TRIGGER else None
    return TraceConfig(
        head.image_crc, name, head.flags, head.task, head.every, head.samples, head.before, places, trigger, data
    )


def _place(entry: Any, sizes: Sequence[int] = _RECORD_SIZES) -> ForcedPlace:
    offset, *hops = _OFFSETS.unpack(entry.offset)
    if entry.pointers > lib.PLACE_POINTERS or entry.size not in sizes:
        raise bintag.malformed("a trace has an invalid place")
    return ForcedPlace(entry.area, offset, tuple(hops[: entry.pointers]), entry.size, entry.mask)


def columns_on(config: TraceConfig, table: SymbolTable | None) -> list[Column]:
    """What a packet records, by the names of the program."""
    variables = list(table.variables.values()) if table else []
    system = {offset: name for name, (offset, _, _) in reversed(SYSTEM_VALUES.items())}
    columns, at = [], 0
    while at < len(config.places):
        place = config.places[at]
        if place.area == lib.TRACE_SYSTEM:
            columns.append(_system_column(system.get(place.offset, "@cycle")))
            at += 1
            continue
        halves = [place, _part(place, 4, 4)]
        whole = replace(place, size=8)
        joined = config.places[at : at + 2] == halves and _named(whole, variables)
        found = joined or _named(place, variables) or next(iter(name_forced([place], []).values()))[0]
        columns.append(Column.of(found.name, found))
        at += 2 if joined else 1
    return columns


def _named(place: ForcedPlace, variables: list[Symbol]) -> Symbol | None:
    found = next(iter(name_forced([place], variables).values()))[0]
    in_program = name_forced([place], []).keys()
    return None if found.name in in_program else found


# ---- samples ---------------------------------------------------------------------------------------------------------


def unpack_samples(data: bytes, count: int, sizes: Sequence[int]) -> list[tuple[int, bytes]]:
    """The samples of a message; `sizes` of the records. Raises DeviceError when it is cut off."""
    widths = [4] * _TIME + list(sizes)
    masks = [(1 << 8 * width) - 1 for width in widths]
    head, at = (len(widths) + 7) // 8, 0
    last = last_but_one = [0] * len(widths)
    samples = []
    try:
        for number in range(count):
            bits = int.from_bytes(data[at : at + head], "little")
            at += head
            values = []
            for index, mask in enumerate(masks):
                by = 0
                if bits >> index & 1:
                    by, at = _number(data, at)
                slope = last[index] - last_but_one[index] if number > 1 else 0
                values.append(last[index] + slope + by & mask)
            last, last_but_one = values, last
            content = b"".join(v.to_bytes(w, "little") for v, w in zip(values[_TIME:], sizes, strict=True))
            samples.append((values[1] << 32 | values[0], content))
    except IndexError:
        raise bintag.malformed("samples are cut off") from None
    return samples


def _number(data: bytes, at: int) -> tuple[int, int]:
    """A number of 7 bits a byte, with its sign in the lowest bit; and where it ends."""
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            return (value >> 1) ^ -(value & 1), at


def decode_state(state: bytes, samples: bytes, sizes: Sequence[int]) -> TraceState:
    """What TRACE_STATE and the packed samples with it say."""
    if len(state) < _STATE.size:
        raise bintag.malformed("the state of a trace is cut off")
    s = _STATE.unpack(state)
    if s.count > len(samples):
        raise bintag.malformed("samples are missing")
    return TraceState(s.state, s.written, s.trigger, s.first, s.capacity, unpack_samples(samples, s.count, sizes))


# ---- a trace that runs -----------------------------------------------------------------------------------------------


class RunningTrace:
    """A packet on a controller, and what has been read of it. As a context manager it ends the packet, unless that is
    kept."""

    def __init__(
        self, access: TraceAccess, packet: int, config: TraceConfig, columns: Sequence[Column], task: TaskInfo
    ) -> None:
        self.config = config
        self.recording = Recording(task.name, task.interval_us, list(columns))
        self.recording.values = [[] for _ in columns]
        self._access = access
        self._packet = packet
        self._next: int | None = None  # the sample to be read next, once it is known
        self._state = TraceState(lib.TRACE_WAITING, 0, 0, 0, 0)
        self._readers = self._make_readers()
        self._ended = False

    def _make_readers(self) -> list[_Number]:
        """For each column what makes its number of the bytes of all records."""
        columns = self.recording.columns
        parts: dict[int, list[tuple[int, int, int]]] = {}
        at = 0
        for place, (owner, byte) in _records(columns):
            parts.setdefault(owner, []).append((byte, at, place.size))
            at += place.size
        readers: list[_Number] = []
        for index, column in enumerate(columns):
            where = [(at, size) for _, at, size in sorted(parts[index])]
            scale = None if column.symbol else _scale(column, self.recording.interval_us)
            number = number_reader(column) if scale is None else _system_reader(scale)
            readers.append(partial(_read_parts, where, number))
        return readers

    @property
    def state(self) -> TraceState:
        """As it was read last."""
        return self._state

    @property
    def is_waiting(self) -> bool:
        return bool(self._state.state == lib.TRACE_WAITING)

    @property
    def is_complete(self) -> bool:
        return self.recording.complete

    def poll(self) -> int:
        """Reads what has been recorded meanwhile, as much as fits a message; how many samples came. Raises DeviceError
        when the packet has ended."""
        if self._next is None:
            state = self._read(self._state.written)
            if state.state == lib.TRACE_WAITING:
                return 0
            self._next = max(0, state.trigger - self.config.before)
        asked = self._next
        state = self._read(asked)
        self._take(state, asked)
        self.recording.complete = state.state == lib.TRACE_COMPLETE and self._next == state.written
        return len(state.samples)

    def _read(self, first: int) -> TraceState:
        state = self._access.read_trace(self._packet, first, self.config.sizes)
        if state.written < first:
            raise DeviceError("The trace has begun again: the controller was restarted meanwhile.", "trace-restarted")
        self._state = state
        return state

    def _take(self, state: TraceState, asked: int) -> None:
        recording = self.recording
        if self.config.flags & lib.TRACE_TRIGGER and recording.trigger is None and state.samples:
            recording.trigger = max(0, state.trigger - state.first)
        recording.lost += state.first - asked
        for time, content in state.samples:
            recording.times_ns.append(time)
            for values, reader in zip(recording.values, self._readers, strict=True):
                values.append(reader(content))
        self._next = state.first + len(state.samples)

    def end(self) -> None:
        """Deletes the packet; harmless when it has ended by itself."""
        if not self._ended:
            self._ended = True
            try:
                self._access.delete_trace(self._packet)
            except DeviceError as error:
                if error.result != lib.ERR_INVALIDID:
                    raise

    def __enter__(self) -> RunningTrace:
        return self

    def __exit__(self, *exc: object) -> None:
        if not self.config.is_kept or not self.config.name:
            self.end()


def _read_parts(where: Sequence[tuple[int, int]], number: _Number, content: bytes) -> int | float:
    if len(where) == 1:
        at, size = where[0]
        return number(content[at : at + size])
    return number(b"".join(content[at : at + size] for at, size in where))


def _system_reader(scale: float) -> _Number:
    return lambda data: int.from_bytes(data, "little") / scale


# ---- on a link -------------------------------------------------------------------------------------------------------


def create(session: Session, config: bytes) -> int:
    """Begins a packet and returns its id. Not repeated when it is unknown whether it was begun: a packet that no tool
    asks for ends by itself."""
    tags = [bintag.raw(lib.TAG_TRACE_CONFIG, config)]
    with explained():
        reply = session.recover(partial(session.call, lib.SG_TRACE, lib.SRV_TRACE_CREATE, tags), repeatable=False)
    if reply.find(lib.TAG_TRACE_RESULT) is not None:
        raise bad_place(reply.u32(lib.TAG_TRACE_RESULT))
    return reply.u32(lib.TAG_TRACE_ID)


def bad_place(error: int) -> DeviceError:
    name = l7.monitoring_error_name(error)
    return DeviceError(f"The controller cannot trace one of the variables: {name}.", l7.slug(name), error)


def delete(session: Session, packet: int) -> None:
    tags = [bintag.u32(lib.TAG_TRACE_ID, packet)]
    with explained():
        session.recover(partial(session.call, lib.SG_TRACE, lib.SRV_TRACE_DELETE, tags))


def next_packet(session: Session, packet: int) -> tuple[int, bytes] | None:
    """Id and configuration of the packet after another one; None after the last one."""
    tags = [bintag.u32(lib.TAG_TRACE_ID, packet)]
    with explained():
        reply = session.recover(partial(session.call, lib.SG_TRACE, lib.SRV_TRACE_LIST, tags))
    if reply.find(lib.TAG_TRACE_ID) is None:
        return None
    return reply.u32(lib.TAG_TRACE_ID), reply.bytes(lib.TAG_TRACE_CONFIG)


def read(session: Session, packet: int, first: int, sizes: Sequence[int]) -> TraceState:
    tags = [bintag.u32(lib.TAG_TRACE_ID, packet), bintag.u32(lib.TAG_TRACE_FROM, first)]
    with explained():
        reply = session.recover(partial(session.call, lib.SG_TRACE, lib.SRV_TRACE_READ, tags))
    samples = reply.find(lib.TAG_TRACE_SAMPLES)
    return decode_state(reply.bytes(lib.TAG_TRACE_STATE), samples or b"", sizes)


@contextmanager
def explained() -> Iterator[None]:
    """Says the errors of a controller in words."""
    try:
        yield
    except DeviceError as error:
        if error.result not in _WORDS:
            raise
        code, words = _WORDS[error.result]
        raise DeviceError(words, code, error.result) from None


_WORDS = {
    lib.ERR_L7_UNKNOWNCMDGROUP: (
        "no-trace",
        "This firmware cannot trace. Build it with TRACE_BUFFER and HAS_CmpTraceMgr (docs/trace.md).",
    ),
    lib.ERR_NOMEMORY: (
        "trace-full",
        "The controller has no room for this trace. Take fewer variables, or fewer samples from before the trigger, or "
        "end another trace; 'plctool trace --list' shows them.",
    ),
    lib.ERR_INVALIDID: (
        "trace-ended",
        "The trace has ended: by a download, a reset, another tool, or because it was not read for "
        f"{lib.TRACE_IDLE_MS // 1000} s.",
    ),
    lib.ERR_APP_INVALID_DATAID: ("app-changed", "Another application was loaded meanwhile; begin again."),
}
