"""`[[canopen_device]]`: this PLC as a CANopen device under a foreign manager (IoDrvCanopenDevice).

    [[canopen_device]]
    name = "Field"
    node = 9
    heartbeat = "T#200ms"
    identity = { name = "Mixer", vendor = 0x319, product = 7, revision = 0x10002 }
    read  = { "2100:00" = "Main.count", "A0C0:01" = "Main.power", auto = ["Main.energy"] }   # what others read
    write = { "2200:00" = { var = "Main.setpoint", store = true } }  # what others write
    tpdo  = [{ objects = ["2100:00"], every = "T#50ms" }]
    rpdo  = [{ objects = ["2200:00"], deadline = "T#200ms" }]

A key is an object, INDEX or INDEX:SUB in hex. An ARRAY is an object whose sub-indices are its elements. Objects from
A000 on are the network variables of CiA 405 (profile.py), which `auto` places by their types. The tool makes the
dictionary; the firmware adds the objects of communication (CanopenDict.h). docs/canopen.md.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from plctool.core import ffi, lib
from plctool.files import Pos
from plctool.iec.types import BYTE, UDINT, ArrayType, Elementary, StringType, SubrangeType, Type, base_of
from plctool.io.canopen.data_types import (
    DATA_TYPES,
    DOMAIN,
    UNSIGNED8,
    UNSIGNED32,
    VISIBLE_STRING,
    DataType,
    type_named,
)
from plctool.io.canopen.eds import MAX_PDO_BITS
from plctool.io.canopen.manager import MAX_NODE, take_number
from plctool.io.canopen.profile import (
    END_RESERVED,
    FIRST_AREA,
    MAX_SUB,
    ProgramFacts,
    memory_bytes,
    place,
    program_objects,
    segment_at,
    segment_of,
)
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
_MOST_LIMITED = 4  # bytes of a value with limits
INVALID, NO_REMOTE = 0x8000_0000, 0x4000_0000
FIRST_RPDO, FIRST_TPDO = 0x200, 0x180
PDO_STEP = 0x100
ON_CHANGE, LAST_SYNC = 255, 240
REASON = 0x5FFF  # why an image was refused
_PROGRAM_PLACES = (
    (0x1F50, lib.PROGRAM_DATA, DOMAIN, 1, "wo"),
    (0x1F51, lib.PROGRAM_CONTROL, UNSIGNED8, 1, "rw"),
    (0x1F56, lib.PROGRAM_IDENTIFICATION, UNSIGNED32, 4, "ro"),
    (0x1F57, lib.PROGRAM_STATUS, UNSIGNED32, 4, "ro"),
    (REASON, lib.PROGRAM_REASON, VISIBLE_STRING, 63, "ro"),
)
_DEVICE_TYPE, _NAME, _HARDWARE, _SOFTWARE, _IDENTITY, _SERVER = 0x1000, 0x1008, 0x1009, 0x100A, 0x1018, 0x1200
_FIRST_OBJECT, _LAST_OBJECT = 0x2000, 0xBFFF
_TIME, _TAKES_TIME = 0x1012, 0x8000_0100
_KEY = re.compile(r"([0-9A-Fa-f]{4})(?::([0-9A-Fa-f]{1,2}))?")
_SYNC = re.compile(r"sync(?:/(\d{1,3}))?")
_DURATION_US = (10_000, 30_000_000)
_READ, _WRITE = int(lib.CANOPEN_ACCESS_READ), int(lib.CANOPEN_ACCESS_WRITE)
_TPDO, _RPDO, _STORED = int(lib.CANOPEN_ACCESS_TPDO), int(lib.CANOPEN_ACCESS_RPDO), int(lib.CANOPEN_ACCESS_STORED)


@dataclass
class Value:
    """A variable that others read or write. `sub` is None if the key has none; `auto`: both follow from its name and
    type."""

    index: int
    sub: int | None
    writable: bool
    stored: bool
    channel: Channel
    pos: Pos
    auto: bool = False


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
    shows_program: bool = False  # by 9501h to 9800h

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
        for value in sorted(self.values, key=lambda value: value.auto):  # those that have an object first
            t = value.channel.variable_type
            if t is not None:
                size = self._add_value(value, t, -(-size // 8) * 8, mistakes)
        self._add_counts(mistakes)
        for is_tpdo, number in ((False, lib.CANOPEN_DEVICE_RPDOS), (True, lib.CANOPEN_DEVICE_TPDOS)):
            self.add_bytes(int(number), b"".join(self._settings(is_tpdo, mistakes)))
        self._add_dictionary()
        self.add_bytes(int(lib.CANOPEN_DEVICE_LIMITS), b"".join(self._packed_limits()))
        self.add(int(lib.CANOPEN_DEVICE_VALUES), size)
        self.parameters.sort(key=lambda p: p.id)

    def describe(self, program: ProgramFacts) -> None:
        """Adds the objects that describe the program."""
        if not self.shows_program:
            return
        for constant in program_objects(program):
            if isinstance(constant.value, str):
                self.add_text(constant.index, constant.value, constant.sub)
            else:
                self.add_constant(constant.index, constant.sub, constant.type, constant.value)
        tables = (int(lib.CANOPEN_DEVICE_OBJECTS), int(lib.CANOPEN_DEVICE_TEXTS))
        self.parameters = [parameter for parameter in self.parameters if parameter.id not in tables]
        self._add_dictionary()

    # ---- the dictionary ----

    def _add_dictionary(self) -> None:
        self.add_bytes(int(lib.CANOPEN_DEVICE_OBJECTS), b"".join(self._packed()))
        self.add_bytes(int(lib.CANOPEN_DEVICE_TEXTS), bytes(self.texts))

    def add_constant(self, index: int, sub: int, kind: DataType, value: int, *, of_node: bool = False) -> None:
        """An object that never changes."""
        where = lib.CANOPEN_OF_NODE if of_node else lib.CANOPEN_CONSTANT
        self._add(index, sub, kind, _READ, where=int(where), size=kind.size, place=value)

    def add_text(self, index: int, text: str, sub: int = 0) -> None:
        """A text that never changes."""
        data = text.encode("ascii")
        where = int(lib.CANOPEN_TEXT)
        self._add(index, sub, VISIBLE_STRING, _READ, where=where, size=len(data), place=len(self.texts))
        self.texts += data

    def add_program(self) -> None:
        """The objects by which a manager replaces the program (CanopenProgram.h)."""
        for index, what, kind, size, access in _PROGRAM_PLACES:
            flags = _READ * ("r" in access) | _WRITE * ("w" in access)
            where = int(lib.CANOPEN_PROGRAM_OBJECT)
            self._add(index, 1, kind, flags, where=where, size=size, place=int(what))

    def _add(self, index: int, sub: int, kind: DataType, access: int, *, where: int, size: int, place: int) -> None:
        self.objects[index, sub] = {
            "index": index, "sub": sub, "type": kind.code, "access": access, "where": where, "size": size,
            "place": place,
        }  # fmt: skip

    def _add_value(self, value: Value, t: Type, place: int, mistakes: Mistakes) -> int:
        """The objects of a variable whose value is at `place`; returns where the next one may be."""
        base = base_of(t)
        is_array = isinstance(base, ArrayType)
        elements = 1
        if isinstance(base, ArrayType):
            elements = _elements_of(base)
            base = base_of(base.element)
        kind = _type_of(base)
        if kind is None or not 1 <= elements <= MAX_SUB:
            what = f"no object of CANopen can be {t}; name its elements, or use another type"
            mistakes.error(value.pos, f"{value.channel.target}: {what}")
            return place
        try:
            kind = self._settle(value, t, kind, base.size, elements)
        except _MistakeError as mistake:
            mistakes.error(value.pos, str(mistake))
            return place
        first = value.sub if value.sub is not None else int(is_array)
        for number in range(elements):
            sub = first + number
            if (value.index, sub) in self.objects or (value.index == REASON and (REASON, 1) in self.objects):
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

    def _settle(self, value: Value, t: Type, kind: DataType, size: int, elements: int) -> DataType:
        """Finds the object of a variable and the type that it has there. Raises _MistakeError."""
        target = value.channel.target
        if value.auto:
            segment = segment_of(kind, is_output=value.writable)
            if segment is None:
                raise _MistakeError(f'CiA 405 has no network variables of {t}: write "2100" = "{target}", for example')
            found = place(target, segment, elements, self.objects.keys())
            if found is None:
                raise _MistakeError(
                    f"the area of {kind.name} has no place for {target}; give it an object from 2000 on"
                )
            value.index, value.sub = found
            return kind
        if not FIRST_AREA <= value.index < END_RESERVED:
            if elements > 1 and value.sub is not None:
                raise _MistakeError(f'{target} is {t}: write "{value.index:04X}", whose sub-indices it has')
            return kind
        segment = segment_at(value.index)
        if segment is None:
            raise _MistakeError(f"CiA 405 assigns no type to {value.index:04X}; take an object from A000 to A8FF")
        value.sub = value.sub or 1
        if segment.is_output is not value.writable:
            way, other = ("write", "read") if segment.is_output else ("read", "write")
            area = f"{value.index:04X} is in an area of CiA 405 that others {way}"
            raise _MistakeError(f'{area}, and {target} is in {other}; let "auto" choose, or take another object')
        if segment.type.kind != kind.kind or memory_bytes(segment.type) != size:
            raise _MistakeError(f"{value.index:04X} is an object of {segment.type.name}, but {target} is {t}")
        if value.sub + elements - 1 > MAX_SUB:
            raise _MistakeError(f"{value.index:04X}:{value.sub:02X} and those that follow have no room for {target}")
        return segment.type

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

    def _key_of(self, text: str) -> tuple[int, int]:
        """The object that a PDO names by its number, or by the variable that `auto` has placed."""
        match = _KEY.fullmatch(text)
        if match is not None:
            sub = int(FIRST_AREA <= int(match[1], 16) < END_RESERVED) if match[2] is None else int(match[2], 16)
            return int(match[1], 16), sub
        return next(
            ((v.index, v.sub or 0) for v in self.values if v.auto and v.channel.target.casefold() == text.casefold()),
            (0, 0),
        )

    def _mapping(self, is_tpdo: bool, pdo: Pdo, mistakes: Mistakes) -> Iterator[int]:
        bits = 0
        for entry in pdo.objects:
            key = self._key_of(str(entry.value))
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


class _MistakeError(Exception):
    """A message about a value."""


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
    download, takes_time = table.flag("download"), table.flag("time")
    flags = (
        int(lib.CANOPEN_DEVICE_STORE) * table.flag("store", True)
        | int(lib.CANOPEN_DEVICE_LSS) * lss
        | int(lib.CANOPEN_DEVICE_DOWNLOAD) * download
        | int(lib.CANOPEN_DEVICE_TIME) * takes_time
    )
    if download:
        made.add_program()
    for number, value, name in (
        (lib.CANOPEN_DEVICE_NETWORK, network, "network"),
        (lib.CANOPEN_DEVICE_NODE, made.node, "node"),
        (lib.CANOPEN_DEVICE_HEARTBEAT, heartbeat // 1000, "heartbeat"),
        (lib.CANOPEN_DEVICE_FLAGS, flags, "flags"),
    ):
        made.add(int(number), value, name)
    made.shows_program = table.flag("program")
    _identify(table, made)
    if takes_time:
        made.add_constant(_TIME, 0, UNSIGNED32, _TAKES_TIME)
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
    if names is None:
        return
    for entry in names.strings("auto"):
        target = str(entry.value)
        channel = channel_of(replace(entry, key=target), table.mistakes, output=not writable, holds=True)
        if channel is not None:
            made.values.append(Value(0, None, writable, False, channel, entry.pos, auto=True))
            made.channels.append(channel)
    for entry in names.items():
        if entry.key == "auto":
            continue
        match = _KEY.fullmatch(entry.key)
        if match is None or not _FIRST_OBJECT <= int(match[1], 16) <= _LAST_OBJECT:
            message = f"'{entry.key}' is not an object from 2000 to BFFF; write for example \"2100:00\""
            table.mistakes.error(entry.key_pos, message)
            continue
        sub = int(match[2], 16) if match[2] else None
        if sub is not None and sub > MAX_SUB:
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
