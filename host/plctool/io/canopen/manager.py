"""`[[canopen]]`: CANopen nodes that this PLC manages (IoDrvCanopen).

    [[canopen]]
    name = "Bus"
    node = 127                             # our own number, for our heartbeat
    [[canopen.device]]
    name = "Valves"
    node = 9
    eds = "valves.eds"
    heartbeat = "T#200ms"
    set = { "2001" = 700 }
    in  = { "6000:01" = "Main.inputs", "6000:01.3" = "Main.door", "6401:01" = "Main.pressure" }
    out = { "6200:01" = "Main.valves" }

A key is an object, INDEX:SUB in hex, perhaps with the number of a bit. The tool lays out the PDOs and writes them into
the concise DCF that the manager brings into the node. docs/canopen.md.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from plctool.core import ffi, lib
from plctool.errors import UsageError
from plctool.files import check_inside
from plctool.iec.types import BYTE, LREAL, REAL, UDINT, ArrayType, StringType, Type
from plctool.io.canopen.data_types import Value
from plctool.io.canopen.dcf import heartbeat_ms, writes_of_dcf
from plctool.io.canopen.eds import WRITABLE, Eds, load_eds
from plctool.io.canopen.eds import Entry as EdsEntry
from plctool.io.canopen.pdo_layout import FREE_COBS, Direction, Item, Layout, lay_out
from plctool.io.channels import channel_of
from plctool.io.common import read_connector
from plctool.io.mistakes import Mistakes
from plctool.io.model import Connector, Context, Parameter
from plctool.io.tables import Entry, Table, each

DRIVER = "IoDrvCanopen"
MAX_NODE = 127
_PLACE = re.compile(r"([0-9A-Fa-f]{4})(?::([0-9A-Fa-f]{1,2}))?(?:\.(\d{1,2}))?")
_GUARD_TIME, _LIFE_TIME_FACTOR, _HEARTBEAT = 0x100C, 0x100D, 0x1017
_TYPE, _IDENTITY = 0x1000, 0x1018
_DEFAULT_HEARTBEAT_US = 200_000
_DURATION_US = (10_000, 30_000_000)
_SYNC_US = (1000, 10_000_000)
_TIME_US = (100_000, 86_400_000_000)
_SYNC_COUNTER, LAST_SYNC_COUNTER = 0x1019, 240
_LATE = 5  # halves of its event timer until an input is late
_ON_CHANGE, _ON_SYNC = 255, 1  # transmission types
_CHANNEL_BITS = (1, 8, 16, 32, 64)
_MAX_LIFE, _DEFAULT_LIFE = 255, 3
_ON_LOST = {
    "continue": int(lib.CANOPEN_LOST_CONTINUE),
    "safe": int(lib.CANOPEN_LOST_SAFE),
    "stop": int(lib.CANOPEN_LOST_STOP),
}


@dataclass(eq=False)
class CanopenLine(Connector):
    """A network."""

    faults = ("cut",)
    node: int = 0
    sync: bool = False
    sync_counter: int = 0
    network: int = 0
    nodes: dict[int, str] = field(default_factory=dict)
    free_cobs: list[int] = field(default_factory=lambda: list(FREE_COBS))


@dataclass(eq=False)
class CanopenDevice(Connector):
    """A node. `writes`: its concise DCF, in order."""

    faults = ("absent", "late", "type", "answers")
    counters = {
        name: int(getattr(lib, f"CANOPEN_PARAM_{name.upper()}"))
        for name in ("boots", "lost", "timeouts", "aborts", "last_abort", "emcy", "last_emcy", "short", "state")
    }

    node: int = 0
    eds: Eds | None = None
    writes: list[tuple[int, int, bytes]] = field(default_factory=list)

    @property
    def contents(self) -> dict[str, str]:
        """The EDS or DCF."""
        return {} if self.eds is None else {self.eds.file: self.eds.text}

    def add(self, number: int, value: int, name: str = "") -> None:
        """A parameter of 32 bits."""
        self.parameters.append(Parameter(number, UDINT, value, name))

    def add_bytes(self, number: int, value: bytes, name: str = "") -> None:
        """A parameter of bytes."""
        self.parameters.append(Parameter(number, ArrayType(BYTE, ((0, len(value) - 1),)), value, name))


def read_canopen(table: Table, context: Context) -> list[Connector]:
    """A network and its nodes."""
    line = read_connector(CanopenLine, table, DRIVER, default_name="canopen")
    network = table.number("network", 0, 15, 0) or 0
    line.network = network
    line.takes = f"the CAN network {network}"
    line.node = table.number("node", 1, MAX_NODE) or 0
    sync = _read_sync(table, line.name)
    line.sync = sync.kind != lib.CANOPEN_SYNC_NONE
    heartbeat = table.duration_us("heartbeat", *_DURATION_US, _DEFAULT_HEARTBEAT_US) or 0
    for number, value, name in (
        (lib.CANOPEN_PARAM_NETWORK, network, "network"),
        (lib.CANOPEN_PARAM_NODE, line.node, "node"),
        (lib.CANOPEN_PARAM_HEARTBEAT, heartbeat // 1000, "heartbeat"),
        (lib.CANOPEN_PARAM_SYNC, sync.kind, "sync"),
        (lib.CANOPEN_PARAM_SYNC_EVERY, sync.every_us, "sync_every"),
        (lib.CANOPEN_PARAM_SYNC_WINDOW, sync.window_us, "sync_window"),
        (lib.CANOPEN_PARAM_SYNC_COUNTER, sync.counter, "sync_counter"),
        (lib.CANOPEN_PARAM_TIME, (table.duration_us("time", *_TIME_US) or 0) // 1000, "time"),
    ):
        line.parameters.append(Parameter(int(number), UDINT, value, name))
    for number, event, name in sync.events(line.name):
        line.parameters.append(Parameter(number, StringType(len(event)), event, name))
    line.parameters.sort(key=lambda p: p.id)
    line.sync_counter = sync.counter
    line.nodes = context.nodes.setdefault(network, line.nodes)
    take_number(table, line.nodes, line.node, "this PLC")
    return [line, *each(table.tables("device"), lambda inner: _read_device(inner, line))]


@dataclass
class Sync:
    """Who sends SYNC (`kind`: CANOPEN_SYNC_*), how often, the end of its window, how far it counts; 0: it has none."""

    kind: int = int(lib.CANOPEN_SYNC_NONE)
    every_us: int = 0
    window_us: int = 0
    counter: int = 0

    def events(self, line: str) -> Iterator[tuple[int, str, str]]:
        """Those that tasks may wait for: the parameter, the name, the name of the parameter."""
        if self.kind != lib.CANOPEN_SYNC_NONE:
            yield int(lib.CANOPEN_PARAM_SYNC_EVENT), f"{line}.sync", "sync_event"
        if self.window_us:
            yield int(lib.CANOPEN_PARAM_WINDOW_EVENT), f"{line}.window", "window_event"


def _read_sync(table: Table, line: str) -> Sync:
    """`sync`: true, or a table."""
    if not isinstance(table.raw("sync"), dict):
        return Sync(int(lib.CANOPEN_SYNC_IN_BUS_CYCLE if table.flag("sync") else lib.CANOPEN_SYNC_NONE))
    inner = table.table("sync")
    assert inner is not None
    produce = inner.flag("produce", True)
    every = inner.duration_us("every", *_SYNC_US, required="T#10ms" if produce else "")
    window = inner.duration_us("window", *_SYNC_US) or 0
    if every is not None and window >= every:
        inner.error(f"the window has to end before the next SYNC of {line}", "window")
    counter = inner.number("counter", 2, LAST_SYNC_COUNTER) or 0
    if counter and not produce:
        inner.error("the device that sends SYNC counts it; leave out counter", "counter")
    inner.close()
    kind = lib.CANOPEN_SYNC_BY_TIMER if produce else lib.CANOPEN_SYNC_OF_OTHERS
    return Sync(int(kind), every or 0, window, counter)


def _read_device(table: Table, line: CanopenLine) -> CanopenDevice:
    made = read_connector(CanopenDevice, table, DRIVER, parent=line)
    eds = made.eds = _read_eds(table)
    _read_number(made, table, line, eds)
    timeout = table.duration_us("timeout", *_DURATION_US, 1_000_000) or 1_000_000
    table.only_one("guard", "heartbeat")
    heartbeat = table.duration_us("heartbeat", *_DURATION_US) or _default_heartbeat_us(eds, made.node)
    guard = _read_guard(table)
    _add_losses(made, table)
    every = table.duration_us("every", 1000, _DURATION_US[1])
    synchronous = table.choice("transmission", {"change": False, "sync": True}, False)
    if synchronous and not line.sync:
        table.error("there is no SYNC: write sync = true in [[canopen]]", "transmission")
    settings, channels = table.table("set"), list(table.channels())
    if eds is None:
        return made
    made.add(int(lib.CANOPEN_PARAM_NODE), made.node, "node")
    if guard is not None:
        heartbeat = 0
        _add_guard(made, guard, table, eds)
    elif eds.entry(_HEARTBEAT) is None:
        message = f"{made.name} has no heartbeat (1017): its loss shows by PDOs only"
        if eds.entry(_GUARD_TIME) is not None:
            message += '; it can be guarded: guard = { every = "T#200ms" }'
        table.mistakes.warning(table.value_pos("eds"), message)
        heartbeat = 0
    made.add(int(lib.CANOPEN_PARAM_HEARTBEAT), heartbeat // 1000, "heartbeat")
    made.add(int(lib.CANOPEN_PARAM_TIMEOUT), timeout // 1000, "timeout")
    made.add_bytes(int(lib.CANOPEN_PARAM_EXPECTED), _expected(eds), "expected")
    if heartbeat:
        made.writes.append((_HEARTBEAT, 0, (heartbeat // 1000).to_bytes(2, "little")))
    counted = eds.entry(_SYNC_COUNTER)
    if line.sync_counter and counted is not None and counted.access in WRITABLE:
        made.writes.append((_SYNC_COUNTER, 0, bytes([line.sync_counter])))
    made.writes += writes_of_dcf(eds, made.node, table.mistakes)
    if settings is not None:
        made.writes += _settings(settings, eds, table.mistakes)
    _add_pdos(made, eds, channels, table, line, bool(synchronous), every)
    made.add_bytes(int(lib.CANOPEN_PARAM_CONFIG), concise_dcf(made.writes), "config")
    made.parameters.sort(key=lambda p: p.id)
    return made


def _default_heartbeat_us(eds: Eds | None, node: int) -> int:
    """That of a DCF, if a node can have it."""
    period_us = 1000 * (heartbeat_ms(eds, node) or 0) if eds is not None else 0
    return period_us if _DURATION_US[0] <= period_us <= _DURATION_US[1] else _DEFAULT_HEARTBEAT_US


def _read_number(made: CanopenDevice, table: Table, line: CanopenLine, eds: Eds | None) -> None:
    """The number of a node, which its DCF may give."""
    known = eds.commissioning.node if eds is not None and eds.commissioning is not None else None
    made.node = table.number("node", 1, MAX_NODE, known, required=5 if known is None else None) or 0
    if known is not None and made.node != known:
        assert eds is not None
        name = Path(eds.file).name
        table.error(
            f"{name} is of node {known} (DeviceComissioning), not {made.node}; use one of node {made.node}", "node"
        )
    take_number(table, line.nodes, made.node, made.name)


def take_number(table: Table, nodes: dict[int, str], number: int, name: str) -> None:
    """Gives a node its number, 0 for none; an error if another one of the network has it. `nodes`: who has which."""
    if number in nodes:
        table.error(f"{nodes[number]} has the node number {number}, too", "node")
    elif number:
        nodes[number] = name


@dataclass
class Guard:
    """How a node is guarded: requests each `every_ms`; lost after `life` of them without a reply."""

    every_ms: int
    life: int


def _read_guard(table: Table) -> Guard | None:
    inner = table.table("guard")
    if inner is None:
        return None
    every = inner.duration_us("every", *_DURATION_US, required="T#200ms")
    life = inner.number("life", 1, _MAX_LIFE, _DEFAULT_LIFE) or _DEFAULT_LIFE
    inner.close()
    return Guard((every or _DEFAULT_HEARTBEAT_US) // 1000, life)


def _add_guard(made: CanopenDevice, guard: Guard, table: Table, eds: Eds) -> None:
    """The heartbeat is switched off: a node that has one replies to no guarding."""
    if eds.entry(_GUARD_TIME) is None or eds.entry(_LIFE_TIME_FACTOR) is None:
        table.error(f"{made.name} cannot be guarded (its EDS has no 100C and 100D); use heartbeat", "guard")
        return
    made.add(int(lib.CANOPEN_PARAM_GUARD), guard.every_ms, "guard")
    made.add(int(lib.CANOPEN_PARAM_GUARD_LIFE), guard.life, "life")
    if eds.entry(_HEARTBEAT) is not None:
        made.writes.append((_HEARTBEAT, 0, bytes(2)))
    made.writes.append((_GUARD_TIME, 0, guard.every_ms.to_bytes(2, "little")))
    made.writes.append((_LIFE_TIME_FACTOR, 0, bytes([guard.life])))


def _add_losses(made: CanopenDevice, table: Table) -> None:
    """`required` and `on_lost`."""
    required = table.flag("required")
    if required:
        table.only_one("required", "optional")
    on_lost = table.choice("on_lost", _ON_LOST, int(lib.CANOPEN_LOST_CONTINUE))
    made.add(int(lib.CANOPEN_PARAM_REQUIRED), int(required), "required")
    made.add(int(lib.CANOPEN_PARAM_ON_LOST), on_lost or 0, "on_lost")


def _read_eds(table: Table) -> Eds | None:
    table.only_one("eds", "dcf")
    key = "dcf" if table.raw("dcf") is not None else "eds"
    name = table.text(key, required="valves.eds")
    if name is None:
        return None
    folder = Path(table.pos.file).parent
    try:
        check_inside(folder / name, folder)
        eds = load_eds(folder / name)
    except UsageError as error:
        table.error(str(error).rstrip("."), key)
        return None
    if eds.has_errors:
        first = next(f for f in eds.findings.found if f.severity == "error")
        message = f"{name} has errors, the first in line {first.pos.line}: {first.message.rstrip('.')}"
        table.error(f"{message}; 'plctool canopen check' shows all", key)
        return None
    return eds


def _expected(eds: Eds) -> bytes:
    """1000h, vendor, product and revision; 0 for what the file does not say."""
    kind = eds.entry(_TYPE)
    device_type = kind.default.value if kind is not None and kind.default is not None else 0
    numbers = (device_type, eds.device.vendor, eds.device.product, eds.device.revision)
    return b"".join(int(number or 0).to_bytes(4, "little") for number in numbers)


def concise_dcf(writes: list[tuple[int, int, bytes]]) -> bytes:
    """1F22h: a count, then index, sub-index, size and data of each object."""
    entries = (
        index.to_bytes(2, "little") + bytes([sub]) + len(data).to_bytes(4, "little") + data
        for index, sub, data in writes
    )
    return len(writes).to_bytes(4, "little") + b"".join(entries)


# ---- objects -------------------------------------------------------------------------------------------------------


def _find(entry: Entry, eds: Eds, mistakes: Mistakes) -> tuple[EdsEntry, int | None] | None:
    """The object that a key names, and its bit; None after a mistake."""
    match = _PLACE.fullmatch(entry.key)
    if match is None:
        mistakes.error(entry.key_pos, f"'{entry.key}' is not an object; write for example \"6041:00\"")
        return None
    found = eds.entry(int(match[1], 16), int(match[2] or "0", 16))
    if found is None:
        mistakes.error(entry.key_pos, f"{Path(eds.file).name} has no object {entry.key}")
        return None
    if found.type is None:
        mistakes.error(entry.key_pos, f"{Path(eds.file).name} gives no data type of {found.place}")
        return None
    return found, int(match[3]) if match[3] else None


def _settings(table: Table, eds: Eds, mistakes: Mistakes) -> Iterator[tuple[int, int, bytes]]:
    for entry in table.items():
        found = _find(entry, eds, mistakes)
        if found is None:
            continue
        data = _setting(entry, found[0], mistakes)
        if data is not None:
            yield found[0].index, found[0].sub, data


def _setting(entry: Entry, found: EdsEntry, mistakes: Mistakes) -> bytes | None:
    """The bytes of a value that is written."""
    assert found.type is not None
    if found.access not in WRITABLE:
        mistakes.error(entry.key_pos, f"{found.place} ({found.name}) cannot be written")
        return None
    if not isinstance(entry.value, str | int | float):
        mistakes.error(entry.pos, f"{found.place} needs a number or a text")
        return None
    try:
        value = found.type.parse(str(entry.value))
    except ValueError as error:
        mistakes.error(entry.pos, str(error))
        return None
    low, high = (None if limit is None else limit.value for limit in (found.low, found.high))
    if _is_outside(value, low, high):
        limits = " to ".join("any" if limit is None else found.type.text(limit) for limit in (low, high))
        mistakes.error(entry.pos, f"{found.place} ({found.name}) can be {limits}, not {found.type.text(value)}")
        return None
    return found.type.encode(value)


def _is_outside(value: Value, low: Value | None, high: Value | None) -> bool:
    if not isinstance(value, int | float):
        return False
    return (isinstance(low, int | float) and value < low) or (isinstance(high, int | float) and value > high)


# ---- PDOs ----------------------------------------------------------------------------------------------------------


def _add_pdos(
    made: CanopenDevice,
    eds: Eds,
    channels: list[tuple[Entry, bool]],
    table: Table,
    line: CanopenLine,
    synchronous: bool,
    every_us: int | None,
) -> None:
    for direction in Direction:
        output = direction is Direction.TO_NODE
        items = _items([entry for entry, is_output in channels if is_output is output], output, eds, table.mistakes)
        layout = lay_out(items, direction, made.node, eds, line.free_cobs)
        if layout.missing:
            what = (
                f"{made.name} has {len(layout.available)} PDOs for {'outputs' if output else 'inputs'}, which have no"
            )
            if len(layout.pdos) < len(layout.available):
                free = f"0x{FREE_COBS[-1]:X} to 0x{FREE_COBS[0]:X}"
                what = f"the identifiers {free}, for more than four PDOs of a node, have no"
            table.error(f"{what} room for {layout.missing[0].entry.place}; name fewer objects")
        every_ms = (every_us or 0) // 1000
        kind = _ON_SYNC if synchronous else _ON_CHANGE
        made.writes += layout.writes(kind, 0 if output else every_ms, eds)
        _describe(made, layout, output, synchronous, every_ms)


def _describe(made: CanopenDevice, layout: Layout, output: bool, synchronous: bool, every_ms: int) -> None:
    """The PDOs for the driver, and the places of the channels in them."""
    first = sum(p.id >= lib.CANOPEN_PARAM_PDO for p in made.parameters)
    for number, pdo in enumerate(layout.pdos, first):
        parameter = int(lib.CANOPEN_PARAM_PDO) + number
        flags = int(lib.CANOPEN_PDO_OUTPUT) * output | int(lib.CANOPEN_PDO_SYNC) * synchronous
        late = min(every_ms * _LATE // 2 + 50, 0xFFFF) if every_ms and not output and not synchronous else 0
        c = ffi.new(
            "CANOPEN_PDO *",
            {
                "cob": pdo.cob,
                "size": pdo.size,
                "flags": flags,
                "event_ms": every_ms if output else 0,
                "deadline_ms": late,
            },
        )
        made.add_bytes(parameter, bytes(ffi.buffer(c)))
        for item, bit in pdo.places():
            for channel, of_object in item.channels:
                channel.parameter, channel.parameter_bit = parameter, bit + of_object
                channel.age_us = 0 if output else every_ms * 1000
                made.channels.append(channel)


def _items(entries: list[Entry], output: bool, eds: Eds, mistakes: Mistakes) -> list[Item]:
    items: dict[tuple[int, int], Item] = {}
    for entry in entries:
        found = _find(entry, eds, mistakes)
        if found is None or not _can_be_mapped(entry, found[0], output, mistakes):
            continue
        obj, bit = found
        assert obj.type is not None
        channel = channel_of(
            entry, mistakes, output=output, bits=1 if bit is not None else obj.type.bits, type=_type(obj)
        )
        if bit is not None and bit >= obj.type.bits:
            mistakes.error(entry.key_pos, f"{obj.place} has the bits 0 to {obj.type.bits - 1}")
        elif channel is not None:
            if bit is not None:
                channel.type = None
            item = items.setdefault((obj.index, obj.sub), Item(obj))
            item.channels.append((channel, bit or 0))
    return list(items.values())


def _can_be_mapped(entry: Entry, obj: EdsEntry, output: bool, mistakes: Mistakes) -> bool:
    assert obj.type is not None
    wanted = ("wo", "rw", "rww") if output else ("ro", "rw", "rwr", "const")
    if not obj.mappable:
        problem = "it cannot be in a PDO (PDOMapping in the EDS)"
    elif obj.access not in wanted:
        problem = "it cannot be an output" if output else "it cannot be an input"
    elif obj.type.bits not in _CHANNEL_BITS:
        problem = f"no variable has {obj.type.bits} bits, as {obj.type.name} has"
    else:
        return True
    mistakes.error(entry.key_pos, f"{obj.place} ({obj.name}): {problem}")
    return False


def _type(obj: EdsEntry) -> Type | None:
    """What the variable has to be: a REAL is none of the bits of an integer."""
    assert obj.type is not None
    return {("real", 32): REAL, ("real", 64): LREAL}.get((obj.type.kind, obj.type.bits))
