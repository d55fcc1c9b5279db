"""`[[canopen_device]]`: this PLC as a CANopen device under a foreign manager (IoDrvCanopenDevice).

    [[canopen_device]]
    name = "Field"
    node = 9
    heartbeat = "T#200ms"
    identity = { name = "Mixer", vendor = 0x319, product = 7, revision = 0x10002 }
    read  = { "2100:00" = "Main.count", "2101:00" = "Main.batch" }   # what others read
    write = { "2200:00" = { var = "Main.setpoint", store = true } }  # what others write
    tpdo  = [{ objects = ["2100:00"], every = "T#50ms" }]
    rpdo  = [{ objects = ["2200:00"], deadline = "T#200ms" }]

A key is an object, INDEX or INDEX:SUB in hex. An ARRAY is an object whose sub-indices are its elements. The tool makes
the dictionary; the firmware adds the objects of communication (CanopenDict.h). docs/canopen.md.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from plctool.core import ffi, lib
from plctool.files import Pos
from plctool.iec.types import BYTE, UDINT, ArrayType, Elementary, StringType, SubrangeType, Type, base_of
from plctool.io.canopen.data_types import DATA_TYPES, UNSIGNED8, UNSIGNED32, VISIBLE_STRING, DataType, type_named
from plctool.io.canopen.eds import MAX_PDO_BITS
from plctool.io.canopen.manager import MAX_NODE, take_number
from plctool.io.channels import channel_of
from plctool.io.common import read_connector
from plctool.io.mistakes import Mistakes
from plctool.io.model import Channel, Connector, Context, Parameter
from plctool.io.tables import Entry, Table, each

DRIVER = "IoDrvCanopenDevice"
PLC_PROFILE = 405
LEAST_PDOS = 4  # of each direction, so that a manager can map some
MAX_PDOS = 64
MAX_MAPPINGS = int(lib.CANOPEN_MAPPINGS)
MAX_TEXT = 63
MAX_ELEMENTS = 254
_MOST_LIMITED = 4  # bytes of a value with limits
INVALID, NO_REMOTE = 0x8000_0000, 0x4000_0000
FIRST_RPDO, FIRST_TPDO = 0x200, 0x180
PDO_STEP = 0x100
ON_CHANGE, LAST_SYNC = 255, 240
_DEVICE_TYPE, _NAME, _HARDWARE, _SOFTWARE, _IDENTITY, _SERVER = 0x1000, 0x1008, 0x1009, 0x100A, 0x1018, 0x1200
_FIRST_OBJECT, _LAST_OBJECT = 0x2000, 0xBFFF
_KEY = re.compile(r"([0-9A-Fa-f]{4})(?::([0-9A-Fa-f]{1,2}))?")
_SYNC = re.compile(r"sync(?:/(\d{1,3}))?")
_DURATION_US = (10_000, 30_000_000)
_READ, _WRITE = int(lib.CANOPEN_ACCESS_READ), int(lib.CANOPEN_ACCESS_WRITE)
_TPDO, _RPDO, _STORED = int(lib.CANOPEN_ACCESS_TPDO), int(lib.CANOPEN_ACCESS_RPDO), int(lib.CANOPEN_ACCESS_STORED)


@dataclass
class Value:
    """A variable that others read or write. `sub` is None if the key has none."""

    index: int
    sub: int | None
    writable: bool
    stored: bool
    channel: Channel
    pos: Pos


@dataclass
class Pdo:
    """A PDO as described. `objects`: keys with their places."""

    objects: list[Entry]
    type: int
    inhibit: int
    event_ms: int
    cob: int | None
    pos: Pos


@dataclass(eq=False)
class CanopenSlave(Connector):
    """This PLC as a device."""

    faults = ()
    counters = {
        name: int(getattr(lib, f"CANOPEN_DEVICE_{name.upper()}"))
        for name in ("state", "own_node", "transfers", "aborts", "last_abort", "received", "sent", "emcy")
    }

    node: int = 0
    values: list[Value] = field(default_factory=list)
    pdos: dict[bool, list[Pdo]] = field(default_factory=dict)  # by "it is a TPDO"
    objects: dict[tuple[int, int], dict[str, int]] = field(default_factory=dict)
    texts: bytearray = field(default_factory=bytearray)
    limits: dict[tuple[int, int], SubrangeType] = field(default_factory=dict)

    def add(self, number: int, value: int, name: str = "") -> None:
        """A parameter of 32 bits."""
        self.parameters.append(Parameter(number, UDINT, value, name))

    def add_bytes(self, number: int, value: bytes) -> None:
        """A parameter of bytes; nothing if there are none."""
        if value:
            self.parameters.append(Parameter(number, ArrayType(BYTE, ((0, len(value) - 1),)), value))

    def complete(self, mistakes: Mistakes) -> None:
        """Makes the dictionary of the types of the variables."""
        size = 0
        for value in self.values:
            t = value.channel.variable_type
            if t is not None:
                size = self._add_value(value, t, -(-size // 8) * 8, mistakes)
        self._add_counts(mistakes)
        for is_tpdo, number in ((False, lib.CANOPEN_DEVICE_RPDOS), (True, lib.CANOPEN_DEVICE_TPDOS)):
            self.add_bytes(int(number), b"".join(self._settings(is_tpdo, mistakes)))
        self.add_bytes(int(lib.CANOPEN_DEVICE_OBJECTS), b"".join(self._packed()))
        self.add_bytes(int(lib.CANOPEN_DEVICE_TEXTS), bytes(self.texts))
        self.add_bytes(int(lib.CANOPEN_DEVICE_LIMITS), b"".join(self._packed_limits()))
        self.add(int(lib.CANOPEN_DEVICE_VALUES), size)
        self.parameters.sort(key=lambda p: p.id)

    # ---- the dictionary ----

    def add_constant(self, index: int, sub: int, kind: DataType, value: int, *, of_node: bool = False) -> None:
        """An object that never changes."""
        where = lib.CANOPEN_OF_NODE if of_node else lib.CANOPEN_CONSTANT
        self._add(index, sub, kind, _READ, where=int(where), size=kind.size, place=value)

    def add_text(self, index: int, text: str) -> None:
        """A text that never changes."""
        data = text.encode("ascii")
        where = int(lib.CANOPEN_TEXT)
        self._add(index, 0, VISIBLE_STRING, _READ, where=where, size=len(data), place=len(self.texts))
        self.texts += data

    def _add(self, index: int, sub: int, kind: DataType, access: int, *, where: int, size: int, place: int) -> None:
        self.objects[index, sub] = {
            "index": index, "sub": sub, "type": kind.code, "access": access, "where": where, "size": size,
            "place": place,
        }  # fmt: skip

    def _add_value(self, value: Value, t: Type, place: int, mistakes: Mistakes) -> int:
        """The objects of a variable whose value is at `place`; returns where the next one may be."""
        base = base_of(t)
        elements = 1
        if isinstance(base, ArrayType):
            elements = _elements_of(base)
            base = base_of(base.element)
            if value.sub is not None:
                key = f"{value.index:04X}"
                mistakes.error(value.pos, f'{value.channel.target} is {t}: write "{key}", whose sub-indices it has')
                return place
        kind = _type_of(base)
        if kind is None or not 1 <= elements <= MAX_ELEMENTS:
            what = f"no object of CANopen can be {t}; name its elements, or use another type"
            mistakes.error(value.pos, f"{value.channel.target}: {what}")
            return place
        first = 0 if value.sub is None else value.sub
        for number in range(elements):
            sub = first if elements == 1 and not isinstance(base_of(t), ArrayType) else number + 1
            if (value.index, sub) in self.objects:
                mistakes.error(value.pos, f"the object {value.index:04X}:{sub:02X} is there already")
                return place
            self._add(
                value.index, sub, kind, self._access(value, kind), where=int(lib.CANOPEN_IN_VALUES),
                size=kind.size or base.size - 1, place=place + number * base.size,
            )  # fmt: skip
        if isinstance(t, SubrangeType) and value.writable and kind.size <= _MOST_LIMITED:
            self.objects[value.index, first]["access"] |= int(lib.CANOPEN_ACCESS_LIMITED)
            self.limits[value.index, first] = t
        value.channel.parameter, value.channel.parameter_bit = int(lib.CANOPEN_DEVICE_VALUE), 8 * place
        return place + elements * base.size

    @staticmethod
    def _access(value: Value, kind: DataType) -> int:
        access = _READ | _WRITE * value.writable | _STORED * value.stored
        mappable = kind.bits != 0
        return access | (_RPDO if value.writable else _TPDO) * mappable

    def _add_counts(self, mistakes: Mistakes) -> None:
        """Sub-index 0 of each object with others: the highest of them."""
        highest: dict[int, int] = {}
        for index, sub in self.objects:
            highest[index] = max(sub, highest.get(index, 0))
        for index, sub in highest.items():
            if sub > 0 and (index, 0) not in self.objects:
                self.add_constant(index, 0, UNSIGNED8, sub)
            elif sub > 0 and index >= _FIRST_OBJECT and self.objects[index, 0]["where"] == lib.CANOPEN_IN_VALUES:
                pos = next(v.pos for v in self.values if v.index == index and not v.sub)
                mistakes.error(
                    pos, f"{index:04X}:00 is the number of the sub-indices that {index:04X} has; take another"
                )

    def _packed(self) -> Iterator[bytes]:
        for key in sorted(self.objects):
            yield bytes(ffi.buffer(ffi.new("CANOPEN_OBJECT *", self.objects[key])))

    def _packed_limits(self) -> Iterator[bytes]:
        mask = (1 << 8 * _MOST_LIMITED) - 1
        for (index, sub), t in sorted(self.limits.items()):
            limit = {
                "index": index, "sub": sub, "is_signed": int(t.base.signed), "low": t.low & mask, "high": t.high & mask,
            }  # fmt: skip
            yield bytes(ffi.buffer(ffi.new("CANOPEN_LIMIT *", limit)))

    # ---- PDOs ----

    def _settings(self, is_tpdo: bool, mistakes: Mistakes) -> Iterator[bytes]:
        described = self.pdos.get(is_tpdo, [])
        for number in range(max(LEAST_PDOS, len(described))):
            pdo = described[number] if number < len(described) else None
            yield bytes(ffi.buffer(ffi.new("CANOPEN_PDO_SETTING *", self._setting(is_tpdo, number, pdo, mistakes))))

    def _setting(self, is_tpdo: bool, number: int, pdo: Pdo | None, mistakes: Mistakes) -> dict[str, object]:
        first = FIRST_TPDO if is_tpdo else FIRST_RPDO
        of_node = number < LEAST_PDOS and (pdo is None or pdo.cob is None)
        cob = first + PDO_STEP * number if of_node else 0 if pdo is None else pdo.cob or 0
        maps = [] if pdo is None else list(self._mapping(is_tpdo, pdo, mistakes))
        flags = (NO_REMOTE if is_tpdo else 0) | (0 if maps else INVALID)
        return {
            "cob": cob | flags,
            "of_node": int(of_node),
            "type": ON_CHANGE if pdo is None else pdo.type,
            "count": len(maps),
            "inhibit": 0 if pdo is None else pdo.inhibit,
            "event_ms": 0 if pdo is None else pdo.event_ms,
            "map": maps + [0] * (MAX_MAPPINGS - len(maps)),
        }

    def _mapping(self, is_tpdo: bool, pdo: Pdo, mistakes: Mistakes) -> Iterator[int]:
        bits = 0
        for entry in pdo.objects:
            match = _KEY.fullmatch(str(entry.value))
            key = (int(match[1], 16), int(match[2] or "0", 16)) if match else (0, 0)
            found = self.objects.get(key)
            wanted = _TPDO if is_tpdo else _RPDO
            if found is None or not found["access"] & wanted:
                what = "read" if is_tpdo else "write"
                mistakes.error(entry.pos, f"{entry.value} is not an object of [canopen_device.{what}] for a PDO")
                continue
            size = DATA_TYPES[found["type"]].bits
            bits += size
            if bits > MAX_PDO_BITS:
                mistakes.error(entry.pos, f"a PDO has 64 bits; with {entry.value} there are {bits}")
                return
            yield key[0] << 16 | key[1] << 8 | size


def _elements_of(t: ArrayType) -> int:
    """The elements of an array of one dimension, 0 for one of more."""
    return t.count if len(t.bounds) == 1 else 0


def _type_of(base: Type) -> DataType | None:
    if isinstance(base, StringType):
        return None if base.wide else VISIBLE_STRING
    if not isinstance(base, Elementary):
        return None
    try:
        return type_named(base.name)
    except ValueError:
        return None


# ---- reading -------------------------------------------------------------------------------------------------------


def read_canopen_device(table: Table, context: Context) -> list[Connector]:
    """The device of a table."""
    made = read_connector(CanopenSlave, table, DRIVER, default_name="canopen_device")
    network = table.number("network", 0, 15, 0) or 0
    made.takes = "the CANopen device of this PLC"
    lss = table.flag("lss")
    made.node = table.number("node", 1, MAX_NODE, required=None if lss else 9) or 0
    take_number(table, context.nodes.setdefault(network, {}), made.node, f"this PLC as {made.name}")
    heartbeat = table.duration_us("heartbeat", *_DURATION_US) or 0
    flags = int(lib.CANOPEN_DEVICE_STORE) * table.flag("store", True) | int(lib.CANOPEN_DEVICE_LSS) * lss
    for number, value, name in (
        (lib.CANOPEN_DEVICE_NETWORK, network, "network"),
        (lib.CANOPEN_DEVICE_NODE, made.node, "node"),
        (lib.CANOPEN_DEVICE_HEARTBEAT, heartbeat // 1000, "heartbeat"),
        (lib.CANOPEN_DEVICE_FLAGS, flags, "flags"),
    ):
        made.add(int(number), value, name)
    _identify(table, made)
    for key, writable in (("read", False), ("write", True)):
        _read_values(table, key, writable, made)
    for key, is_tpdo in (("rpdo", False), ("tpdo", True)):
        made.pdos[is_tpdo] = each(table.tables(key), lambda inner, is_tpdo=is_tpdo: _read_pdo(inner, is_tpdo))  # type: ignore[misc]
        if len(made.pdos[is_tpdo]) > MAX_PDOS:
            table.error(f"there are {len(made.pdos[is_tpdo])} PDOs; {MAX_PDOS} can be in a direction", key)
            del made.pdos[is_tpdo][MAX_PDOS:]
        for pdo in made.pdos[is_tpdo][LEAST_PDOS:]:
            if pdo.cob is None:
                table.mistakes.error(pdo.pos, f"only {LEAST_PDOS} PDOs have an identifier by the node; give it a cob")
    _read_emergency(table, made)
    return [made]


def _identify(table: Table, made: CanopenSlave) -> None:
    identity = table.table("identity")
    keys = identity if identity is not None else table.empty("identity")
    device_type = keys.number("device_type", 0, 0xFFFF_FFFF, PLC_PROFILE)
    made.add_constant(_DEVICE_TYPE, 0, UNSIGNED32, PLC_PROFILE if device_type is None else device_type)
    for index, key, default in ((_NAME, "name", made.name), (_HARDWARE, "hardware", ""), (_SOFTWARE, "software", "")):
        text = keys.text(key, default) or ""
        if len(text) > MAX_TEXT or not text.isascii() or not (text.isprintable() or not text):
            keys.error(f"{key} can have {MAX_TEXT} printable ASCII characters", key)
        elif text:
            made.add_text(index, text)
    made.add_constant(_IDENTITY, 0, UNSIGNED8, 4)
    for sub, key in enumerate(("vendor", "product", "revision"), 1):
        made.add_constant(_IDENTITY, sub, UNSIGNED32, keys.number(key, 0, 0xFFFF_FFFF, 0) or 0)
    made.add_constant(_SERVER, 0, UNSIGNED8, 2)
    made.add_constant(_SERVER, 1, UNSIGNED32, 0x600, of_node=True)
    made.add_constant(_SERVER, 2, UNSIGNED32, 0x580, of_node=True)
    if identity is not None:
        identity.close()


def _read_values(table: Table, key: str, writable: bool, made: CanopenSlave) -> None:
    names = table.table(key)
    for entry in names.items() if names is not None else ():
        match = _KEY.fullmatch(entry.key)
        if match is None or not _FIRST_OBJECT <= int(match[1], 16) <= _LAST_OBJECT:
            message = f"'{entry.key}' is not an object from 2000 to BFFF; write for example \"2100:00\""
            table.mistakes.error(entry.key_pos, message)
            continue
        sub = int(match[2], 16) if match[2] else None
        if sub is not None and sub > MAX_ELEMENTS:
            table.mistakes.error(entry.key_pos, f"the sub-indices of {match[1]} are 00 to FE")
            continue
        stored = writable and isinstance(entry.value, Table) and entry.value.flag("store")
        channel = channel_of(entry, table.mistakes, output=not writable, holds=True)
        if channel is not None:
            made.values.append(Value(int(match[1], 16), sub, writable, stored, channel, entry.key_pos))
            made.channels.append(channel)


def _read_pdo(table: Table, is_tpdo: bool) -> Pdo:
    objects = table.strings("objects")
    if not objects:
        table.error('a PDO needs objects: write for example objects = ["2100:00"]')
    if len(objects) > MAX_MAPPINGS:
        table.error(f"a PDO has up to {MAX_MAPPINGS} objects, not {len(objects)}", "objects")
        objects = objects[:MAX_MAPPINGS]
    kind = _transmission(table)
    key = "every" if is_tpdo else "deadline"
    event = table.duration_us(key, 1000, _DURATION_US[1]) or 0
    inhibit = (table.duration_us("inhibit", 1000, 6_000_000) or 0) if is_tpdo else 0
    cob = table.number("cob", 0x181, 0x6DF)
    if cob is not None and (0x581 <= cob <= 0x5FF or 0x601 <= cob <= 0x67F):
        table.error(f"the identifier 0x{cob:X} is one of SDO; choose another", "cob")
    return Pdo(objects, kind, inhibit // 100, event // 1000, cob, table.pos)


def _transmission(table: Table) -> int:
    text = table.text("transmission", "change") or "change"
    match = _SYNC.fullmatch(text)
    number = int(match[1] or "1") if match else 0
    if match and 1 <= number <= LAST_SYNC:
        return number
    if text != "change":
        table.error(f'transmission cannot be \'{text}\'; it can be "change", "sync" or "sync/2"', "transmission")
    return ON_CHANGE


def _read_emergency(table: Table, made: CanopenSlave) -> None:
    target = table.text("emergency")
    if target is None:
        return
    entry = Entry("emergency", table.value_pos("emergency"), target, table.value_pos("emergency"))
    channel = channel_of(entry, table.mistakes, output=True, bits=16, parameter=int(lib.CANOPEN_DEVICE_EMERGENCY))
    if channel is not None:
        made.channels.append(channel)
